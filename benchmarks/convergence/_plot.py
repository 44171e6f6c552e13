# SPDX-License-Identifier: Apache-2.0
"""Draw curves of convergence as one picture: a panel for each metric, a line for each method."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

from graycard.benchmarks.convergence._curves import Curve
from graycard.plotting import COLOURS, new_figure, svg_of
from graycard.records import MetricRecord

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_SHOWN = (
    "novel_view.psnr",
    "training_view.psnr",
    "albedo.psnr.channel",
    "albedo.leakage",
    "counterfactual.psnr",
    "counterfactual.residual.mirror",
    "light.position",
)
"""Metrics that have a panel, where a curve has them."""


def convergence_plot(curves: Sequence[Curve], metrics: Sequence[MetricRecord]) -> str:
    """Return the picture as SVG text: a row of panels for each budget, and a panel for each metric.

    Args:
        curves: Of one run.
        metrics: Of the run, for titles and units.

    Raises:
        GraycardError: matplotlib is not installed.
    """
    titles = {m.id: m.title if m.unit in ("", "1") else f"{m.title}\n{m.unit}" for m in metrics}
    axes_kinds = list(dict.fromkeys((curve.track, curve.axis) for curve in curves))
    shown = [m for m in _SHOWN if any(p.mean(m) is not None for c in curves for p in c.points)]
    with new_figure(3 * len(shown), 2.7 * len(axes_kinds)) as figure:
        panels = figure.subplots(len(axes_kinds), len(shown), squeeze=False)
        for row, (track, axis) in enumerate(axes_kinds):
            here = [curve for curve in curves if (curve.track, curve.axis) == (track, axis)]
            for column, metric in enumerate(shown):
                _draw(panels[row, column], here, metric, titles.get(metric, metric))
        return svg_of(figure)


def _draw(axes: "Axes", curves: Sequence[Curve], metric: str, title: str) -> None:
    """Draw the mean over scenes of each curve, over the logarithm of its budget."""
    budgets: set[int] = set()
    for number, curve in enumerate(curves):
        found = [(point.budget, mean) for point in curve.points if (mean := point.mean(metric)) is not None]
        if found:
            colour = COLOURS[number % len(COLOURS)]
            axes.plot(*zip(*found, strict=True), marker="o", markersize=3, color=colour, label=curve.method)
            budgets |= {budget for budget, _ in found}
    axes.set_xscale("log", base=2)
    axes.set_xticks(sorted(budgets), [f"{budget:,}" for budget in sorted(budgets)], rotation=45)
    axes.set_title(title, parse_math=False)
    axes.set_xlabel(f"{curves[0].track}: {curves[0].axis}")
    if budgets:
        axes.legend(frameon=False)
