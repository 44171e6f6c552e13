# SPDX-License-Identifier: Apache-2.0
"""The backward kernel: surfel after surfel, front to back, on the blocks that the forward one found covered.

What lies behind a surfel enters the gradient of its alpha as a sum over the rest of the pixel. That sum is
the whole pixel's, which the forward image gives, less what has been passed: no lists of what was drawn
need be kept. Each pair of surfel and tile writes to a place of its own, and the places of a surfel lie side
by side: sums have one order whatever the threads do.
"""

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
    exponent_of,
    floats_for,
    lane_positions,
    meet,
    next_bit,
    where_drawn,
)
from graycard.methods.splat.raster._blocks_read import PLANES, RANK, TO_MEDIAN, read_shape, read_tile
from graycard.methods.splat.raster._channels_backward import channel_gradient, narrow_gradient
from graycard.methods.splat.raster._coefficients import COLUMNS
from graycard.methods.splat.raster._prefetch import LINE, fetch_listed, fetch_surfel
from graycard.methods.splat.raster._tiles import TILE, past_tile
from graycard.methods.splat.simd import _many as many
from graycard.methods.splat.simd import _vector as simd
from graycard.methods.splat.simd import _words as words
from graycard.methods.splat.simd._parts import INLINED, UNWRAPPED, run, task

PLAIN = (0,) * 12
"""Sums of a pair: nine of the linear forms, of the logarithm of alpha, two of the low-pass's centre."""
HEIGHTS = (0,) * 2
"""With depths: of the disc's height, and of the centre's z-depth."""
FIRST_CHANNEL = len(PLAIN)
"""Where channels begin in a slot that has room for them."""
FAR, SOON = 16, 6
"""Pairs before they are needed at which their inputs are asked for, and the places of their results."""


@njit(**INLINED)
def add_linear(sums, gradient, x, y):
    """Add to the gradients of the three numbers of a linear form that of its value."""
    return simd.fma(gradient, x, sums[0]), simd.fma(gradient, y, sums[1]), sums[2] + gradient


@njit(**INLINED)
def add_geometry(sums, met, to_log, x, y):
    """Sums of ``PLAIN``, but for factors of two: only the larger Gaussian has any gradient."""
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
    """Derivative of the loss by the weight of a surfel, from its channels."""
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
    """The same from normal and moments; and the derivative by the depth, of one weight."""
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
    """Derivative of the loss by the depth of a surfel, where the median depth is its own."""
    place, zero = block * PLANES * LANES, simd.broadcast(0.0)
    named, mine = simd.load(planes, place + RANK * LANES), simd.broadcast(np.float32(rank))
    pull = simd.where_at_least(named, mine, simd.load(planes, place + TO_MEDIAN * LANES), zero)
    return simd.where_at_least(mine, named, pull, zero)


@njit(**INLINED)
def visit(
    rows, surfel, block, x, y, rank, features, channels, template, sixteen, narrow, normals,
    through, suffix, gradients, planes, weights, sums, tail,
):  # fmt: skip
    """One surfel on sixteen pixels: moves on transmittance and suffix, adds to the sums."""
    at, one, zero = surfel * COLUMNS, simd.broadcast(1.0), simd.broadcast(0.0)
    before = simd.load(through, block * LANES)
    met = meet(rows, at, x, y)
    exponent = exponent_of(rows, at, met[3], met[4])
    raw = many.decay(exponent)
    alpha = where_drawn(exponent, before, simd.minimum(raw, simd.broadcast(ALPHA_MAX)))
    weight = alpha * before
    pull = zero
    if narrow is not None:
        vectors = many.load_many(gradients, block * channels * LANES, narrow)
        pull = many.add_dot(pull, features, surfel * channels, vectors)
        tail = many.add_products(tail, weight, vectors)
    if weights is not None:
        pull = pull_of_channels(features, surfel, channels, gradients, block, template, sixteen)
        simd.store(weights, block * LANES, weight)
    if normals is not None:
        depth, z = depth_at(rows, at, met)
        shape_pull, to_depth = pull_of_shape(normals, surfel, planes, block, depth)
        pull = pull + shape_pull
        to_depth = simd.fma(weight, to_depth, pull_of_median(planes, block, rank))
        to_plane = simd.where_at_least(met[4], met[3], to_depth, zero)
        to_height = to_plane * met[2]
        sums = add_height(sums, met, to_height, z, x, y)
        tail = tail[0] + to_height, tail[1] + (to_depth - to_plane)
    behind = simd.fnma(weight, pull, simd.load(suffix, block * LANES))
    to_log = simd.fnma(behind, alpha / (one - alpha), weight * pull)
    to_log = simd.where_less(raw, simd.broadcast(ALPHA_MAX), to_log, zero)
    simd.store(suffix, block * LANES, behind)
    simd.store(through, block * LANES, before - weight)
    return add_geometry(sums, met, to_log, x, y), tail


