# SPDX-License-Identifier: Apache-2.0
"""Measures that are a statistic of one error for each judged pixel."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from graycard import angles
from graycard.eval.measures._colour_difference import ciede2000
from graycard.eval.measures._flip import flip_map
from graycard.eval.measures._spaces import Space
from graycard.eval.scoring._mask import check_images, judged_pixels
from graycard.io import blocks

Errors = Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray]
"""``(predicted, true, mask)`` of shapes ``(H, W, 3)`` and ``(H, W)`` to the errors inside, ``(N,)``."""


@dataclass(frozen=True, slots=True)
class Pixelwise:
    """A measure of one view: the errors of its judged pixels, and a statistic of them."""

    errors: Errors
    statistic: Callable[[np.ndarray], np.floating]

    def __call__(self, predicted: np.ndarray, true: np.ndarray, mask: np.ndarray) -> float:
        """Return the statistic over the mask."""
        return float(self.statistic(self.errors(predicted, true, mask)))


@dataclass(frozen=True, slots=True)
class Bracketed(Pixelwise):
    """A measure of one view at several exposures: of each pixel the greatest error counts."""

    spaces: tuple[Space, ...]
    """One for each exposure; what another metric has computed in one of them is not computed again."""


def share_below(errors: np.ndarray, limit: float) -> np.floating:
    """Share of the pixels with an error below a limit, %."""
    return 100 * np.mean(errors < limit)


def square_errors(predicted: np.ndarray, true: np.ndarray, mask: np.ndarray) -> np.ndarray:
    """Mean over channels, if there are any, of the squared difference, ``(N,)``, in the unit squared."""
    check_images(predicted, true, mask)
    inside, errors = np.flatnonzero(mask), np.empty(int(mask.sum()))
    p, t = (image.reshape(mask.size, -1) for image in (predicted, true))
    for block in blocks(len(inside)):
        difference = np.subtract(*(np.take(i, inside[block], axis=0) for i in (p, t)), dtype=np.float64)
        np.einsum("nc,nc->n", difference, difference, out=errors[block])
    return errors / p.shape[1]


def absolute_errors(predicted: np.ndarray, true: np.ndarray, mask: np.ndarray) -> np.ndarray:
    """Mean over channels, if there are any, of the distance, shape ``(N,)``, in the unit of the layer."""
    p, t = judged_pixels(predicted, true, mask)
    return np.abs(p - t).reshape(len(p), -1).mean(axis=1)


def angle_errors(predicted: np.ndarray, true: np.ndarray, mask: np.ndarray) -> np.ndarray:
    """Angles between directions, shape ``(N,)``, degrees."""
    return angles(predicted[mask], true[mask])


def colour_errors(predicted: np.ndarray, true: np.ndarray, mask: np.ndarray) -> np.ndarray:
    """CIEDE2000 of linear colours, shape ``(N,)``."""
    return ciede2000(*judged_pixels(predicted, true, mask))


def flip_errors(predicted: np.ndarray, true: np.ndarray, mask: np.ndarray) -> np.ndarray:
    """FLIP of display values, shape ``(N,)``, [0, 1]."""
    return flip_map(predicted, true, mask)[mask]
