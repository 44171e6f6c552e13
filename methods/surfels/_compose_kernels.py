# SPDX-License-Identifier: Apache-2.0
"""Kernels: a sky of harmonics behind what was drawn. A row is a pixel; threads do not change sums."""

import numpy as np

from graycard.methods._numba import njit
from graycard.methods.splat.parallel import INLINED, UNWRAPPED, run, share, task

PIECE = 4096
"""Pixels whose gradients are summed one after the other: threads do not change sums."""


@njit(**INLINED)
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


@njit(cache=True)
def over_sky(features, alpha, basis, weights, picture):
    """``features + (1 - alpha) * basis @ weights``.

    Args:
        features: ``(P, 3)``.
        alpha: ``(P,)``.
        basis: ``(P, K)``.
        weights: ``(K, 3)``.
        picture: ``(P, 3)``, to be written.
    """
    run(task(_over_sky, (features, alpha, basis, weights, picture)))


@njit(**UNWRAPPED)
def _over_sky(part, parts, features, alpha, basis, weights, picture):
    """Write a part of the pixels."""
    first, past = share(part, parts, alpha.size)
    for pixel in range(first, past):
        red, green, blue = sky_at(basis, pixel, weights)
        left = 1 - alpha[pixel]
        picture[pixel, 0] = features[pixel, 0] + left * red
        picture[pixel, 1] = features[pixel, 1] + left * green
        picture[pixel, 2] = features[pixel, 2] + left * blue


@njit(cache=True)
def from_over_sky(to_picture, alpha, basis, weights, to_alpha, sums):
    """Write the gradients; features have that of the picture.

    Args:
        to_picture: ``(P, 3)``.
        alpha: as above.
        basis: as above.
        weights: as above.
        to_alpha: ``(P,)``, to be written.
        sums: ``(ceil(P / PIECE), K, 3)``, float64, to be added to: the gradient of the weights by pieces.
    """
    run(task(_from_over_sky, (to_picture, alpha, basis, weights, to_alpha, sums)))


@njit(**UNWRAPPED)
def _from_over_sky(part, parts, to_picture, alpha, basis, weights, to_alpha, sums):
    """Write and add a part of the pieces."""
    first, past = share(part, parts, len(sums))
    for piece in range(first, past):
        for pixel in range(piece * PIECE, min(piece * PIECE + PIECE, alpha.size)):
            red, green, blue = sky_at(basis, pixel, weights)
            to_red, to_green, to_blue = to_picture[pixel, 0], to_picture[pixel, 1], to_picture[pixel, 2]
            to_alpha[pixel] = -(to_red * red + to_green * green + to_blue * blue)
            for k in range(weights.shape[0]):
                weight = np.float64((1 - alpha[pixel]) * basis[pixel, k])
                sums[piece, k, 0] += weight * to_red
                sums[piece, k, 1] += weight * to_green
                sums[piece, k, 2] += weight * to_blue
