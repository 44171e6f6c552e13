# SPDX-License-Identifier: Apache-2.0
"""The backward kernel: the same walk as the forward one, front to back.

What lies behind a surfel enters the gradient of its alpha as a sum over the rest of the pixel. That sum is
the whole pixel's, which the forward image gives, less what has been passed: no lists of what was drawn
need be kept. Each pair of surfel and tile writes to a place of its own, and the places of a surfel lie side
by side: sums have one order whatever the threads do.
"""

from math import log

import numpy as np
from numba import njit, prange

from graycard.methods.splat import _simd as simd
from graycard.methods.splat._coefficients import CENTRE_Z, COLUMNS, LOG2_E
from graycard.methods.splat._forward import (
    BLOCK,
    LANES,
    MOMENTS,
    PIXELS,
    block_range,
    drawn_alpha,
    lane_positions,
    meet,
    raw_alpha,
)
from graycard.methods.splat._maps import ALPHA_MAX
from graycard.methods.splat._tiles import TILE

GEOMETRY = COLUMNS + 2
"""Gradients of one pair that are no channels: of the coefficients, and of the low-pass's centre."""
LN_2 = log(2)


@njit(cache=True)
def read_tile(tile_x, tile_y, image, to_image, gradients, suffix):
    """Bring the image's gradients into blocks, and what they make of each whole pixel."""
    height, width, count = image.shape
    for pixel in range(PIXELS):
        block, lane = pixel // LANES, pixel % LANES
        row = tile_y + block // 4 * BLOCK + lane // BLOCK
        column = tile_x + block % 4 * BLOCK + lane % BLOCK
        if row < height and column < width:
            total = 0.0
            for channel in range(count):
                gradient = to_image[row, column, channel]
                gradients[(block * count + channel) * LANES + lane] = gradient
                total += float(gradient) * image[row, column, channel]
            suffix[pixel] = total


@njit(forceinline=True)
def pull_of_channels(features, at, channels, gradients, first):
    """Derivative of the loss by the weight of a surfel, from its plain channels."""
    pull = simd.broadcast(0.0)
    for channel in range(channels):
        gradient = simd.load(gradients, first + channel * LANES)
        pull = simd.fma(simd.load_scalar(features, at + channel), gradient, pull)
    return pull


@njit(forceinline=True)
def add_to(sums, place, values):
    """Add to one of the sixteen vectors of sums."""
    simd.store(sums, place * LANES, simd.load(sums, place * LANES) + values)


@njit(forceinline=True)
def add_linear(sums, place, gradient, x, y):
    """Gradients of the three numbers of a linear form, from that of its value."""
    add_to(sums, place, gradient * x)
    add_to(sums, place + 1, gradient * y)
    add_to(sums, place + 2, gradient)


@njit(forceinline=True)
def add_geometry(sums, met, to_log, to_depth, x, y):
    """From the gradients of log2 alpha and of depth to those of ``GEOMETRY``, summed over a tile.

    Only the larger Gaussian has any, and the plane only where its Gaussian is the larger one.
    """
    u, v, over, disc, low_pass, z = met
    zero = simd.broadcast(0.0)
    u, v = simd.where_at_least(low_pass, disc, u, zero), simd.where_at_least(low_pass, disc, v, zero)
    over, z = simd.where_at_least(low_pass, disc, over, zero), simd.where_at_least(low_pass, disc, z, zero)
    to_square = simd.broadcast(-2.0) * to_log  # of a square's root: the exponent counts negative
    to_u, to_v = to_square * u * over, to_square * v * over
    to_plane = simd.where_at_least(low_pass, disc, to_depth, zero)
    to_height = to_plane * over
    add_linear(sums, 0, to_u, x, y)
    add_linear(sums, 3, to_v, x, y)
    add_linear(sums, 6, zero - simd.fma(to_u, u, simd.fma(to_v, v, to_height * z)), x, y)
    add_to(sums, 9, to_log)
    add_to(sums, 10, to_height)
    add_to(sums, 11, to_depth - to_plane)
    to_offset = simd.where_at_least(low_pass, disc, zero, to_square) * simd.broadcast(LOG2_E)
    add_to(sums, 12, to_offset * x)
    add_to(sums, 13, to_offset * y)


@njit(forceinline=True)
def block_gradient(
    coefficients, features, surfel, channels, x, y, block, transmittance, suffix, gradients, weights, sums
):
    """One surfel on sixteen pixels: keeps the weights, adds to the sums of its geometry."""
    before, one = simd.load(transmittance, block * LANES), simd.broadcast(1.0)
    met = meet(coefficients, surfel * COLUMNS, x, y)
    disc, low_pass, z = met[3], met[4], met[5]
    raw = raw_alpha(coefficients, surfel * COLUMNS, disc, low_pass)
    alpha = drawn_alpha(raw, before)
    weight = alpha * before
    simd.store(transmittance, block * LANES, before - weight)
    simd.store(weights, block * LANES, weight)
    centre_z = simd.load_scalar(coefficients, surfel * COLUMNS + CENTRE_Z)
    depth = simd.where_at_least(low_pass, disc, z, centre_z)
    inverse = one / depth
    first = block * (channels + MOMENTS) * LANES
    pull = pull_of_channels(features, surfel * channels, channels, gradients, first)
    first += channels * LANES
    to_z, to_inverse = simd.load(gradients, first), simd.load(gradients, first + LANES)
    to_square = simd.load(gradients, first + 2 * LANES)
    pull = simd.fma(to_z, depth, simd.fma(simd.fma(to_square, inverse, to_inverse), inverse, pull))
    behind = simd.fnma(weight, pull, simd.load(suffix, block * LANES))
    simd.store(suffix, block * LANES, behind)
    to_alpha = simd.fnma(behind, one / (one - alpha), before * pull)
    to_log = simd.where_less(
        raw, simd.broadcast(ALPHA_MAX), to_alpha * alpha * simd.broadcast(LN_2), simd.broadcast(0.0)
    )
    slope = simd.fma(to_square * simd.broadcast(2.0), inverse, to_inverse)
    to_depth = weight * simd.fnma(slope, inverse * inverse, to_z)
    add_geometry(sums, met, to_log, to_depth, x, y)


