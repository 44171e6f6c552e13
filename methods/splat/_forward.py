# SPDX-License-Identifier: Apache-2.0
"""The forward kernel: a tile of 16 x 16 pixels as sixteen blocks of 4 x 4, one block a vector.

Surfels go over a tile one after the other, nearest first; each visits only the blocks that its bounds
touch. Transmittance and sums stay in arrays of one tile, which fit the nearest cache.
"""

from math import sqrt

import numpy as np
from numba import njit, prange

from graycard.methods.splat import _simd as simd
from graycard.methods.splat._coefficients import CENTRE_Z, COLUMNS, HEIGHT, LOG2_E, LOG_OPACITY
from graycard.methods.splat._maps import ALPHA_MAX, ALPHA_MIN, NEAR, TRANSMITTANCE_MIN
from graycard.methods.splat._tiles import TILE

LANES = simd.LANES
BLOCK = 4
"""Pixels on the side of a block."""
PIXELS = TILE * TILE
MOMENTS = 3
"""Sums that are no feature channel: of w z, w / z and w / z^2."""
HUGE = 1e30
"""An exponent at which nothing is left."""
LOW_PASS = sqrt(LOG2_E)
"""The low-pass falls by ``2 ** -|LOW_PASS p|^2``."""
PATIENCE = 16
"""Surfels between two looks at whether a tile is as good as opaque."""


@njit(cache=True)
def lane_positions():
    """Pixel centres from the tile's corner: 4 vectors of x by block column, 4 of y by block row."""
    positions = np.empty(8 * LANES, np.float32)
    for block in range(4):
        for lane in range(LANES):
            positions[block * LANES + lane] = block * BLOCK + lane % BLOCK + 0.5
            positions[(4 + block) * LANES + lane] = block * BLOCK + lane // BLOCK + 0.5
    return positions


@njit(cache=True)
def block_range(low, high, corner):
    """Blocks of a tile, from and to, that pixels from ``low`` to before ``high`` touch."""
    return max(low - corner, 0) // BLOCK, (min(high - corner, TILE) + BLOCK - 1) // BLOCK


@njit(forceinline=True)
def linear_form(coefficients, at, x, y):
    """Value of one linear form at sixteen pixels."""
    row = simd.fma(simd.load_scalar(coefficients, at + 1), y, simd.load_scalar(coefficients, at + 2))
    return simd.fma(simd.load_scalar(coefficients, at), x, row)


@njit(forceinline=True)
def meet(coefficients, at, x, y):
    """Where sixteen rays meet a disc.

    Returns:
        u, v, reciprocal of the denominator, exponents (base 2, positive) of disc and low-pass, and depth
        on the disc's plane.
    """
    over = simd.broadcast(1.0) / linear_form(coefficients, at + 6, x, y)
    u = linear_form(coefficients, at, x, y) * over
    v = linear_form(coefficients, at + 3, x, y) * over
    z = simd.load_scalar(coefficients, at + HEIGHT) * over
    disc = simd.where_at_least(z, simd.broadcast(NEAR), simd.fma(u, u, v * v), simd.broadcast(HUGE))
    x, y = x * simd.broadcast(LOW_PASS), y * simd.broadcast(LOW_PASS)
    return u, v, over, disc, simd.fma(x, x, y * y), z


@njit(forceinline=True)
def raw_alpha(coefficients, at, disc, low_pass):
    """Opacity times the larger Gaussian, before it is clamped and cut."""
    exponent = simd.minimum(disc, low_pass)  # the low-pass where the disc's is NaN
    return simd.exp2(simd.load_scalar(coefficients, at + LOG_OPACITY) - exponent)


@njit(forceinline=True)
def drawn_alpha(raw, before):
    """Alpha as it is drawn: clamped, and zero where it or the transmittance before it is too small."""
    zero = simd.broadcast(0.0)
    alpha = simd.minimum(raw, simd.broadcast(ALPHA_MAX))
    alpha = simd.where_at_least(raw, simd.broadcast(ALPHA_MIN), alpha, zero)
    return simd.where_less(simd.broadcast(TRANSMITTANCE_MIN), before, alpha, zero)


@njit(forceinline=True)
def accumulate(sums, at, weight, value):
    """Add weight times value to sixteen sums."""
    simd.store(sums, at, simd.fma(weight, value, simd.load(sums, at)))


@njit(cache=True)
def is_opaque(transmittance):
    """Whether no pixel of the tile lets anything more through."""
    most = simd.load(transmittance, 0)
    for block in range(1, LANES):
        most = simd.maximum(most, simd.load(transmittance, block * LANES))
    return simd.largest_lane(most) <= TRANSMITTANCE_MIN


