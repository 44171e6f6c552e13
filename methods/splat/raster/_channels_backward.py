# SPDX-License-Identifier: Apache-2.0
"""From the weights of a surfel in the blocks of a tile to the gradients of its channels and its normal."""

from graycard.methods._numba import njit
from graycard.methods.splat.raster._blocks import GROUP, LANES, NORMAL, next_bit
from graycard.methods.splat.raster._blocks_read import PLANES
from graycard.methods.splat.simd import _many as many
from graycard.methods.splat.simd import _vector as simd
from graycard.methods.splat.simd._parts import BORROWING, INLINED

HALF = LANES // 2
"""Index where normals begin in a slot of few channels."""
PARTIAL = (0,) * 4


@njit(**INLINED)
def first_normal(channels):
    """Place of the normal's gradient among those of the channels of a pair."""
    return max(channels, HALF)


@njit(**INLINED, **BORROWING)
def channel_gradient(mask, at, apart):
    """Write a surfel's gradients of channels from one tile, sixteen at a time: weights times rows."""
    to_channels, stride, weights, wide = apart
    for channel in range(0, stride, GROUP):
        total = many.repeat(simd.broadcast(0.0), PARTIAL)
        bits = mask
        while bits != 0:
            block, bits = next_bit(bits)
            row = block * LANES * stride + channel
            total = many.add_rows(total, weights, block * LANES, wide, row, stride)
        simd.store(to_channels, at + channel, (total[0] + total[1]) + (total[2] + total[3]))


@njit(**INLINED, **BORROWING)
def narrow_gradient(mask, at, channels, template, room, deep, apart):
    """Do the same as ``channel_gradient``, for up to eight channels: sums of weights times vectors of the
    blocks.
    """
    total = many.repeat(simd.broadcast(0.0), template)
    normal = many.repeat(simd.broadcast(0.0), NORMAL)
    bits = mask
    while bits != 0:
        block, bits = next_bit(bits)
        weight = simd.load(apart.weights, block * LANES)
        vectors = many.load_many(room.gradients, block * channels * LANES, template)
        total = many.add_products(total, weight, vectors)
        if deep is not None:
            vectors = many.load_many(deep.planes, block * PLANES * LANES, NORMAL)
            normal = many.add_products(normal, weight, vectors)
    simd.store(apart.to_channels, at, many.lane_sums_of_halves(total, normal))
