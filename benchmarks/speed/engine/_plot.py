# SPDX-License-Identifier: Apache-2.0
"""A run as one picture: stages of each workload, and how the time grows. SVG, from the standard library."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import groupby
from xml.etree import ElementTree as Xml

from graycard.benchmarks.speed.engine._records import EngineCost, EngineSpeed, ScalingPoint

WIDTH, ROW, LEFT, GAP = 860, 22, 120, 36
"""SVG units: of the picture, of a bar's row, left of what is drawn, between panels."""
PANEL = 230
"""Height of a panel of the scaling."""
COLOURS = ("#4477aa", "#66ccee", "#228833", "#ccbb44", "#ee6677", "#aa3377", "#bbbbbb")
"""Paul Tol's bright scheme, which the colour-blind can tell apart."""
INK = "#333333"


def engine_plot(speed: EngineSpeed) -> str:
    """The picture as SVG text: a bar of stages for each workload, lines on logarithmic axes for the scaling.

    Args:
        speed: A run; parts that it lacks are left out.
    """
    picture = Xml.Element("svg", {"xmlns": "http://www.w3.org/2000/svg", "font-family": "sans-serif"})
    Xml.SubElement(picture, "rect", {"width": "100%", "height": "100%", "fill": "white"})
    cpu, day = speed.environment["cpu"], speed.started[:10]
    _text(picture, (10, 22), f"graycard: surfel engine, {speed.threads} threads of {cpu}, {day}", 15)
    below = _draw_bars(picture, speed.engine, 40.0)
    below = _draw_scaling(picture, speed.scaling, below + GAP)
    picture.set("viewBox", f"0 0 {WIDTH} {below + GAP:.0f}")
    Xml.indent(picture)
    return Xml.tostring(picture, encoding="unicode") + "\n"


def _text(
    parent: Xml.Element, at: tuple[float, float], words: str, size: int = 12, anchor: str = "start"
) -> None:
    place = {"x": f"{at[0]:.1f}", "y": f"{at[1]:.1f}", "font-size": str(size), "text-anchor": anchor}
    Xml.SubElement(parent, "text", {**place, "fill": INK}).text = words


def _box(parent: Xml.Element, at: tuple[float, float], size: tuple[float, float], fill: str) -> Xml.Element:
    place = {"x": f"{at[0]:.1f}", "y": f"{at[1]:.1f}", "width": f"{size[0]:.1f}", "height": f"{size[1]:.1f}"}
    return Xml.SubElement(parent, "rect", {**place, "fill": fill})


def _draw_bars(picture: Xml.Element, costs: Sequence[EngineCost], top: float) -> float:
    """A row for each cost, and a legend; gives where it ends."""
    if not costs:
        return top
    names = list(dict.fromkeys(name for cost in costs for name in cost.stages))
    longest = max(sum(timing.ms for timing in cost.stages.values()) for cost in costs)
    scale = (WIDTH - LEFT - 90) / longest
    step = min(145.0, (WIDTH - LEFT) / len(names))
    for number, name in enumerate(names):
        x = LEFT + number * step
        _box(picture, (x, top), (10, 10), COLOURS[number % len(COLOURS)])
        _text(picture, (x + 14, top + 10), name)
    for number, cost in enumerate(costs):
        y, x = top + (number + 1) * ROW, float(LEFT)
        _text(picture, (LEFT - 8, y + 14), f"{cost.workload}, C = {cost.channels}", anchor="end")
        for colour, name in zip(_cycle(len(names)), names, strict=True):
            timing = cost.stages.get(name)
            if timing is not None:
                _box(picture, (x, y), (scale * timing.ms, ROW - 5), colour)
                x += scale * timing.ms
        _text(picture, (x + 6, y + 14), f"{sum(t.ms for t in cost.stages.values()):.3g} ms")
    return top + (len(costs) + 1) * ROW


def _cycle(count: int) -> list[str]:
    return [COLOURS[number % len(COLOURS)] for number in range(count)]


@dataclass(frozen=True)
class _Axes:
    """A panel with logarithmic axes."""

    left: float
    top: float
    width: float
    x: tuple[float, float]
    y: tuple[float, float]

    def place(self, x: float, y: float) -> tuple[float, float]:
        """Of a point, in SVG units."""
        across = (math.log(x) - math.log(self.x[0])) / math.log(self.x[1] / self.x[0])
        up = (math.log(y) - math.log(self.y[0])) / math.log(self.y[1] / self.y[0])
        return self.left + across * self.width, self.top + (1 - up) * (PANEL - 60)


def _draw_scaling(picture: Xml.Element, points: Sequence[ScalingPoint], top: float) -> float:
    """A panel for each axis but threads, three in a row; gives where it ends."""
    grown = [point for point in points if point.along != "threads"]
    if not grown:
        return top - GAP
    panels = [list(group) for _, group in groupby(grown, key=lambda point: point.along)]
    step = WIDTH / len(panels)
    for number, panel in enumerate(panels):
        _draw_panel(picture, panel, number * step + 55, top, step - 85)
    return top + PANEL


def _range(values: Iterable[float]) -> tuple[float, float]:
    """From the smallest to the largest, never of no length."""
    low, high = min(values := list(values)), max(values)
    return (low / 1.15, high * 1.15)


def _draw_panel(
    picture: Xml.Element, points: Sequence[ScalingPoint], left: float, top: float, width: float
) -> None:
    """Times forward, and forward and backward, and the line of proportion through the last point."""
    last = points[-1]
    times = [time for point in points for time in (point.forward.ms, point.both.ms)]
    axes = _Axes(left, top + 20, width, _range(p.value for p in points), _range(times))
    _box(picture, (left, top + 20), (width, PANEL - 60), "#f4f4f4")
    _text(picture, (left, top + 12), f"ms by {last.along}, logarithmic")
    linear = [(p.value, last.both.ms * p.value / last.value) for p in points]
    inside = [(x, y) for x, y in linear if axes.y[0] <= y <= axes.y[1]]
    lines = [
        ("#999999", inside, "proportional"),
        (COLOURS[0], [(p.value, p.forward.ms) for p in points], "f"),
    ]
    lines += [(COLOURS[4], [(p.value, p.both.ms) for p in points], "f+b")]
    for colour, line, name in lines:
        places = [axes.place(x, y) for x, y in line]
        path = " ".join(f"{x:.1f},{y:.1f}" for x, y in places)
        Xml.SubElement(picture, "polyline", {"points": path, "fill": "none", "stroke": colour})
        _text(picture, (places[0][0] + 4, places[0][1] - 4), name, 10)
    for value in (points[0].value, last.value):
        _text(picture, (axes.place(value, axes.y[0])[0], top + PANEL - 24), f"{value:,}", 10, "middle")
    for time in (min(times), max(times)):
        _text(picture, (left - 4, axes.place(axes.x[0], time)[1] + 4), f"{time:.3g}", 10, "end")
