# SPDX-License-Identifier: Apache-2.0
"""Record of the size at which a run was made, where that is not the size of its suite."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

SUITE_FILE = "suite.json"
"""The suite that a run folder keeps, at its own size."""


class Scale(NamedTuple):
    """Size of the pictures of a run, number of its views, and its factor on surfels; from small to large."""

    width: int
    height: int
    train_views: int
    test_views: int
    surfels: float = 1.0

    @property
    def words(self) -> str:
        """All but held-out views, as in ``256 x 256 pixels, 20 views, 2 times the surfels``."""
        factor = f", {self.surfels:g} times the surfels" if self.surfels != 1 else ""
        return f"{self.width} x {self.height} pixels, {self.train_views} views{factor}"


@dataclass(frozen=True, slots=True)
class Size:
    """Differences of a run from the size of its suite; by default none.

    Raises:
        ValueError: Pictures would be too small, views too few, or the factor is not above 0.
    """

    width: int | None = None
    """Width of all pictures, pixels; their height follows. None: as the suite has it."""
    train_views: int | None = None
    """Training views of each scene. None: as the suite has them."""
    surfels: float = 1.0
    """Factor on the surfels of each fit."""

    def __post_init__(self) -> None:
        if self.width is not None and self.width < 4:
            raise ValueError(f"expected a width of 4 pixels or more, got {self.width}")
        if self.train_views is not None and self.train_views < 2:
            raise ValueError(f"expected 2 training views or more, got {self.train_views}")
        if not 0 < self.surfels < math.inf:
            raise ValueError(f"expected a factor on surfels above 0, as 0.5 or 2, got {self.surfels}")

    @property
    def words(self) -> str:
        """Differences in words, as in ``256 pixels wide, 2 times the surfels``; empty for none."""
        told = (
            f"{self.width} pixels wide" if self.width is not None else "",
            f"{self.train_views} training views" if self.train_views is not None else "",
            f"{self.surfels:g} times the surfels" if self.surfels != 1 else "",
        )
        return ", ".join(filter(None, told))

    def of(self, suite: Scale) -> Scale:
        """Return the scale of a run, from that of its suite; width and height keep their ratio."""
        width = suite.width if self.width is None else self.width
        views = suite.train_views if self.train_views is None else self.train_views
        return Scale(width, round(suite.height * width / suite.width), views, suite.test_views, self.surfels)


def scale_of(suite: Any, size: Size) -> Scale | None:
    """Return the scale of a run.

    Args:
        suite: What its folder keeps as :data:`SUITE_FILE`.
        size: Differences of the run from it.

    Returns:
        Size and views, or None where the suite does not tell them.
    """
    render = suite.get("render") if isinstance(suite, Mapping) else None
    names = "width", "height", "train_views", "test_views"
    told = [render.get(name) if isinstance(render, Mapping) else None for name in names]
    numbers = [n for n in told if isinstance(n, int) and n > 0]
    return size.of(Scale(*numbers)) if len(numbers) == len(names) else None


def departures(budget: float, size: Size) -> str:
    """Return what a run has other than its suite asks for, in words; empty for nothing.

    Args:
        budget: Factor on the iterations.
        size: Of pictures, views and surfels.
    """
    steps = "" if budget == 1 else f"{budget:g} times its iterations"
    return ", ".join(filter(None, (steps, size.words)))
