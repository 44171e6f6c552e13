# SPDX-License-Identifier: Apache-2.0
"""Depth between pixels where it is known: flat triangles."""

import numpy as np
from scipy.interpolate import NearestNDInterpolator
from scipy.spatial import Delaunay, QhullError

from graycard.methods._numba import njit

RIM = 1e-9
"""Tolerance: how far beyond a triangle, in shares of its height, a pixel still counts as on its rim."""


def filled_depth(pixels: np.ndarray, depths: np.ndarray, size: tuple[int, int]) -> np.ndarray:
    """z-depth of each pixel from that of some, shape ``(H, W)``, metres.

    Within the triangles of these (Delaunay) the inverse of depth is linear, as it is on the image of a
    plane; outside it is that of the nearest.

    Args:
        pixels: shape ``(M, 2)``, image coordinates, M >= 1.
        depths: shape ``(M,)``, metres, positive.
        size: Height and width.
    """
    inverse = np.full(size, np.nan)
    try:
        triangles = Delaunay(pixels).simplices
    except (QhullError, ValueError):  # too few points, or all on one line
        triangles = np.empty((0, 3), np.int32)
    _draw(triangles, np.ascontiguousarray(pixels, dtype=np.float64), 1 / depths, inverse)
    row, column = np.nonzero(np.isnan(inverse))
    if len(row):
        inverse[row, column] = NearestNDInterpolator(pixels, 1 / depths)(column + 0.5, row + 0.5)
    return 1 / inverse


@njit(cache=True)
def _draw(triangles, corners, values, image):
    """Write values, linear within each triangle, at the centres of the pixels that it covers.

    Args:
        triangles: ``(T, 3)``: numbers of corners.
        corners: ``(M, 2)``, image coordinates.
        values: ``(M,)``, at the corners.
        image: ``(H, W)``, to be written.
    """
    height, width = image.shape
    for a, b, c in triangles:
        x, y = corners[a]
        bx, by = corners[b, 0] - x, corners[b, 1] - y
        cx, cy = corners[c, 0] - x, corners[c, 1] - y
        area = bx * cy - by * cx
        if area == 0:
            continue
        left, right = x + min(0, bx, cx), x + max(0, bx, cx)
        top, bottom = y + min(0, by, cy), y + max(0, by, cy)
        for row in range(max(0, int(np.ceil(top - 0.5))), min(height, int(np.floor(bottom - 0.5)) + 1)):
            for column in range(max(0, int(np.ceil(left - 0.5))), min(width, int(np.floor(right - 0.5)) + 1)):
                px, py = column + 0.5 - x, row + 0.5 - y
                second, third = (px * cy - py * cx) / area, (bx * py - by * px) / area
                first = 1 - second - third
                if min(first, second, third) > -RIM:
                    image[row, column] = first * values[a] + second * values[b] + third * values[c]
