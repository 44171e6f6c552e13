# SPDX-License-Identifier: Apache-2.0
"""The backward kernel: surfel after surfel, front to back, on the blocks that the forward one found covered.

What lies behind a surfel enters the gradient of its alpha as a sum over the rest of the pixel. That sum is
the whole pixel's, which the forward image gives, less what has been passed: no lists of what was drawn
need be kept. Each pair of surfel and tile writes to a place of its own, and the places of a surfel lie side
by side: sums have one order whatever the threads do.
"""

from typing import Any, NamedTuple

import numpy as np

from graycard.methods._numba import njit
from graycard.methods.splat._maps import ALPHA_MAX
from graycard.methods.splat.raster._blocks import (
    CENTRED,
    GROUP,
    LANES,
    NORMAL,
    PIXELS,
    aligned,
    centre_in_tile,
    depth_at,
    either,
    exponent_of,
    lane_positions,
    meet,
    next_bit,
    where_drawn,
    where_given,
)
from graycard.methods.splat.raster._blocks_read import PLANES, RANK, TO_MEDIAN, read_shape, read_tile
from graycard.methods.splat.raster._channels_backward import channel_gradient, narrow_gradient
from graycard.methods.splat.raster._coefficients import COLUMNS
from graycard.methods.splat.raster._prefetch import LINE, fetch_listed, fetch_surfel
from graycard.methods.splat.raster._tiles import TILE, past_tile, tile_of
from graycard.methods.splat.simd import _many as many
from graycard.methods.splat.simd import _vector as simd
from graycard.methods.splat.simd import _words as words
from graycard.methods.splat.simd._parts import BORROWING, INLINED, UNWRAPPED, run, task

PLAIN = (0,) * 12
"""Sums of a pair: nine of the linear forms, of the logarithm of alpha, two of the low-pass's centre."""
HEIGHTS = (0,) * 2
"""With depths: of the disc's height, and of the centre's z-depth."""
FIRST_CHANNEL = len(PLAIN)
"""Index where channels begin in a slot that has room for them."""
FAR, SOON = 16, 6
"""Pairs before they are needed at which their inputs are asked for, and the places of their results."""


class Room(NamedTuple):
    """Memory in which a thread goes back over a tile."""

    positions: np.ndarray
    """See ``lane_positions``."""
    through: np.ndarray
    """Transmittance, a vector a block."""
    suffix: np.ndarray
    """The same of what all that is drawn from here on adds to the loss."""
    gradients: np.ndarray
    """Pixels of the image, a vector a channel and block."""
    spare: np.ndarray
    """A vector a block."""


class Deep(NamedTuple):
    """The same for what is drawn beside channels, and what that reads."""

    normals: np.ndarray
    """Float32, flat, three a surfel."""
    planes: np.ndarray
    """``PLANES`` vectors a block."""


class Apart(NamedTuple):
    """The same for channels that have slots of their own, which are a ``Channels``."""

    to_channels: np.ndarray
    stride: int
    weights: np.ndarray
    """Gradients of one surfel, a vector a block."""
    wide: np.ndarray
    """Gradients of the image pixel by pixel, ``stride`` floats each."""


class Visit(NamedTuple):
    """One surfel on one block."""

    surfel: int
    rank: int
    """Place in the tile's list."""
    block: int
    x: Any
    """From the anchor to the pixel centres, a vector; as is ``y``."""
    y: Any


@njit(**UNWRAPPED)
def room_for(channels):
    """Return a thread's ``Room``."""
    return Room(
        lane_positions(), aligned(PIXELS), aligned(PIXELS), aligned(channels * PIXELS), aligned(PIXELS)
    )


@where_given
@njit(**UNWRAPPED)
def deep_for(shape):
    """Return a thread's ``Deep``."""
    return Deep(shape.normals, aligned(PLANES * PIXELS))


@where_given
@njit(**UNWRAPPED)
def apart_for(slots):
    """Return a thread's ``Apart``."""
    return Apart(slots.to_channels, slots.stride, aligned(PIXELS), aligned(slots.stride * PIXELS))


