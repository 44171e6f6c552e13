# SPDX-License-Identifier: Apache-2.0
"""Draw a run as one picture: stages of each workload, and how the time grows."""

from collections.abc import Sequence
from itertools import groupby
from typing import TYPE_CHECKING

from graycard.benchmarks.speed.engine._records import EngineCost, EngineSpeed, ScalingPoint
from graycard.plotting import COLOURS, new_figure, svg_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def engine_plot(speed: EngineSpeed) -> str:
    """Return the picture as SVG text: a bar of stages for each workload, and lines of time by size.

    Args:
        speed: A run; parts that it lacks are left out.

    Raises:
        GraycardError: matplotlib is not installed.
    """
    grown = [point for point in speed.scaling if point.along != "threads"]
    panels = [list(group) for _, group in groupby(grown, key=lambda point: point.along)]
    with new_figure(9, 4 + 0.25 * len(speed.engine)) as figure:
        cpu, day = speed.environment["cpu"], speed.started[:10]
        title = f"graycard: surfel engine, {speed.threads} threads of {cpu}, {day}"
        figure.suptitle(title, parse_math=False)
        grid = figure.add_gridspec(2, max(1, len(panels)), height_ratios=(1 + 0.25 * len(speed.engine), 3))
        if speed.engine:
            _draw_stages(figure.add_subplot(grid[0, :]), speed.engine)
        for number, points in enumerate(panels):
            _draw_scaling(figure.add_subplot(grid[1, number]), points)
        return svg_of(figure)


def _draw_stages(axes: "Axes", costs: Sequence[EngineCost]) -> None:
    """Draw a row for each cost, its stages one after the other, and their sum."""
    rows, ends = range(len(costs)), [0.0] * len(costs)
    for number, name in enumerate(dict.fromkeys(name for cost in costs for name in cost.stages)):
        times = [cost.stages[name].ms if name in cost.stages else 0.0 for cost in costs]
        axes.barh(rows, times, left=ends, label=name, color=COLOURS[number % len(COLOURS)])
        ends = [end + time for end, time in zip(ends, times, strict=True)]
    axes.set_yticks(rows, [f"{cost.workload}, C = {cost.channels}" for cost in costs])
    axes.invert_yaxis()
    for row, end in zip(rows, ends, strict=True):
        axes.annotate(f" {end:.3g} ms", (end, row), va="center")
    axes.margins(x=0.1)
    axes.set_xlabel("ms")
    axes.legend(loc="lower center", bbox_to_anchor=(0.5, 1), ncols=len(COLOURS), frameon=False)


def _draw_scaling(axes: "Axes", points: Sequence[ScalingPoint]) -> None:
    """Draw times forward, and forward and backward, and the line of proportion through the last point."""
    last, sizes = points[-1], [point.value for point in points]
    lines = {
        "proportional": ([last.both.ms * size / last.value for size in sizes], "#999999"),
        "f": ([point.forward.ms for point in points], COLOURS[0]),
        "f+b": ([point.both.ms for point in points], COLOURS[4]),
    }
    for name, (times, colour) in lines.items():
        axes.loglog(sizes, times, color=colour, label=name, gid=f"line {last.along} {name}")
    axes.set_xticks(sizes, [f"{size:,}" for size in sizes])
    axes.set_xticks([], minor=True)
    axes.set_title(f"ms by {last.along}, logarithmic")
    axes.legend(frameon=False)
