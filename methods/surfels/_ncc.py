# SPDX-License-Identifier: Apache-2.0
"""Normalised cross-correlation (NCC) of photographs, warped as surfaces at some depth would have it."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch

from graycard import Camera
from graycard.methods._numba import njit
from graycard.methods.splat.parallel import UNWRAPPED, run, share, task
from graycard.methods.surfels._transfer import transfer, transferred

NOISE = 2e-4
"""Variance, in encoded units, below which a window has no structure."""
LEAST = -2.0
"""Below every correlation."""


@dataclass(frozen=True, eq=False)
class SweptView:
    """A photograph and between which depths its surfaces are sought."""

    camera: Camera
    grey: torch.Tensor
    """Shape ``(H, W)``, encoded."""
    near: float
    """Metres of z-depth."""
    far: float


def mean_ncc(view: SweptView, partners: Sequence[SweptView], inverse: np.ndarray, window: int) -> np.ndarray:
    """Return the mean NCC of a view and the better half of its partners, for hypotheses of depth.

    Args:
        view: The view.
        partners: One or more others.
        inverse: shape ``(K, H, W)`` or ``(K, 1, 1)``: K hypotheses of one over z-depth, 1/m, positive.
        window: Pixels on each side of the windows that are compared, odd.

    Returns:
        Mean normalised cross-correlation of windows, shape ``(K, H, W)``, float32, [-1, 1]; a partner that
        does not see a place is taken for 0.
    """
    mine = _grey(view)
    every = np.broadcast_to(inverse, (len(inverse), *mine.shape))
    inverse = np.array(every, dtype=np.float64, order="C")  # a view is read-only: another type to Numba
    best = np.full((len(inverse), (len(partners) + 1) // 2, *mine.shape), LEAST, np.float32)
    own = np.empty((3, *mine.shape), np.float32)
    for partner in partners:
        _rank(mine, own, _grey(partner), transfer(view.camera, partner.camera), inverse, window // 2, best)
    return best.mean(axis=1)


def _grey(view: SweptView) -> np.ndarray:
    return np.ascontiguousarray(view.grey.numpy(), dtype=np.float32)


@njit(cache=True, error_model="numpy")
def _rank(mine, own, theirs, pair, inverse, half, best):
    """Put the correlation of a partner in its place among the best.

    Args:
        mine: ``(H, W)``, float32: the view.
        own: ``(3, H, W)``, float32, room for its means over windows.
        theirs: ``(H', W')``, float32: the partner.
        pair: homography and epipole, see ``transfer``.
        inverse: ``(K, H, W)``, 1/m.
        half: pixels from the middle of a window to its rim.
        best: ``(K, B, H, W)``, float32: correlations in falling order, to be updated.
    """
    _window_means(mine, mine, half, own)
    run(task(_rank_some, (mine, own, theirs, pair, inverse, half, best)))


@njit(error_model="numpy", **UNWRAPPED)
def _rank_some(part, parts, mine, own, theirs, pair, inverse, half, best):
    """Do the same for a part of the hypotheses, given the means over windows of the view, ``(3, H, W)``."""
    height, width = mine.shape
    warped = np.empty((height, width), np.float32)
    seen = np.empty((height, width), np.bool_)
    means = np.empty((3, height, width), np.float32)
    first, past = share(part, parts, len(inverse))
    for hypothesis in range(first, past):
        _warp(theirs, pair, inverse[hypothesis], warped, seen)
        _window_means(mine, warped, half, means)
        for row in range(height):
            for column in range(width):
                mean, other = own[0, row, column], means[0, row, column]
                variance = own[1, row, column] - mean * mean
                product = max(variance * (means[1, row, column] - other * other), np.float32(0))
                covariance = means[2, row, column] - mean * other
                like = covariance / (np.sqrt(product) + np.float32(NOISE))
                like = like if seen[row, column] else np.float32(0)
                for place in range(best.shape[1]):
                    held = best[hypothesis, place, row, column]
                    best[hypothesis, place, row, column] = max(held, like)
                    like = min(held, like)


@njit(error_model="numpy", **UNWRAPPED)
def _warp(image, pair, inverse, warped, seen):
    """Write an image as the view would see it, bilinear, continued beyond its border.

    And where it is inside.
    """
    homography, epipole = pair
    height, width = image.shape
    for row in range(inverse.shape[0]):
        for column in range(inverse.shape[1]):
            across, down, along = transferred(homography, column + 0.5, row + 0.5)
            near = inverse[row, column]
            z = along + near * epipole[2]
            x, y = (across + near * epipole[0]) / z, (down + near * epipole[1]) / z
            seen[row, column] = z > 0 and 0 < x < width and 0 < y < height
            x, y = min(max(x - 0.5, 0.0), width - 1.0), min(max(y - 0.5, 0.0), height - 1.0)
            left, top = int(x), int(y)
            right, bottom = min(left + 1, width - 1), min(top + 1, height - 1)
            x, y = np.float32(x - left), np.float32(y - top)
            upper = image[top, left] + x * (image[top, right] - image[top, left])
            lower = image[bottom, left] + x * (image[bottom, right] - image[bottom, left])
            warped[row, column] = upper + y * (lower - upper)


@njit(**UNWRAPPED)
def _window_means(mine, other, half, means):
    """Means of ``other``, its square and ``mine * other`` over square windows.

    At the border they are over what there is. Columns of the windows are summed first, then their sums along
    the row.

    Args:
        mine: ``(H, W)``, float32.
        other: ``(H, W)``, float32.
        half: pixels from the middle of a window to its rim.
        means: ``(3, H, W)``, float32, to be written.
    """
    height, width = other.shape
    columns = np.zeros((3, width + 2 * half), np.float32)  # nothing beyond the border
    for row in range(height):
        first, past = max(row - half, 0), min(row + half + 1, height)
        columns[:, half : half + width] = 0
        for near in range(first, past):
            for column in range(width):
                value = other[near, column]
                columns[0, half + column] += value
                columns[1, half + column] += value * value
                columns[2, half + column] += value * mine[near, column]
        for kind in range(3):
            sums = means[kind, row]
            sums[:] = 0
            for tap in range(2 * half + 1):
                for column in range(width):
                    sums[column] += columns[kind, column + tap]
            for column in range(width):
                count = (past - first) * (min(column + half + 1, width) - max(column - half, 0))
                sums[column] /= np.float32(count)
