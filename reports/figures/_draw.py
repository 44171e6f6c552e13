# SPDX-License-Identifier: Apache-2.0
"""A figure drawn by matplotlib: every picture pixel by pixel, every word as text."""

import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from graycard.plotting import new_figure
from graycard.reports.figures._content import Bar, Cell, FigureContent, Strip
from graycard.reports.pictures._colour_maps import STEPS
from graycard.reports.pictures._layer_pictures import mapped

if TYPE_CHECKING:
    from matplotlib.figure import Figure

INCH = 25.4
"""Millimetres."""
_GAP, _LINE = 0.04, 0.16
"""Inches between pictures, and of a line of text."""
_MARGIN, _BAR, _TICKS = 0.2, 0.09, 0.62
"""Inches of the names of layers on the left, of a colour bar, and of its numbers on the right."""
_POINTS, _SMALLEST = 7.0, 3.0
"""Size of letters, points."""


@dataclass(frozen=True, slots=True)
class _Place:
    """The measures of a figure, inches."""

    width: float
    height: float
    side: float
    """Width of a picture."""
    tall: float
    """Height of a picture."""

    def box(self, left: float, top: float, width: float, height: float) -> tuple[float, float, float, float]:
        """Return a box as matplotlib takes it, in shares from the lower left; ``top`` counts from above."""
        bottom = self.height - top - height
        return left / self.width, bottom / self.height, width / self.width, height / self.height

    def at(self, left: float, top: float) -> tuple[float, float]:
        """Return a point in shares from the lower left."""
        return left / self.width, 1 - top / self.height


@contextmanager
def drawn(content: FigureContent, width_mm: float) -> Iterator["Figure"]:
    """Hand out the finished figure; write it in the block.

    Raises:
        GraycardError: matplotlib is not installed.
    """
    place = _place(content, width_mm / INCH)
    with new_figure(place.width, place.height, None) as figure, warnings.catch_warnings():
        warnings.filterwarnings("ignore", "Glyph .* missing")  # a box stands for it, and is seen
        _draw(figure, content, place)
        yield figure


def _place(content: FigureContent, width: float) -> _Place:
    columns = len(content.columns)
    bars = _BAR + _TICKS if any(strip.bar for strip in content.strips) else 0.0
    side = (width - _MARGIN - bars - columns * _GAP) / columns
    tall = side * content.aspect
    return _Place(width, _LINE + len(content.strips) * (tall + _LINE + _GAP), side, tall)


def _draw(figure: "Figure", content: FigureContent, place: _Place) -> None:
    for column, name in enumerate(content.columns):
        middle = _MARGIN + column * (place.side + _GAP) + place.side / 2
        _write(figure, place.at(middle, _LINE / 2), name, place.side)
    for number, strip in enumerate(content.strips):
        top = _LINE + number * (place.tall + _LINE + _GAP)
        _write(figure, place.at(_MARGIN / 2, top + place.tall / 2), strip.label, place.tall, upright=True)
        _draw_cells(figure, strip, place, top)
        if strip.bar:
            left = _MARGIN + len(strip.cells) * (place.side + _GAP)
            _draw_bar(figure, strip.bar, place, left, top)


def _draw_cells(figure: "Figure", strip: Strip, place: _Place, top: float) -> None:
    for column, cell in enumerate(strip.cells):
        if cell is not None:
            _draw_cell(figure, cell, place, _MARGIN + column * (place.side + _GAP), top)


def _draw_cell(figure: "Figure", cell: Cell, place: _Place, left: float, top: float) -> None:
    middle = left + place.side / 2
    if cell.pixels is None:
        _write(figure, place.at(middle, top + place.tall / 2), cell.text, place.side)
        return
    _draw_pixels(figure, cell.pixels, place.box(left, top, place.side, place.tall))
    _write(figure, place.at(middle, top + place.tall + _LINE / 2), cell.text, place.side)


def _draw_pixels(figure: "Figure", pixels: np.ndarray, box: tuple[float, float, float, float]) -> None:
    """Place a picture: with ``none`` its own pixels go into the file, and nothing is resampled."""
    axes = figure.add_axes(box)
    axes.set_axis_off()
    axes.imshow(pixels, interpolation="none", aspect="auto")


def _draw_bar(figure: "Figure", bar: Bar, place: _Place, left: float, top: float) -> None:
    axes = figure.add_axes(place.box(left, top, _BAR, place.tall))
    steps = mapped(np.linspace(1.0, 0.0, STEPS)[:, None], 0.0, 1.0, bar.colours)
    high = bar.high if bar.high > bar.low else bar.low + 1.0
    axes.imshow(steps, interpolation="none", aspect="auto", extent=(0, 1, bar.low, high))
    axes.set_xticks([])
    axes.locator_params(axis="y", nbins=5)
    axes.yaxis.tick_right()
    axes.yaxis.set_label_position("right")
    axes.tick_params(length=2, width=0.5, labelsize=6, pad=1)
    axes.set_ylabel(bar.label, fontsize=6, labelpad=2)
    for spine in axes.spines.values():
        spine.set_linewidth(0.5)


def _write(figure: "Figure", at: tuple[float, float], text: str, room: float, upright: bool = False) -> None:
    """Write a line around a point, smaller where it needs more room than there is, inches."""
    turned = 90 if upright else 0
    line = figure.text(
        *at, text, ha="center", va="center", rotation=turned, fontsize=_POINTS, parse_math=False
    )
    extent = line.get_window_extent()
    taken = (extent.height if upright else extent.width) / figure.dpi
    if taken > room:
        line.set_fontsize(max(_POINTS * room / taken, _SMALLEST))