@njit(forceinline=True)
def sum_lanes(vectors, target, at):
    """The lane sums of the sixteen vectors of an array, written to another."""
    load = simd.load
    first = (load(vectors, 0), load(vectors, 16), load(vectors, 32), load(vectors, 48))
    second = (load(vectors, 64), load(vectors, 80), load(vectors, 96), load(vectors, 112))
    third = (load(vectors, 128), load(vectors, 144), load(vectors, 160), load(vectors, 176))
    fourth = (load(vectors, 192), load(vectors, 208), load(vectors, 224), load(vectors, 240))
    simd.store(target, at, simd.lane_sums(first + second + third + fourth))


@njit(cache=True)
def channel_gradients(channels, left, right, top, bottom, weights, gradients, vectors, target, at):
    """Gradients of a surfel's channels from one tile, sixteen channels at a time."""
    for channel in range(channels):
        total = simd.broadcast(0.0)
        for row in range(top, bottom):
            for column in range(left, right):
                block = row * 4 + column
                gradient = simd.load(gradients, (block * (channels + MOMENTS) + channel) * LANES)
                total = simd.fma(simd.load(weights, block * LANES), gradient, total)
        simd.store(vectors, channel % LANES * LANES, total)
        if channel % LANES == LANES - 1 or channel == channels - 1:
            sum_lanes(vectors, target, at + channel // LANES * LANES)


@njit(cache=True)
def slot_of(bounds, surfel, first, tile_x, tile_y):
    """Place of a pair among the places of its surfel: row-major over the tiles that it touches."""
    left, right = bounds[surfel, 0] // TILE, (bounds[surfel, 1] + TILE - 1) // TILE
    top = bounds[surfel, 2] // TILE
    return first + (tile_y // TILE - top) * (right - left) + tile_x // TILE - left


@njit(parallel=True, cache=True)
def backward(
    coefficients, centres, features, channels, bounds, start, listed, slots, drawn, image, to_image,
    to_geometry, to_channels,
):  # fmt: skip
    """Gradients of each pair of surfel and tile; the first arguments are those of ``forward``.

    Args:
        coefficients: as above.
        centres: as above.
        features: as above.
        channels: as above.
        bounds: as above.
        start: as above.
        listed: as above.
        slots: int64 ``(n + 1,)``, where the pairs of each surfel begin.
        drawn: what ``forward`` wrote, and
        image: what it wrote.
        to_image: float32, gradients of the image.
        to_geometry: float32, flat, ``LANES`` a pair, zero; the first ``GEOMETRY`` are to be written.
        to_channels: float32, flat, a multiple of ``LANES`` a pair, zero, to be written.
    """
    columns = (image.shape[1] + TILE - 1) // TILE
    stride = (channels + LANES - 1) // LANES * LANES
    for tile in prange(start.size - 1):
        tile_x, tile_y = tile % columns * TILE, tile // columns * TILE
        positions, transmittance = lane_positions(), np.ones(PIXELS, np.float32)
        suffix, weights = np.zeros(PIXELS, np.float32), np.zeros(PIXELS, np.float32)
        gradients = np.zeros((channels + MOMENTS) * PIXELS, np.float32)
        sums, vectors = np.zeros(LANES * LANES, np.float32), np.zeros(LANES * LANES, np.float32)
        read_tile(tile_x, tile_y, image, to_image, gradients, suffix)
        for rank in range(drawn[tile]):
            surfel = listed[start[tile] + rank]
            left, right = block_range(bounds[surfel, 0], bounds[surfel, 1], tile_x)
            top, bottom = block_range(bounds[surfel, 2], bounds[surfel, 3], tile_y)
            centre_x = simd.broadcast(np.float32(centres[surfel, 0] - tile_x))
            centre_y = simd.broadcast(np.float32(centres[surfel, 1] - tile_y))
            sums[:] = 0
            for row in range(top, bottom):
                y = simd.load(positions, (4 + row) * LANES) - centre_y
                for column in range(left, right):
                    x = simd.load(positions, column * LANES) - centre_x
                    block_gradient(
                        coefficients, features, surfel, channels, x, y, row * 4 + column,
                        transmittance, suffix, gradients, weights, sums,
                    )  # fmt: skip
            slot = slot_of(bounds, surfel, slots[surfel], tile_x, tile_y)
            sum_lanes(sums, to_geometry, slot * LANES)
            channel_gradients(
                channels, left, right, top, bottom, weights, gradients, vectors, to_channels, slot * stride
            )
