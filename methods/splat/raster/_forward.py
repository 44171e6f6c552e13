# SPDX-License-Identifier: Apache-2.0
# pyright: reportPossiblyUnboundVariable=false, reportOptionalSubscript=false
# Numba compiles no branch for an argument that is None; a type checker does not know that.
"""The forward kernel: for each tile 64 surfels at a time, for each block those of them that touch it.

Within a block surfels go nearest first, and the transmittance of its pixels stays in a register: the alphas
of consecutive surfels do not wait for each other. Weights are written down, then summed channel by channel.
"""

import numpy as np

from graycard.methods._numba import njit
from graycard.methods.splat._maps import ALPHA_MAX, TRANSMITTANCE_MIN
from graycard.methods.splat.raster._blocks import (
    BLOCKS,
    GROUP,
    LANES,
    MOMENTS,
    NORMAL,
    PIXELS,
    SHAPE_SUMS,
    aligned,
    block_columns,
    centre_in_tile,
    depth_at,
    exponent_of,
    floats_for,
    lane_positions,
    meet,
    next_bit,
    where_drawn,
)
from graycard.methods.splat.raster._blocks_write import clear_medians, write_shape, write_tile
from graycard.methods.splat.raster._coefficients import COLUMNS, WHOLE
from graycard.methods.splat.raster._prefetch import fetch_listed
from graycard.methods.splat.raster._tiles import TILE
from graycard.methods.splat.simd import _many as many
from graycard.methods.splat.simd import _vector as simd
from graycard.methods.splat.simd import _words as words
from graycard.methods.splat.simd._parts import INLINED, UNWRAPPED, run, task

BATCH = 64
"""Surfels at a time: as many as a word has bits."""


@njit(**INLINED)
def stage(listed, first, count, rows, bounds, tile_x, tile_y, staged, touching):
    """Copy the rows of a batch, with centres from the tile's corner, and note which blocks it touches."""
    touching[:] = 0
    for k in range(count):
        surfel = listed[first + k]
        simd.store(staged, k * COLUMNS, simd.load(rows, surfel * COLUMNS))
        staged[k * COLUMNS + WHOLE] = centre_in_tile(rows, surfel * COLUMNS, 0, tile_x)
        staged[k * COLUMNS + WHOLE + 1] = centre_in_tile(rows, surfel * COLUMNS, 1, tile_y)
        left, right = block_columns(bounds[surfel, 0], bounds[surfel, 1], tile_x)
        top, bottom = block_columns(bounds[surfel, 2], bounds[surfel, 3], tile_y)
        for step in range(4):
            touching[step] |= np.uint64(left <= step < right) << np.uint64(k)
            touching[4 + step] |= np.uint64(top <= step < bottom) << np.uint64(k)


@njit(**INLINED)
def weigh(bits, block, x, y, first, rank_of_first, staged, before, weights, depths, hits, masks, medians):
    """Weights of a batch in one block, in order; those of surfels that cover nothing are left out.

    Returns:
        How many there are, and the transmittance of the pixels after them.
    """
    found = 0
    if depths is not None:
        place = block * 2 * LANES
        middle, rank = simd.load(medians, place), simd.load(medians, place + LANES)
    while bits != 0:
        k, bits = next_bit(bits)
        at = k * COLUMNS
        px = x - simd.load_scalar(staged, at + WHOLE)
        py = y - simd.load_scalar(staged, at + WHOLE + 1)
        met = meet(staged, at, px, py)
        exponent = exponent_of(staged, at, met[3], met[4])
        alpha = simd.minimum(many.decay(exponent), simd.broadcast(ALPHA_MAX))
        weight = where_drawn(exponent, before, alpha * before)
        simd.store(weights, found * LANES, weight)
        if depths is not None:
            depth, _z = depth_at(staged, at, met)
            simd.store(depths, found * LANES, depth)
            half, zero = simd.broadcast(0.5), simd.broadcast(0.0)
            named = simd.broadcast(np.float32(rank_of_first + k))
            middle = simd.where_less(half, before, simd.where_less(zero, weight, depth, middle), middle)
            rank = simd.where_less(half, before, simd.where_less(zero, weight, named, rank), rank)
        before = before - weight
        hit = words.any_above(weight, simd.broadcast(0.0))
        hits[found] = k
        masks[first + k] |= hit << block
        found += hit
    if depths is not None:
        simd.store(medians, block * 2 * LANES, middle)
        simd.store(medians, block * 2 * LANES + LANES, rank)
    return found, before


@njit(**INLINED)
def sum_group(found, hits, listed, first, weights, values, stride, channel, sums, at, template):
    """Add weight times value to as many sums as the template is long, in registers."""
    totals = many.load_many(sums, at, template)
    for hit in range(found):
        row = listed[first + hits[hit]] * stride + channel
        totals = many.add_scaled(totals, simd.load(weights, hit * LANES), values, row)
    many.store_many(sums, at, totals)


@njit(**INLINED)
def sum_moments(found, weights, depths, sums, at):
    """Add to the sums of w, w z, w / z and w / z^2."""
    total, first, inverse, square = many.load_many(sums, at, MOMENTS)
    for hit in range(found):
        weight, depth = simd.load(weights, hit * LANES), simd.load(depths, hit * LANES)
        over = simd.broadcast(1.0) / depth
        total, first = total + weight, simd.fma(weight, depth, first)
        inverse = simd.fma(weight, over, inverse)
        square = simd.fma(weight * over, over, square)
    many.store_many(sums, at, (total, first, inverse, square))