@njit(**INLINED)
def add_linear(sums, gradient, x, y):
    """Add to the gradients of the three numbers of a linear form that of its value."""
    return simd.fma(gradient, x, sums[0]), simd.fma(gradient, y, sums[1]), sums[2] + gradient


@njit(**INLINED)
def add_geometry(sums, met, to_log, x, y):
    """Return sums of ``PLAIN``, but for factors of two: only the larger Gaussian has any gradient."""
    u, v, over, disc, low_pass = met
    zero = simd.broadcast(0.0)
    to_disc = simd.where_at_least(low_pass, disc, to_log * over, zero)
    to_offset = simd.where_at_least(low_pass, disc, zero, to_log)
    to_u, to_v = to_disc * u, to_disc * v
    below = simd.fma(to_u, u, to_v * v)
    first, second = add_linear(sums[:3], to_u, x, y), add_linear(sums[3:6], to_v, x, y)
    third = add_linear(sums[6:9], below, x, y)
    low = simd.fma(to_offset, x, sums[10]), simd.fma(to_offset, y, sums[11])
    return first + second + third + (sums[9] + to_log,) + low


@njit(**INLINED)
def add_height(sums, met, to_height, z, x, y):
    """Add to the gradients of the denominator what the plane's depth makes of it."""
    to_below = simd.where_at_least(met[4], met[3], to_height * z, simd.broadcast(0.0))
    return sums[:6] + add_linear(sums[6:9], simd.broadcast(-0.5) * to_below, x, y) + sums[9:]


@njit(**INLINED)
def pull_of_channels(features, surfel, channels, gradients, block, template, sixteen):
    """Return derivative of the loss by the weight of a surfel, from its channels."""
    pull, channel = simd.broadcast(0.0), 0
    place = block * channels * LANES
    if sixteen is not None:
        while channel + GROUP <= channels:
            vectors = many.load_many(gradients, place + channel * LANES, sixteen)
            pull = many.add_dot(pull, features, surfel * channels + channel, vectors)
            channel += GROUP
    if template is not None:
        vectors = many.load_many(gradients, place + channel * LANES, template)
        pull = many.add_dot(pull, features, surfel * channels + channel, vectors)
    return pull


@njit(**INLINED)
def pull_of_shape(normals, surfel, planes, block, depth):
    """Return the same from normal and moments; and the derivative by the depth, of one weight."""
    place = block * PLANES * LANES
    pull = many.add_dot(simd.broadcast(0.0), normals, surfel * 3, many.load_many(planes, place, NORMAL))
    total, first, square, mean, mean_over = many.load_many(planes, place + 3 * LANES, CENTRED)
    over = simd.broadcast(1.0) / depth
    apart = over - mean_over
    steep = square * apart
    pull = pull + simd.fma(first, depth - mean, simd.fma(steep, apart, total))
    return pull, simd.fnma(steep + steep, over * over, first)


@njit(**INLINED)
def pull_of_median(planes, block, rank):
    """Return derivative of the loss by the depth of a surfel, where the median depth is its own."""
    place, zero = block * PLANES * LANES, simd.broadcast(0.0)
    named, mine = simd.load(planes, place + RANK * LANES), simd.broadcast(np.float32(rank))
    pull = simd.where_at_least(named, mine, simd.load(planes, place + TO_MEDIAN * LANES), zero)
    return simd.where_at_least(mine, named, pull, zero)


