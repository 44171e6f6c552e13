# SPDX-License-Identifier: Apache-2.0
"""Draw the house from its imports, for ``docs/explanation/architecture.md``."""

import ast
from dataclasses import dataclass
from html import escape

from house import STAGES, imports_of, modules

CLI, VOCABULARY = "command line", "vocabulary"
FLOORS = ((CLI,), ("benchmarks",), ("synth", "methods", "eval", "reports"), (VOCABULARY,))
"""Wings of the house, from the roof down: a wing stands on those below it alone."""

WIDTH, MARGIN, GAP, FLOOR_GAP = 960, 16, 20, 64
LINE, HEAD = 17, 30
"""Heights of a line of text and of a heading, pixels."""
STYLE = (
    "text{font:13px system-ui,sans-serif;fill:#222}.name{font-weight:600;font-size:15px}"
    "rect{fill:#f6f4ee;stroke:#8a8577}.ground{fill:#fff;stroke:none}"
    "line{stroke:#5a7d9a;stroke-width:1.5}.far{fill:#41627c;font-size:12px}.far{text-anchor:end}"
)


@dataclass(frozen=True, slots=True)
class Box:
    """Place of a wing in the picture, pixels."""

    x: float
    y: float
    width: float
    height: float


def wing_of(name: str) -> str:
    """Return the wing that a module belongs to."""
    part = name.split(".")[1] if "." in name else ""
    if part in STAGES:
        return part
    return CLI if part in ("cli", "__main__") else VOCABULARY


def rooms() -> dict[str, list[str]]:
    """Return the packages of each wing, in alphabetical order."""
    found: dict[str, set[str]] = {wing: set() for floor in FLOORS for wing in floor}
    for module in modules().values():
        found[wing_of(module.name)].add(short_name(module.package))
    return {wing: sorted(names) for wing, names in found.items()}


def arrows() -> list[tuple[str, str]]:
    """Return which wing imports which, as pairs (from, to)."""
    pairs = {(wing_of(name), wing_of(found.target)) for name in modules() for found in imports_of(name)}
    return sorted(pair for pair in pairs if pair[0] != pair[1])


def picture() -> str:
    """Return the house as an SVG: wings with their packages, and an arrow to each wing next below.

    Other imports are named in the wing instead of drawn across others.
    """
    boxes = _boxes()
    height = max(box.y + box.height for box in boxes.values()) + MARGIN
    near = [pair for pair in arrows() if floor_of(pair[1]) == floor_of(pair[0]) + 1]
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {height:.0f}" role="img">',
        "<title>The packages of graycard and what imports what</title>",
        f"<style>{STYLE}</style>",
        '<defs><marker id="head" viewBox="0 0 8 8" refX="8" refY="4" markerWidth="8" markerHeight="8" '
        'orient="auto"><path d="M0 0L8 4L0 8z" fill="#5a7d9a"/></marker></defs>',
        f'<rect class="ground" width="{WIDTH}" height="{height:.0f}"/>',
        *[_wing(boxes[wing], wing, names) for wing, names in rooms().items()],
        *[_arrow(boxes, pair, near) for pair in near],
        "</svg>",
    ]
    return "\n".join(parts) + "\n"


def floor_of(wing: str) -> int:
    """Return the floor of a wing, counted from the roof."""
    return next(number for number, floor in enumerate(FLOORS) if wing in floor)


def table() -> str:
    """Return the table of packages, each with the first sentence of its docstring."""
    rows = ["| package | what it is |", "| --- | --- |"]
    for package in sorted({module.package for module in modules().values()}):
        doc = (ast.get_docstring(modules()[package].tree) or "").partition("\n\n")[0].replace("\n", " ")
        rows.append(f"| `{short_name(package)}` | {doc.replace('``', '`').rstrip('.')} |")
    return "\n".join(rows) + "\n"


def short_name(package: str) -> str:
    """Return a package's name without the root; the root keeps its own."""
    return package.removeprefix("graycard.")


def _columns(floor: tuple[str, ...]) -> int:
    """Columns of package names in a wing: a wing alone on its floor is wide."""
    return 3 if len(floor) == 1 else 1


def _boxes() -> dict[str, Box]:
    found, y, names = {}, float(MARGIN), rooms()
    for floor in FLOORS:
        width = (WIDTH - 2 * MARGIN - GAP * (len(floor) - 1)) / len(floor)
        columns = _columns(floor)
        lines = max(-(-len(names[wing]) // columns) for wing in floor)
        height = HEAD + LINE * lines + 12
        for place, wing in enumerate(floor):
            found[wing] = Box(MARGIN + place * (width + GAP), y, width, height)
        y += height + FLOOR_GAP
    return found


def _wing(box: Box, wing: str, names: list[str]) -> str:
    columns = _columns(FLOORS[floor_of(wing)])
    lines = -(-len(names) // columns)
    far = [end for start, end in arrows() if start == wing and _is_far(wing, end)]
    texts = [_text("name", box.x + 12, box.y + 21, wing)]
    if far:
        texts.append(_text("far", box.x + box.width - 12, box.y + 21, f"also imports {', '.join(far)}"))
    for number, name in enumerate(names):
        x = box.x + 12 + (number // lines) * box.width / columns
        y = box.y + HEAD + 14 + LINE * (number % lines)
        texts.append(_text("room", x, y, name.removeprefix(f"{wing}.")))
    size = f'width="{box.width:.0f}" height="{box.height:.0f}"'
    return "\n".join(["<g>", f'<rect x="{box.x:.0f}" y="{box.y:.0f}" {size} rx="6"/>', *texts, "</g>"])


def _text(kind: str, x: float, y: float, words: str) -> str:
    return f'<text class="{kind}" x="{x:.0f}" y="{y:.0f}">{escape(words)}</text>'


def _is_far(start: str, end: str) -> bool:
    """Tell whether an import leads elsewhere than to the floor next below."""
    return floor_of(end) != floor_of(start) + 1


def _arrow(boxes: dict[str, Box], pair: tuple[str, str], near: list[tuple[str, str]]) -> str:
    """Draw an arrow from the lower edge of a wing to the upper edge of another."""
    start, end = boxes[pair[0]], boxes[pair[1]]
    x1 = _port(start, pair, sorted((p for p in near if p[0] == pair[0]), key=lambda p: boxes[p[1]].x))
    x2 = _port(end, pair, sorted((p for p in near if p[1] == pair[1]), key=lambda p: boxes[p[0]].x))
    y1, y2 = start.y + start.height, end.y
    return f'<line x1="{x1:.0f}" y1="{y1:.0f}" x2="{x2:.0f}" y2="{y2:.0f}" marker-end="url(#head)"/>'


def _port(box: Box, pair: tuple[str, str], pairs: list[tuple[str, str]]) -> float:
    """Return where on the edge of a box one of several arrows begins or ends, pixels."""
    return box.x + box.width * (pairs.index(pair) + 1) / (len(pairs) + 1)