@njit(forceinline=True)
def draw_block(coefficients, features, surfel, rank, channels, x, y, block, transmittance, sums, median):
    """One surfel on sixteen pixels: weights, features, moments of depth, rank of the median so far."""
    at = surfel * COLUMNS
    before = simd.load(transmittance, block * LANES)
    _u, _v, _over, disc, low_pass, z = meet(coefficients, at, x, y)
    alpha = drawn_alpha(raw_alpha(coefficients, at, disc, low_pass), before)
    weight = alpha * before
    simd.store(transmittance, block * LANES, before - weight)
    depth = simd.where_at_least(low_pass, disc, z, simd.load_scalar(coefficients, at + CENTRE_Z))
    inverse = simd.broadcast(1.0) / depth
    first = block * (channels + MOMENTS) * LANES
    for channel in range(channels):
        value = simd.load_scalar(features, surfel * channels + channel)
        accumulate(sums, first + channel * LANES, weight, value)
    first += channels * LANES
    accumulate(sums, first, weight, depth)
    accumulate(sums, first + LANES, weight, inverse)
    accumulate(sums, first + 2 * LANES, weight * inverse, inverse)
    so_far = simd.load(median, block * LANES)
    now = simd.where_less(simd.broadcast(0.0), weight, simd.broadcast(np.float32(rank)), so_far)
    simd.store(median, block * LANES, simd.where_less(simd.broadcast(0.5), before, now, so_far))


@njit(cache=True)
def write_tile(tile_x, tile_y, channels, sums, median, listed, image, medians):
    """Copy what is in the image from blocks to rows; ranks become surfels, -1 where there is none."""
    height, width = medians.shape
    for pixel in range(PIXELS):
        block, lane = pixel // LANES, pixel % LANES
        row = tile_y + block // 4 * BLOCK + lane // BLOCK
        column = tile_x + block % 4 * BLOCK + lane % BLOCK
        if row < height and column < width:
            for channel in range(channels + MOMENTS):
                place = (block * (channels + MOMENTS) + channel) * LANES + lane
                image[row, column, channel] = sums[place]
            rank = int(median[pixel])
            medians[row, column] = listed[rank] if rank >= 0 else -1


@njit(parallel=True, cache=True)
def forward(coefficients, centres, features, channels, bounds, start, listed, image, medians, drawn):
    """Draw all tiles.

    Args:
        coefficients: float32, flat, ``COLUMNS`` a surfel.
        centres: float64 ``(n, 2)``, of the projected discs, pixels.
        features: float32, flat, ``channels`` a surfel.
        channels: their number.
        bounds: int32 ``(n, 4)``, pixels.
        start: int64 ``(tiles + 1,)``, and
        listed: int64 ``(pairs,)``: the lists of the tiles.
        image: float32 ``(H, W, channels + MOMENTS)``, to be written.
        medians: int64 ``(H, W)``, to be written: the surfel of the median depth, or -1.
        drawn: int64 ``(tiles,)``, to be written: how many of a tile's list were looked at.
    """
    columns = (image.shape[1] + TILE - 1) // TILE
    for tile in prange(start.size - 1):
        tile_x, tile_y = tile % columns * TILE, tile // columns * TILE
        positions = lane_positions()
        transmittance = np.ones(PIXELS, np.float32)
        median = np.full(PIXELS, -1, np.float32)
        sums = np.zeros((channels + MOMENTS) * PIXELS, np.float32)
        rank, past = 0, start[tile + 1] - start[tile]
        while rank < past:
            surfel = listed[start[tile] + rank]
            left, right = block_range(bounds[surfel, 0], bounds[surfel, 1], tile_x)
            top, bottom = block_range(bounds[surfel, 2], bounds[surfel, 3], tile_y)
            centre_x = simd.broadcast(np.float32(centres[surfel, 0] - tile_x))
            centre_y = simd.broadcast(np.float32(centres[surfel, 1] - tile_y))
            for row in range(top, bottom):
                y = simd.load(positions, (4 + row) * LANES) - centre_y
                for column in range(left, right):
                    x = simd.load(positions, column * LANES) - centre_x
                    draw_block(
                        coefficients, features, surfel, rank, channels, x, y, row * 4 + column,
                        transmittance, sums, median,
                    )  # fmt: skip
            rank += 1
            if rank % PATIENCE == 0 and is_opaque(transmittance):
                past = rank
        drawn[tile] = rank
        write_tile(tile_x, tile_y, channels, sums, median, listed[start[tile] :], image, medians)
