# SPDX-License-Identifier: Apache-2.0
"""Spaces in which a predicted image is compared with the true one."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from graycard import srgb_encode


def _as_stored(values: np.ndarray, exposure: float) -> np.ndarray:
    return values


def _displayed(radiance: np.ndarray, exposure: float) -> np.ndarray:
    return srgb_encode(np.asarray(radiance, np.float64) * exposure)


def _clipped(radiance: np.ndarray, exposure: float) -> np.ndarray:
    return np.clip(radiance * exposure, 0, 1)


def _displayed_reflectance(values: np.ndarray, exposure: float) -> np.ndarray:
    return srgb_encode(values)


@dataclass(frozen=True, slots=True)
class Space:
    """A named encoding of linear values; call it with ``(values, exposure)``, any shape."""

    name: str
    """In words, for tables: ``sRGB``."""
    encode: Callable[[np.ndarray, float], np.ndarray] = _as_stored

    def __call__(self, values: np.ndarray, exposure: float) -> np.ndarray:
        """Return the values that are compared, same shape."""
        return self.encode(values, exposure)


linear = Space("linear")
"""Values as they are stored."""
linear_gray = Space("linear, gray")
"""Values as they are stored; the measure takes the mean of their channels."""
lab = Space("CIE L*a*b*")
"""Values as they are stored; the measure converts them."""
world = Space("world")
"""Directions and distances in the world's frame."""
display = Space("sRGB", _displayed)
"""Linear radiance as a display shows it at an exposure, [0, 1]."""
display_of_reflectance = Space("sRGB", _displayed_reflectance)
"""Reflectance as displayed, without an exposure: 1 is white."""
exposed = Space("linear", _clipped)
"""Linear, clipped to the range of the display: a light in the picture would outweigh all else."""


def same(value: float) -> float:
    """Return the value: the score is the mean over views."""
    return value
