# SPDX-License-Identifier: Apache-2.0
# pyright: reportPossiblyUnboundVariable=false, reportOptionalSubscript=false
# Numba compiles no branch for an argument that is None; a type checker does not know that.
"""The forward kernel: for each tile 64 surfels at a time, for each block those of them that touch it.

Within a block surfels go nearest first, and the transmittance of its pixels stays in a register: the alphas
of consecutive surfels do not wait for each other. Weights are written down, then summed channel by channel.
"""

from typing import NamedTuple

import numpy as np

from graycard.methods._numba import njit
from graycard.methods.splat._maps import TRANSMITTANCE_MIN
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
    lane_positions,
    next_bit,
    where_given,
)
from graycard.methods.splat.raster._blocks_write import clear_medians, write_shape, write_tile
from graycard.methods.splat.raster._coefficients import COLUMNS, WHOLE
from graycard.methods.splat.raster._footprints import disc_weight, ellipsoid_weight
from graycard.methods.splat.raster._prefetch import fetch_listed
from graycard.methods.splat.raster._tiles import TILE, tile_of
from graycard.methods.splat.simd import _many as many
from graycard.methods.splat.simd import _vector as simd
from graycard.methods.splat.simd import _words as words
from graycard.methods.splat.simd._parts import BORROWING, INLINED, UNWRAPPED, run, task

BATCH = 64
"""Surfels at a time: as many as a word has bits."""


class Room(NamedTuple):
    """Memory that a thread draws a tile in."""

    positions: np.ndarray
    """See ``lane_positions``."""
    staged: np.ndarray
    """Rows of a batch."""
    touching: np.ndarray
    """Bit masks: which of them touch each column and each row of blocks, a word each."""
    weights: np.ndarray
    """A vector for each surfel of a batch that is drawn on a block."""
    hits: np.ndarray
    """Their places in the batch."""
    sums: np.ndarray
    """A vector a channel and block."""
    through: np.ndarray
    """Transmittance, a vector a block."""


class Deep(NamedTuple):
    """The same for what is drawn beside channels, and what that reads."""

    normals: np.ndarray
    """Float32, flat, three a surfel."""
    depths: np.ndarray
    """See ``Room.weights``."""
    sums: np.ndarray
    """``SHAPE_SUMS`` vectors a block."""
    medians: np.ndarray
    """Median depth and the rank of its surfel, two vectors a block."""


class Batch(NamedTuple):
    """Surfels of a batch that are drawn on a block, and their weights."""

    found: int
    """Number of them."""
    first: int
    """Start of the batch in the list."""
    listed: np.ndarray
    """See ``TileLists.surfels``."""
    hits: np.ndarray
    """See in ``Room``."""
    weights: np.ndarray
    """See there."""


@njit(**UNWRAPPED)
def room_for(channels):
    """Return a thread's ``Room``."""
    return Room(
        lane_positions(),
        aligned(BATCH * COLUMNS),
        np.empty(8, np.uint64),
        aligned(BATCH * LANES),
        np.empty(BATCH, np.int64),
        aligned(channels * PIXELS),
        aligned(PIXELS),
    )


@where_given
@njit(**UNWRAPPED)
def deep_for(normals):
    """Return a thread's ``Deep``."""
    return Deep(normals, aligned(BATCH * LANES), aligned(SHAPE_SUMS * PIXELS), aligned(2 * PIXELS))


@njit(**INLINED)
def clear(room, deep):
    """Empty the sums of a tile."""
    room.through[:] = 1
    room.sums[:] = 0
    if deep is not None:
        deep.sums[:] = 0
        clear_medians(deep.medians)


@njit(**INLINED, **BORROWING)
def stage(listed, first, count, prepared, tile, room):
    """Copy the rows of a batch, with centres from the tile's corner, and note which blocks it touches."""
    rows, bounds, staged, touching = prepared.rows, prepared.bounds, room.staged, room.touching
    touching[:] = 0
    for k in range(count):
        surfel = listed[first + k]
        simd.store(staged, k * COLUMNS, simd.load(rows, surfel * COLUMNS))
        staged[k * COLUMNS + WHOLE] = centre_in_tile(rows, surfel * COLUMNS, 0, tile.x)
        staged[k * COLUMNS + WHOLE + 1] = centre_in_tile(rows, surfel * COLUMNS, 1, tile.y)
        left, right = block_columns(bounds[surfel, 0], bounds[surfel, 1], tile.x)
        top, bottom = block_columns(bounds[surfel, 2], bounds[surfel, 3], tile.y)
        for step in range(4):
            touching[step] |= np.uint64(left <= step < right) << np.uint64(k)
            touching[4 + step] |= np.uint64(top <= step < bottom) << np.uint64(k)


