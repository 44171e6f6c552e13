# SPDX-License-Identifier: Apache-2.0
"""Depth that is right but for one factor: the unit of the world, or a world that was scaled to be fitted."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

_RATIO = 0.4
_LIMIT = 0.05
_APART = 0.05
"""Share by which the factors of views may differ."""
_BEYOND = 0.1
"""Share by which a factor must differ from 1: less is an error of a fit whose discs are not in place yet."""


class Scale(NamedTuple):
    """Effect of one factor on the depth of a view."""

    factor: float
    before: float
    """Median of |p - t| / t."""
    after: float
    constant: float
    """The same of the best plane: what depth itself must undercut."""


def scale_of(predicted: np.ndarray, true: np.ndarray) -> Scale:
    """Return the factor that brings predicted depths closest to true ones, each ``(N, 1)``."""
    factor = float(np.median(true / np.maximum(predicted, 1e-12)))
    errors = (predicted, factor * predicted, np.median(true))
    before, after, constant = (float(np.median(np.abs(p - true) / true)) for p in errors)
    return Scale(factor, before, after, constant)


def scale_hints(scales: Sequence[Scale]) -> list[tuple[str, str]]:
    """Return the hint and what to declare, if one factor mends the depth of all views."""
    if not scales:
        return []
    factors = np.array([scale.factor for scale in scales])
    before, after, constant = np.array([scale[1:] for scale in scales]).mean(axis=0)
    middle = float(np.median(factors))
    alike = np.abs(factors - middle).max() < _APART * middle
    if not alike or abs(middle - 1) <= _BEYOND or after > _LIMIT or after >= _RATIO * min(before, constant):
        return []
    says = f"depth looks scaled: times {middle:.4g} it fits (error {before:.2g} before, {after:.2g} after)"
    return [(says, f"times={middle:.6g}")]
