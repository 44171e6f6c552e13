# SPDX-License-Identifier: Apache-2.0
"""Pages of docs/ that are made of the code of eval; ``make docs`` writes them."""

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from xml.etree import ElementTree as Xml

import graycard.eval as ge
from graycard.eval.protocols import Experiment, protocol_spread

REFERENCE = Path(__file__).parents[2] / "docs" / "reference"
METRICS, SPREAD = REFERENCE / "metrics.md", REFERENCE / "protocol-spread.svg"
"""Page of all metrics, and the figure of protocols."""
SHARES = (0.10, 0.25, 0.60)
"""Parts of the picture that the object covers in the figure of the spread."""

WIDTH, ROW, LEFT, RIGHT, TOP = 760, 24, 130, 20, 60
"""SVG units: of the figure, of a row, of what is beside and above the dots."""
LOW, HIGH = 10, 40
"""dB at the ends of the axis."""
COLOURS = ("#4477aa", "#228833", "#ee6677")
"""Colours of Paul Tol's bright scheme, which the colour-blind can tell apart."""


def metric_table() -> str:
    """Return the table of metrics in Markdown."""
    head = ["| metric | title | unit | best | gauge | ignores |", "| --- | --- | --- | --- | --- | --- |"]
    rows = [
        f"| `{m.id}` | {m.record.title} | {m.record.unit} | {m.record.optimum:g} | {m.gauge or ''} | "
        f"{', '.join(m.record.ignores)} |"
        for m in ge.registry()
    ]
    return "\n".join([*head, *rows]) + "\n"


def reference_table() -> str:
    """Return the table of tolerances in Markdown."""
    head = ["| number | held against | within |", "| --- | --- | --- |"]
    rows = [
        f"| {r.name} | {r.against} | {r.tolerance:g}{'' if r.unit == '1' else ' ' + r.unit} |"
        for r in ge.references()
    ]
    return "\n".join([*head, *rows]) + "\n"


def ceiling_table() -> str:
    """Return which metrics have a noise ceiling, and why others have none, in Markdown."""
    head = ["| metrics | ceiling |", "| --- | --- |"]
    by_ceiling: dict[ge.Ceiling, list[str]] = {}
    for metric in ge.registry():
        by_ceiling.setdefault(metric.ceiling, []).append(f"`{metric.id}`")
    rows = [f"| {', '.join(names)} | {ceiling.explanation} |" for ceiling, names in by_ceiling.items()]
    return "\n".join([*head, *rows]) + "\n"


def scores_page(page: str) -> str:
    """Return docs/reference/metrics.md with its generated parts as the code has them.

    Raises:
        ValueError: A mark of a generated part is missing, or there twice.
    """
    tables = {"metrics": metric_table(), "references": reference_table(), "ceilings": ceiling_table()}
    for name, table in tables.items():
        between = rf"(<!-- {name}: [^>]*-->\n)(.*?)(<!-- end of {name} -->)"
        page, count = re.subn(between, lambda m, t=table: m[1] + t + m[3], page, flags=re.DOTALL)
        if count != 1:
            raise ValueError(f"expected one generated part named {name}, got {count}. Mark it in the page")
    return page


def spread_of_protocols() -> str:
    """Return the figure of one made-up prediction by every protocol, as SVG."""
    scores = []
    for share in SHARES:
        found = protocol_spread(Experiment(share))
        scores.append({n: s.value for n, s in found.items() if s.value is not None and s.unit == "dB"})
    return spread_figure(SHARES, scores)


def generated() -> dict[Path, str]:
    """Return what each page that is made of the code has to be."""
    return {METRICS: scores_page(METRICS.read_text(encoding="utf-8")), SPREAD: spread_of_protocols()}


def spread_figure(shares: Sequence[float], scores: Sequence[Mapping[str, float]]) -> str:
    """One prediction by every protocol, as SVG: a row a protocol, a dot a share of the picture.

    Args:
        shares: Of the picture that the object covers.
        scores: For each of them, dB by protocol.
    """
    names = sorted(scores[0], key=lambda name: scores[0][name])
    height = TOP + ROW * len(names) + 30
    figure = Xml.Element(
        "svg",
        {
            "xmlns": "http://www.w3.org/2000/svg",
            "viewBox": f"0 0 {WIDTH} {height}",
            "font-family": "sans-serif",
        },
    )
    Xml.SubElement(figure, "rect", {"width": "100%", "height": "100%", "fill": "white"})
    _text(figure, 10, 22, "One and the same albedo prediction, scored by every protocol, dB", 15)
    for number, (share, colour) in enumerate(zip(shares, COLOURS, strict=True)):
        x = LEFT + 205 * number
        _dot(figure, x, 40, colour)
        _text(figure, x + 10, 44, f"object fills {share:.0%} of the picture")
    for decibels in range(LOW, HIGH + 1, 5):
        x, ends = _across(decibels), {"y1": f"{TOP}", "y2": f"{height - 24}", "stroke": "#dddddd"}
        Xml.SubElement(figure, "line", {"x1": f"{x:.1f}", "x2": f"{x:.1f}", **ends})
        _text(figure, x, height - 8, str(decibels), anchor="middle")
    for row, name in enumerate(names):
        y = TOP + ROW * (row + 0.5)
        _text(figure, LEFT - 10, y + 4, name, anchor="end")
        for found, colour in zip(scores, COLOURS, strict=True):
            _dot(figure, _across(found[name]), y, colour)
    Xml.indent(figure)
    return Xml.tostring(figure, encoding="unicode") + "\n"


def _across(decibels: float) -> float:
    return LEFT + (WIDTH - LEFT - RIGHT) * (decibels - LOW) / (HIGH - LOW)


def _dot(figure: Xml.Element, x: float, y: float, colour: str) -> None:
    Xml.SubElement(figure, "circle", {"cx": f"{x:.1f}", "cy": f"{y:.1f}", "r": "5", "fill": colour})


def _text(figure: Xml.Element, x: float, y: float, words: str, size: int = 12, anchor: str = "start") -> None:
    places = {"x": f"{x:.1f}", "y": f"{y:.1f}", "font-size": str(size), "text-anchor": anchor}
    Xml.SubElement(figure, "text", {**places, "fill": "#333333"}).text = words
