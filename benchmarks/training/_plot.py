# SPDX-License-Identifier: Apache-2.0
"""Draw the curves of a training: the loss, and errors of validation views by track."""

from typing import TYPE_CHECKING

from graycard.benchmarks.training._looks import Look
from graycard.benchmarks.training._train import TrainRecord
from graycard.plotting import COLOURS, new_figure, svg_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_PANELS = (
    ("normal", 0, "normals: mean angle, degrees"),
    ("depth", 0, "depth: relative difference, %"),
    ("base_color", 0, "base colour: rms"),
    ("roughness", 0, "roughness: mean difference"),
)
"""Kind, number of the error, and title of each panel beside that of the loss."""


def training_plot(record: TrainRecord) -> str:
    """Return the curves as SVG text: a panel for the loss and one for each kind, a line for each track.

    A dashed line is the error of the best constant of each view.

    Raises:
        GraycardError: matplotlib is not installed.
    """
    looks = _looks(record)
    with new_figure(3 * (1 + len(_PANELS)), 2.6) as figure:
        first, *others = figure.subplots(1, 1 + len(_PANELS), squeeze=False)[0]
        first.plot([look.step for look in looks], [look.loss for look in looks], color="#333333")
        first.set_title("loss of training views")
        first.set_xlabel("steps")
        for axes, (kind, number, title) in zip(others, _PANELS, strict=True):
            _draw(axes, record, kind, number)
            axes.set_title(title)
        return svg_of(figure)


def _looks(record: TrainRecord) -> tuple[Look, ...]:
    """Return all looks; the last of a training that was cut off is none of the others."""
    if record.last is None or record.last in record.looks:
        return record.looks
    return (*record.looks, record.last)


def _draw(axes: "Axes", record: TrainRecord, kind: str, number: int) -> None:
    """Draw one error over the steps, a line for each track."""
    looks = _looks(record)
    steps = [look.step for look in looks]
    for colour, track in zip(COLOURS, sorted(looks[0].errors), strict=False):
        errors = [look.errors[track][kind][number] for look in looks]
        axes.plot(steps, errors, color=colour, label=track)
        axes.axhline(record.constant[track][kind][number], color=colour, linewidth=0.8, linestyle="--")
    axes.set_ylim(bottom=0)
    axes.set_xlabel("steps")
    axes.legend(frameon=False)