@njit(**INLINED)
def sum_batch(
    found, hits, listed, first, weights, depths, features, channels, normals, block, sums, shape_sums,
    template, sixteen,
):  # fmt: skip
    """Add a batch to the sums of one block: channels by groups, then normals and moments."""
    place, channel = block * channels * LANES, 0
    if sixteen is not None:
        while channel + GROUP <= channels:
            at = place + channel * LANES
            sum_group(found, hits, listed, first, weights, features, channels, channel, sums, at, sixteen)
            channel += GROUP
    if template is not None:
        at = place + channel * LANES
        sum_group(found, hits, listed, first, weights, features, channels, channel, sums, at, template)
    if depths is not None:
        at = block * SHAPE_SUMS * LANES
        sum_group(found, hits, listed, first, weights, normals, 3, 0, shape_sums, at, NORMAL)
        sum_moments(found, weights, depths, shape_sums, at + 3 * LANES)


@njit(**UNWRAPPED)
def draw_tile(
    tile_x, tile_y, first, past, listed, rows, bounds, features, channels, normals, positions,
    staged, touching, weights, depths, hits, sums, shape_sums, medians, transmittance, masks, template,
    sixteen,
):  # fmt: skip
    """Draw the list of one tile into its sums; returns where it stopped, and how many visits blocks had."""
    begin, open_blocks, visits = first, BLOCKS, 0
    while first < past and open_blocks > 0:
        count, open_blocks = min(past - first, BATCH), 0
        next_past = min(first + 2 * BATCH, past)
        fetch_listed(listed, first + count, next_past, rows, bounds, features, channels, normals)
        stage(listed, first, count, rows, bounds, tile_x, tile_y, staged, touching)
        masks[first : first + count] = 0
        for block in range(BLOCKS):
            before = simd.load(transmittance, block * LANES)
            if words.any_above(before, simd.broadcast(TRANSMITTANCE_MIN)) == 0:
                continue
            open_blocks += 1
            bits = touching[block % 4] & touching[4 + block // 4]
            visits += words.bit_count(bits)
            x, y = simd.load(positions, block % 4 * LANES), simd.load(positions, (4 + block // 4) * LANES)
            found, before = weigh(
                bits, block, x, y, first, first - begin, staged, before, weights, depths, hits, masks, medians
            )
            simd.store(transmittance, block * LANES, before)
            if found > 0:
                sum_batch(
                    found, hits, listed, first, weights, depths, features, channels, normals, block,
                    sums, shape_sums, template, sixteen,
                )  # fmt: skip
        first += count
    return first, visits


@njit(**UNWRAPPED)
def draw_part(
    part, parts, rows, bounds, start, listed, features, channels, template, sixteen, normals,
    image, transmittance, masks, drawn, visits, shape,
):  # fmt: skip
    """Draw every so manyth tile.

    Args:
        part: which of the
        parts: how many tiles are drawn at a time.
        rows: float32, flat, ``COLUMNS`` a surfel.
        bounds: int32 ``(N, 4)``, pixels.
        start: int32 ``(tiles + 1,)``, and
        listed: int32 ``(pairs,)``: the lists of the tiles.
        features: float32, flat, ``channels`` a surfel.
        channels: their number, at least one.
        template: a tuple as long as the last group of channels if that has fewer than ``GROUP``, else None.
        sixteen: ``SIXTEEN`` if there are whole groups, else None.
        normals: float32, flat, three a surfel, in the world; or None.
        image: float32 ``(H, W, channels)``, to be written.
        transmittance: float32 ``(H, W)``, to be written: what is left of the light from behind.
        masks: uint16 ``(pairs,)``, to be written where drawn: the blocks that a surfel covers in a tile.
        drawn: int32 ``(tiles,)``, to be written: how many of a tile's list were looked at.
        visits: int32 ``(tiles,)``, to be written: how often a surfel was evaluated on a block.
        shape: None, or what to write with the normals, see ``write_shape``.
    """
    positions, staged = lane_positions(), aligned(BATCH * COLUMNS)
    touching, hits = np.empty(8, np.uint64), np.empty(BATCH, np.int64)
    weights, through = aligned(BATCH * LANES), aligned(PIXELS)
    sums = aligned(channels * PIXELS)
    depths, medians = floats_for(shape, BATCH * LANES), floats_for(shape, 2 * PIXELS)
    shape_sums = floats_for(shape, SHAPE_SUMS * PIXELS)
    columns = (image.shape[1] + TILE - 1) // TILE
    for turn in range((start.size - 1 + parts - 1 - part) // parts):
        tile = turn * parts + part
        tile_x, tile_y = tile % columns * TILE, tile // columns * TILE
        through[:] = 1
        sums[:] = 0
        if shape is not None:
            shape_sums[:] = 0
            clear_medians(medians)
        first, past = start[tile], start[tile + 1]
        ahead, ahead_past = (
            start[min(tile + parts, start.size - 1)],
            start[min(tile + parts + 1, start.size - 1)],
        )
        fetch_listed(listed, ahead, min(ahead + BATCH, ahead_past), rows, bounds, features, channels, normals)
        stopped, visits[tile] = draw_tile(
            tile_x, tile_y, first, past, listed, rows, bounds, features, channels, normals, positions,
            staged, touching, weights, depths, hits, sums, shape_sums, medians, through, masks,
            template, sixteen,
        )  # fmt: skip
        drawn[tile] = stopped - first
        write_tile(tile_x, tile_y, sums, channels, template, sixteen, through, image, transmittance)
        if shape is not None:
            write_shape(tile_x, tile_y, tile, shape_sums, medians, shape)


@njit(cache=True)
def forward(*given):
    """Draw all tiles; the arguments are those of ``draw_part`` after its parts."""
    run(task(draw_part, given))