@njit(**INLINED)
def pair_gradient(
    mask, rows, surfel, tile_x, tile_y, rank, features, channels, template, sixteen, narrow, extra, normals,
    positions, through, suffix, gradients, planes, weights,
):  # fmt: skip
    """One surfel on one tile: the sums of its slot, one vector."""
    zero = simd.broadcast(0.0)
    sums, tail = many.repeat(zero, PLAIN), many.repeat(zero, extra)
    centre_x = simd.broadcast(centre_in_tile(rows, surfel * COLUMNS, 0, tile_x))
    centre_y = simd.broadcast(centre_in_tile(rows, surfel * COLUMNS, 1, tile_y))
    bits = mask
    while bits != 0:
        block, bits = next_bit(bits)
        x = simd.load(positions, block % 4 * LANES) - centre_x
        y = simd.load(positions, (4 + block // 4) * LANES) - centre_y
        sums, tail = visit(
            rows, surfel, block, x, y, rank, features, channels, template, sixteen, narrow,
            normals, through, suffix, gradients, planes, weights, sums, tail,
        )  # fmt: skip
    return many.lane_sums(sums + tail)


@njit(**INLINED)
def slot_of(bounds, surfel, first, tile_x, tile_y):
    """Place of a pair among the places of its surfel: row-major over the tiles that it touches."""
    left, right = bounds[surfel, 0] // TILE, past_tile(bounds[surfel, 1])
    return first + (tile_y // TILE - bounds[surfel, 2] // TILE) * (right - left) + tile_x // TILE - left


@njit(**INLINED)
def clear(array, first, count):
    """Zero to whole vectors."""
    for at in range(first, first + count, LANES):
        simd.store(array, at, simd.broadcast(0.0))


@njit(**INLINED)
def fetch_slot(slot, stride, to_geometry, to_channels):
    """Where a pair will be written."""
    words.prefetch_to_write(to_geometry, slot * LANES)
    if to_channels is not None:
        for at in range(slot * stride, slot * stride + stride, LINE):
            words.prefetch_to_write(to_channels, at)


@njit(**INLINED)
def fetch_later(
    pair, past, rows, bounds, listed, slots, features, channels, normals, tile_x, tile_y, stride,
    to_geometry, to_channels,
):  # fmt: skip
    """Ask for what a pair ``FAR`` behind reads, and, by what was asked for before, where one writes."""
    if pair + FAR < past:
        surfel = listed[pair + FAR]
        fetch_surfel(surfel, rows, bounds, features, channels, normals)
        words.prefetch(slots, surfel)
    if pair + SOON < past:
        surfel = listed[pair + SOON]
        fetch_slot(slot_of(bounds, surfel, slots[surfel], tile_x, tile_y), stride, to_geometry, to_channels)


@njit(**UNWRAPPED)
def tile_gradient(
    tile_x, tile_y, first, drawn, past, rows, bounds, listed, slots, masks, features, channels, template,
    sixteen, narrow, extra, normals, positions, through, suffix, gradients, planes, weights, wide, stride,
    to_geometry, to_channels,
):  # fmt: skip
    """The slots of all pairs of one tile."""
    for pair in range(first, past):
        fetch_later(
            pair, past, rows, bounds, listed, slots, features, channels, normals, tile_x, tile_y, stride,
            to_geometry, to_channels,
        )  # fmt: skip
        surfel = listed[pair]
        slot = slot_of(bounds, surfel, slots[surfel], tile_x, tile_y)
        mask = np.uint64(masks[pair]) if pair - first < drawn else np.uint64(0)
        if mask == 0:
            clear(to_geometry, slot * LANES, LANES)
            if to_channels is not None:
                clear(to_channels, slot * stride, stride)
            continue
        total = pair_gradient(
            mask, rows, surfel, tile_x, tile_y, pair - first, features, channels, template, sixteen,
            narrow, extra, normals, positions, through, suffix, gradients, planes, weights,
        )  # fmt: skip
        simd.store(to_geometry, slot * LANES, total)
        if to_channels is not None:
            at = slot * stride
            if sixteen is not None:
                channel_gradient(mask, weights, wide, stride, to_channels, at)
            if template is not None:
                narrow_gradient(mask, weights, channels, gradients, planes, template, to_channels, at)


@njit(**UNWRAPPED)
def gradient_part(
    part, parts, rows, bounds, start, listed, slots, masks, drawn, features, channels, template, sixteen,
    normals, narrow, extra, image, transmittance, to_image, to_transmittance, shape, to_geometry, to_channels,
    stride,
):  # fmt: skip
    """Write the gradients of every so manyth tile's pairs; what is not named here is as in ``draw_part``.

    Args:
        part: as there, and
        parts: as there.
        rows: as there.
        bounds: as there.
        start: as there.
        listed: as there.
        slots: int64 ``(N + 1,)``, where the pairs of each surfel begin.
        masks: what ``forward`` wrote, and
        drawn: what it wrote.
        features: as there.
        channels: as there.
        template: as there.
        sixteen: as there.
        normals: as there.
        narrow: ``template`` if all channels have room in a slot beside ``PLAIN``, else None.
        extra: what goes into a slot after ``PLAIN``: ``narrow``, or else ``HEIGHTS``.
        image: what it wrote, and
        transmittance: what it wrote.
        to_image: float32 ``(H, W, channels)``, gradient.
        to_transmittance: float32 ``(H, W)``, gradient.
        shape: None, or what it takes with the normals, see ``read_shape``.
        to_geometry: float32, flat, ``LANES`` a pair, to be written: ``PLAIN``, then channels if they are
            narrow, else ``HEIGHTS``, which are zero without normals.
        to_channels: float32, flat, ``stride`` a pair, to be written: of channels and then, from
            ``_channels_backward.first_normal`` on, of normals; None if channels are narrow.
        stride: a multiple of ``GROUP``.
    """
    positions, through = lane_positions(), aligned(PIXELS)
    suffix, gradients = aligned(PIXELS), aligned(channels * PIXELS)
    planes = floats_for(shape, PLANES * PIXELS)
    weights, wide = floats_for(to_channels, PIXELS), floats_for(sixteen, stride * PIXELS)
    room = aligned(PIXELS)
    columns = (image.shape[1] + TILE - 1) // TILE
    for turn in range((start.size - 1 + parts - 1 - part) // parts):
        tile = turn * parts + part
        tile_x, tile_y = tile % columns * TILE, tile // columns * TILE
        first, past = start[tile], start[tile + 1]
        fetch_listed(listed, first, min(first + FAR, past), rows, bounds, features, channels, normals)
        through[:] = 1
        read_tile(
            tile_x, tile_y, template, sixteen, image, transmittance, to_image, to_transmittance,
            gradients, wide, stride, suffix, room,
        )  # fmt: skip
        if shape is not None:
            read_shape(tile_x, tile_y, tile, shape, channels, planes, sixteen, wide, stride, suffix)
        tile_gradient(
            tile_x, tile_y, first, drawn[tile], past, rows, bounds, listed, slots, masks,
            features, channels, template, sixteen, narrow, extra, normals, positions, through, suffix,
            gradients, planes, weights, wide, stride, to_geometry, to_channels,
        )  # fmt: skip


@njit(cache=True)
def backward(*given):
    """Find the gradients of all pairs; the arguments are those of ``gradient_part`` after its parts."""
    run(task(gradient_part, given))