@njit(**INLINED, **BORROWING)
def visit(here, prepared, template, sixteen, narrow, room, deep, apart, sums, tail):
    """Visit sixteen pixels with a surfel: move on transmittance and suffix, add to the sums."""
    surfel, rank, block, x, y = here
    rows, features, channels = prepared.rows, prepared.features, prepared.channels
    at, one, zero = surfel * COLUMNS, simd.broadcast(1.0), simd.broadcast(0.0)
    before = simd.load(room.through, block * LANES)
    met = meet(rows, at, x, y)
    exponent = exponent_of(rows, at, met[3], met[4])
    raw = many.decay(exponent)
    alpha = where_drawn(exponent, before, simd.minimum(raw, simd.broadcast(ALPHA_MAX)))
    weight = alpha * before
    pull = zero
    if narrow is not None:
        vectors = many.load_many(room.gradients, block * channels * LANES, narrow)
        pull = many.add_dot(pull, features, surfel * channels, vectors)
        tail = many.add_products(tail, weight, vectors)
    if apart is not None:
        pull = pull_of_channels(features, surfel, channels, room.gradients, block, template, sixteen)
        simd.store(apart.weights, block * LANES, weight)
    if deep is not None:
        depth, z = depth_at(rows, at, met)
        shape_pull, to_depth = pull_of_shape(deep.normals, surfel, deep.planes, block, depth)
        pull = pull + shape_pull
        to_depth = simd.fma(weight, to_depth, pull_of_median(deep.planes, block, rank))
        to_plane = simd.where_at_least(met[4], met[3], to_depth, zero)
        to_height = to_plane * met[2]
        sums = add_height(sums, met, to_height, z, x, y)
        tail = tail[0] + to_height, tail[1] + (to_depth - to_plane)
    behind = simd.fnma(weight, pull, simd.load(room.suffix, block * LANES))
    to_log = simd.fnma(behind, alpha / (one - alpha), weight * pull)
    to_log = simd.where_less(raw, simd.broadcast(ALPHA_MAX), to_log, zero)
    simd.store(room.suffix, block * LANES, behind)
    simd.store(room.through, block * LANES, before - weight)
    return add_geometry(sums, met, to_log, x, y), tail


