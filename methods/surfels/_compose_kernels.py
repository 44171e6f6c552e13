# SPDX-License-Identifier: Apache-2.0
"""Kernels: a sky of harmonics behind what was drawn. A row is a pixel; threads do not change sums."""

import numpy as np

from graycard.methods._numba import njit, prange

PIECE = 4096
"""Pixels that a thread takes at a time."""


@njit(forceinline=True)
def sky_at(basis, pixel, weights):
    """Three channels of the sky behind one pixel."""
    red, green, blue = (
        basis[pixel, 0] * weights[0, 0],
        basis[pixel, 0] * weights[0, 1],
        basis[pixel, 0] * weights[0, 2],
    )
    for k in range(1, weights.shape[0]):
        red += basis[pixel, k] * weights[k, 0]
        green += basis[pixel, k] * weights[k, 1]
        blue += basis[pixel, k] * weights[k, 2]
    return red, green, blue


@njit(parallel=True, cache=True)
def over_sky(features, alpha, basis, weights, picture):
    """``features + (1 - alpha) * basis @ weights``.

    Args:
        features: ``(P, 3)``.
        alpha: ``(P,)``.
        basis: ``(P, K)``.
        weights: ``(K, 3)``.
        picture: ``(P, 3)``, to be written.
    """
    for piece in prange((alpha.size + PIECE - 1) // PIECE):
        for pixel in range(piece * PIECE, min(piece * PIECE + PIECE, alpha.size)):
            red, green, blue = sky_at(basis, pixel, weights)
            left = 1 - alpha[pixel]
            picture[pixel, 0] = features[pixel, 0] + left * red
            picture[pixel, 1] = features[pixel, 1] + left * green
            picture[pixel, 2] = features[pixel, 2] + left * blue


@njit(parallel=True, cache=True)
def from_over_sky(to_picture, alpha, basis, weights, to_alpha):
    """The way back; features have the gradient of the picture.

    Args:
        to_picture: ``(P, 3)``.
        alpha: as above.
        basis: as above.
        weights: as above.
        to_alpha: ``(P,)``, to be written.

    Returns:
        The gradient of the weights, float64, ``(K, 3)``.
    """
    pieces = (alpha.size + PIECE - 1) // PIECE
    sums = np.zeros((pieces, weights.shape[0], 3))
    for piece in prange(pieces):
        for pixel in range(piece * PIECE, min(piece * PIECE + PIECE, alpha.size)):
            red, green, blue = sky_at(basis, pixel, weights)
            to_red, to_green, to_blue = to_picture[pixel, 0], to_picture[pixel, 1], to_picture[pixel, 2]
            to_alpha[pixel] = -(to_red * red + to_green * green + to_blue * blue)
            for k in range(weights.shape[0]):
                share = np.float64((1 - alpha[pixel]) * basis[pixel, k])
                sums[piece, k, 0] += share * to_red
                sums[piece, k, 1] += share * to_green
                sums[piece, k, 2] += share * to_blue
    return sums.sum(axis=0)
