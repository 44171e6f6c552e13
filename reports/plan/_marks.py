# SPDX-License-Identifier: Apache-2.0
"""Marks and round lengths that the plan and the scale of heights share."""

from dataclasses import dataclass

import numpy as np

MARGIN = 18.0
"""Between the marks and the border, in SVG units."""


@dataclass(frozen=True, slots=True)
class LightMark:
    """A light in the plan, or at its height beside it."""

    x: float
    y: float
    shape: int
    """0 for the truth, then 1 to ``SHAPES`` for the methods in turn."""
    label: str
    outside: bool
    """True if it lies beyond the picture and is drawn at its border."""


def round_length(length: float) -> float:
    """Return the longest of 1, 2 and 5 times a power of ten that is no longer than a length above 0."""
    power = 10.0 ** np.floor(np.log10(length))
    return float(max(step * power for step in (1, 2, 5) if step * power <= length * (1 + 1e-9)))