@njit(**INLINED, **BORROWING)
def pair_gradient(mask, surfel, rank, tile, prepared, template, sixteen, room, deep, apart):
    """Return the sums of one surfel on one tile, one vector: its slot."""
    narrow, zero = either(apart, None, template), simd.broadcast(0.0)
    sums, tail = many.repeat(zero, PLAIN), many.repeat(zero, either(apart, HEIGHTS, template))
    centre_x = simd.broadcast(centre_in_tile(prepared.rows, surfel * COLUMNS, 0, tile.x))
    centre_y = simd.broadcast(centre_in_tile(prepared.rows, surfel * COLUMNS, 1, tile.y))
    bits = mask
    while bits != 0:
        block, bits = next_bit(bits)
        x = simd.load(room.positions, block % 4 * LANES) - centre_x
        y = simd.load(room.positions, (4 + block // 4) * LANES) - centre_y
        here = Visit(surfel, rank, block, x, y)
        sums, tail = visit(here, prepared, template, sixteen, narrow, room, deep, apart, sums, tail)
    return many.lane_sums(sums + tail)


@njit(**INLINED, **BORROWING)
def slot_of(bounds, surfel, first, tile):
    """Place of a pair among the places of its surfel: row-major over the tiles that it touches."""
    left, right = bounds[surfel, 0] // TILE, past_tile(bounds[surfel, 1])
    return first + (tile.y // TILE - bounds[surfel, 2] // TILE) * (right - left) + tile.x // TILE - left


@njit(**INLINED, **BORROWING)
def clear(array, first, count):
    """Zero to whole vectors."""
    for at in range(first, first + count, LANES):
        simd.store(array, at, simd.broadcast(0.0))


@njit(**INLINED, **BORROWING)
def clear_slot(slot, to_geometry, apart):
    """Zero what a pair writes."""
    clear(to_geometry, slot * LANES, LANES)
    if apart is not None:
        clear(apart.to_channels, slot * apart.stride, apart.stride)


@njit(**INLINED, **BORROWING)
def fetch_slot(slot, to_geometry, apart):
    """Ask for where a pair will be written."""
    words.prefetch_to_write(to_geometry, slot * LANES)
    if apart is not None:
        for at in range(slot * apart.stride, slot * apart.stride + apart.stride, LINE):
            words.prefetch_to_write(apart.to_channels, at)


@njit(**INLINED, **BORROWING)
def fetch_later(pair, tile, prepared, pairs, deep, apart):
    """Ask for what a pair ``FAR`` behind reads, and, by what was asked for before, where one writes."""
    if pair + FAR < tile.past:
        surfel = pairs.listed[pair + FAR]
        fetch_surfel(surfel, prepared, deep)
        words.prefetch(pairs.slots, surfel)
    if pair + SOON < tile.past:
        surfel = pairs.listed[pair + SOON]
        slot = slot_of(prepared.bounds, surfel, pairs.slots[surfel], tile)
        fetch_slot(slot, pairs.to_geometry, apart)


@njit(**INLINED, **BORROWING)
def write_channels(mask, slot, channels, template, sixteen, room, deep, apart):
    """Write a pair's gradients of channels and normals if they have slots of their own."""
    if apart is not None:
        at = slot * apart.stride
        if sixteen is not None:
            channel_gradient(mask, at, apart)
        if template is not None:
            narrow_gradient(mask, at, channels, template, room, deep, apart)


@njit(**UNWRAPPED, **BORROWING)
def tile_gradient(tile, prepared, pairs, template, sixteen, masks, drawn, room, deep, apart):
    """Write the slots of all pairs of one tile, of which the first ``drawn`` were looked at."""
    for pair in range(tile.first, tile.past):
        fetch_later(pair, tile, prepared, pairs, deep, apart)
        surfel, rank = pairs.listed[pair], pair - tile.first
        slot = slot_of(prepared.bounds, surfel, pairs.slots[surfel], tile)
        mask = np.uint64(masks[pair]) if rank < drawn else np.uint64(0)
        if mask == 0:
            clear_slot(slot, pairs.to_geometry, apart)
            continue
        total = pair_gradient(mask, surfel, rank, tile, prepared, template, sixteen, room, deep, apart)
        simd.store(pairs.to_geometry, slot * LANES, total)
        write_channels(mask, slot, prepared.channels, template, sixteen, room, deep, apart)


@njit(**UNWRAPPED)
def gradient_part(part, parts, prepared, pairs, template, sixteen, canvas, upstream, shape, slots):
    """Write the gradients of every so manyth tile's pairs; what is not named here is as in ``draw_part``.

    Args:
        part: as there, and
        parts: as there.
        prepared: as there.
        pairs: a ``Pairs``. A vector of ``to_geometry`` is ``PLAIN``, then channels if they are narrow, else
            ``HEIGHTS``, which are zero without normals.
        template: as there.
        sixteen: as there.
        canvas: what ``forward`` wrote.
        upstream: an ``Upstream``.
        shape: None, or an ``UpstreamShape``.
        slots: ``Channels``, or None if all channels have room beside ``PLAIN``, as ``template`` says.
    """
    room, deep, apart = room_for(prepared.channels), deep_for(shape), apart_for(slots)
    start, listed = pairs.start, pairs.listed
    columns = (canvas.image.shape[1] + TILE - 1) // TILE
    for turn in range((start.size - 1 + parts - 1 - part) // parts):
        number = turn * parts + part
        tile = tile_of(number, columns, start)
        fetch_listed(listed, tile.first, min(tile.first + FAR, tile.past), prepared, deep)
        room.through[:] = 1
        read_tile(tile, template, sixteen, canvas, upstream, room, apart)
        if shape is not None:
            read_shape(tile, number, shape, prepared.channels, sixteen, deep.planes, room.suffix, apart)
        tile_gradient(
            tile, prepared, pairs, template, sixteen, canvas.masks, canvas.drawn[number], room, deep, apart
        )


@njit(cache=True)
def backward(*given):
    """Find the gradients of all pairs; the arguments are those of ``gradient_part`` after its parts."""
    run(task(gradient_part, given))
