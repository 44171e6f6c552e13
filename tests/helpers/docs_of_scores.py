# SPDX-License-Identifier: Apache-2.0
"""What docs/scores.md shows of the code: the table of references, and the figure of the protocols' spread."""

from collections.abc import Mapping, Sequence
from xml.etree import ElementTree as Xml

import graycard.eval as ge

WIDTH, ROW, LEFT, RIGHT, TOP = 760, 24, 130, 20, 60
"""SVG units: of the figure, of a row, of what is beside and above the dots."""
LOW, HIGH = 10, 40
"""dB at the ends of the axis."""
COLOURS = ("#4477aa", "#228833", "#ee6677")
"""Of Paul Tol's bright scheme, which the colour-blind can tell apart."""


def reference_table() -> str:
    """The table of tolerances in Markdown."""
    head = ["| number | held against | within |", "| --- | --- | --- |"]
    rows = [
        f"| {r.name} | {r.against} | {r.tolerance:g}{'' if r.unit == '1' else ' ' + r.unit} |"
        for r in ge.REFERENCES
    ]
    return "\n".join([*head, *rows]) + "\n"


def ceiling_table() -> str:
    """Which metrics have a noise ceiling, and why not, in Markdown."""
    head = ["| metrics | ceiling |", "| --- | --- |"]
    rows = [f"| {', '.join(f'`{name}`' for name in rule.metrics)} | {rule.says} |" for rule in ge.CEILINGS]
    return "\n".join([*head, *rows]) + "\n"


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