@njit(**INLINED, **BORROWING)
def weigh(bits, block, first, rank_of_first, masks, room, deep, solid):
    """Write the weights of a batch in one block, in order; leave out surfels that cover nothing there.

    Returns:
        How many there are.
    """
    found, staged, before = 0, room.staged, simd.load(room.through, block * LANES)
    x = simd.load(room.positions, block % 4 * LANES)
    y = simd.load(room.positions, (4 + block // 4) * LANES)
    if deep is not None:
        place = block * 2 * LANES
        middle, rank = simd.load(deep.medians, place), simd.load(deep.medians, place + LANES)
    while bits != 0:
        k, bits = next_bit(bits)
        at = k * COLUMNS
        px = x - simd.load_scalar(staged, at + WHOLE)
        py = y - simd.load_scalar(staged, at + WHOLE + 1)
        if solid is None:
            weight, after, depth = disc_weight(staged, at, px, py, before)
        else:
            weight, after, depth = ellipsoid_weight(staged, at, px, py, before)
        simd.store(room.weights, found * LANES, weight)
        if deep is not None:
            simd.store(deep.depths, found * LANES, depth)
            half, zero = simd.broadcast(0.5), simd.broadcast(0.0)
            named = simd.broadcast(np.float32(rank_of_first + k))
            middle = simd.where_less(half, before, simd.where_less(zero, weight, depth, middle), middle)
            rank = simd.where_less(half, before, simd.where_less(zero, weight, named, rank), rank)
        before = after
        hit = words.any_above(weight, simd.broadcast(0.0))
        room.hits[found] = k
        masks[first + k] |= hit << block
        found += hit
    if deep is not None:
        simd.store(deep.medians, block * 2 * LANES, middle)
        simd.store(deep.medians, block * 2 * LANES + LANES, rank)
    simd.store(room.through, block * LANES, before)
    return found


@njit(**INLINED, **BORROWING)
def sum_group(batch, values, stride, channel, sums, at, template):
    """Add weight times value to as many sums as the template is long, in registers."""
    found, first, listed, hits, weights = batch
    totals = many.load_many(sums, at, template)
    for hit in range(found):
        row = listed[first + hits[hit]] * stride + channel
        totals = many.add_scaled(totals, simd.load(weights, hit * LANES), values, row)
    many.store_many(sums, at, totals)


@njit(**INLINED, **BORROWING)
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


@njit(**INLINED, **BORROWING)
def sum_batch(batch, block, prepared, template, sixteen, sums, deep):
    """Add a batch to the sums of one block: channels by groups, then normals and moments."""
    features, channels = prepared.features, prepared.channels
    place, channel = block * channels * LANES, 0
    if sixteen is not None:
        while channel + GROUP <= channels:
            sum_group(batch, features, channels, channel, sums, place + channel * LANES, sixteen)
            channel += GROUP
    if template is not None:
        sum_group(batch, features, channels, channel, sums, place + channel * LANES, template)
    if deep is not None:
        at = block * SHAPE_SUMS * LANES
        sum_group(batch, deep.normals, 3, 0, deep.sums, at, NORMAL)
        sum_moments(batch.found, batch.weights, deep.depths, deep.sums, at + 3 * LANES)


@njit(**UNWRAPPED, **BORROWING)
def draw_tile(tile, prepared, listed, template, sixteen, masks, room, deep, solid):
    """Draw the list of one tile into its sums; returns how many were looked at, and the visits of blocks."""
    first, past, open_blocks, visits = tile.first, tile.past, BLOCKS, 0
    touching = room.touching
    while first < past and open_blocks > 0:
        count, open_blocks = min(past - first, BATCH), 0
        fetch_listed(listed, first + count, min(first + 2 * BATCH, past), prepared, deep)
        stage(listed, first, count, prepared, tile, room)
        masks[first : first + count] = 0
        for block in range(BLOCKS):
            before = simd.load(room.through, block * LANES)
            if words.any_above(before, simd.broadcast(TRANSMITTANCE_MIN)) == 0:
                continue
            open_blocks += 1
            bits = touching[block % 4] & touching[4 + block // 4]
            visits += words.bit_count(bits)
            found = weigh(bits, block, first, first - tile.first, masks, room, deep, solid)
            if found > 0:
                batch = Batch(found, first, listed, room.hits, room.weights)
                sum_batch(batch, block, prepared, template, sixteen, room.sums, deep)
        first += count
    return first - tile.first, visits


@njit(**UNWRAPPED)
def draw_part(part, parts, prepared, lists, template, sixteen, normals, canvas, shape, solid):
    """Draw every so manyth tile.

    Args:
        part: which of the
        parts: how many tiles are drawn at a time.
        prepared: a ``Prepared``.
        lists: a ``TileLists``.
        template: a tuple as long as the last group of channels if that has fewer than ``GROUP``, else None.
        sixteen: ``SIXTEEN`` if there are whole groups, else None.
        normals: float32, flat, three a surfel, in the world; or None.
        canvas: a ``Canvas``, to be written.
        shape: None, or what to write with the normals, see ``write_shape``.
        solid: None for discs; ``SOLID`` for ellipsoids, see ``_footprints``.
    """
    room, deep = room_for(prepared.channels), deep_for(normals)
    start, listed = lists.start, lists.surfels
    columns, tiles = (canvas.image.shape[1] + TILE - 1) // TILE, start.size - 1
    for turn in range((tiles + parts - 1 - part) // parts):
        number = turn * parts + part
        tile = tile_of(number, columns, start)
        clear(room, deep)
        ahead, ahead_past = start[min(number + parts, tiles)], start[min(number + parts + 1, tiles)]
        fetch_listed(listed, ahead, min(ahead + BATCH, ahead_past), prepared, deep)
        canvas.drawn[number], canvas.visits[number] = draw_tile(
            tile, prepared, listed, template, sixteen, canvas.masks, room, deep, solid
        )
        if solid is not None:
            room.through[:] = np.abs(room.through)  # the sign says that a pixel has ended
        write_tile(tile, room, template, sixteen, canvas)
        if shape is not None:
            write_shape(tile, number, deep.sums, deep.medians, shape)


@njit(cache=True)
def forward(*given):
    """Draw all tiles; the arguments are those of ``draw_part`` after its parts."""
    run(task(draw_part, given))
