# SPDX-License-Identifier: Apache-2.0
"""The tracer's backward kernel.

What a packet met is known from the forward pass, unless it was more than could be kept: then it is gathered
anew. What the discs receive is summed in a fixed number of parts, whatever the number of threads, so that
each sum has one order.
"""

from math import log

import numpy as np

from graycard.methods._numba import njit
from graycard.methods.splat._maps import ALPHA_MAX
from graycard.methods.splat.simd import _vector as simd
from graycard.methods.splat.simd._parts import BORROWING, INLINED, UNWRAPPED, run_in, task
from graycard.methods.splat.simd._vector import LANES
from graycard.methods.splat.trace._forward import (
    CAPACITY,
    RAY,
    STRIP,
    gather_all,
    packets_of,
    rays_of,
    read_rays,
    row_weight,
    sum_moments,
    weigh,
)
from graycard.methods.splat.trace._gather import new_hits, new_search, put_in_order, recall
from graycard.methods.splat.trace._masks import lowest_bit
from graycard.methods.splat.trace._meet import all_rays, dot, meet, one_record

INNER = 3
"""Channels whose gradients fit beside those of the geometry in one vector."""
LN_2 = np.float32(log(2))


@njit(**INLINED, **BORROWING)
def sum_lanes(vectors, target, at):
    """Write the lane sums of the sixteen vectors of an array to another."""
    load = simd.load
    first = (load(vectors, 0), load(vectors, 16), load(vectors, 32), load(vectors, 48))
    second = (load(vectors, 64), load(vectors, 80), load(vectors, 96), load(vectors, 112))
    third = (load(vectors, 128), load(vectors, 144), load(vectors, 160), load(vectors, 176))
    fourth = (load(vectors, 192), load(vectors, 208), load(vectors, 224), load(vectors, 240))
    simd.store(target, at, simd.lane_sums(first + second + third + fourth))


@njit(**UNWRAPPED, **BORROWING)
def read_gradients(members, moments, to_found, gradients, to_moments):
    """Bring a packet's gradients into vectors: of the channels, of the sums of w and w t, of what passes.

    Depth is the second of those sums by the first.
    """
    to_out, to_transmittance, to_depth = to_found
    gradients[:] = 0
    to_moments[:] = 0
    for lane in range(LANES):
        ray = members[lane]
        if ray >= 0:
            for channel in range(to_out.shape[1]):
                gradients[channel * LANES + lane] = to_out[ray, channel]
            weight, way = moments[lane], moments[LANES + lane]
            if weight > 0:
                to_moments[lane] = -to_depth[ray] * way / (weight * weight)
                to_moments[LANES + lane] = to_depth[ray] / weight
            to_moments[2 * LANES + lane] = to_transmittance[ray]


@njit(**UNWRAPPED, **BORROWING)
def pulls(hits, rows, order, features, channels, gradients, to_moments, pull):
    """Write the derivative of the loss by each weight."""
    places, distance = hits.places, hits.distance
    to_weight, to_way = simd.load(to_moments, 0), simd.load(to_moments, LANES)
    for row in range(rows):
        total = simd.fma(to_way, simd.load(distance, row * LANES), to_weight)
        first = order[places[row]] * channels
        for channel in range(channels):
            value = simd.load_scalar(features, first + channel)
            total = simd.fma(value, simd.load(gradients, channel * LANES), total)
        simd.store(pull, row * LANES, total)


@njit(error_model="numpy", **UNWRAPPED, **BORROWING)
def walk_back(hits, rows, passing, to_moments, pull, to_alpha):
    """Write the derivative by each alpha, along each ray from its end: what it adds, less what it
    takes from behind.
    """
    places, _, _, alpha, before, sequence, counts = hits
    for at in range(rows * LANES):
        to_alpha[at] = 0
    for lane in range(LANES):
        behind = to_moments[2 * LANES + lane] * passing[lane]
        first = lane * places.size
        for step in range(first + counts[lane] - 1, first - 1, -1):
            at = sequence[step] * LANES + lane
            if before[at] > 0:
                to_alpha[at] = before[at] * pull[at] - behind / (np.float32(1) - alpha[at])
                behind += before[at] * alpha[at] * pull[at]


@njit(**INLINED, **BORROWING)
def hit_gradient(record, ray, alpha, weight, to_alpha, to_way):
    """From the gradients of alpha and of the sum of w t to pulls on the record, for sixteen hits.

    With x the origin from the disc's centre, t = -N . x / N . d and p = x + t d, all follows from the pulls
    on U . p, V . p and N . p: each moves its vector by itself times p, and the origin by itself times the
    vector; the direction is moved t times as much as the origin.

    Returns:
        t, point, the three pulls, the gradient of log2 of the opacity; zero where nothing was drawn.
    """
    zero = simd.broadcast(0.0)
    t, point, u, v, slope = meet(record, ray)
    to_log = to_alpha * alpha * simd.broadcast(LN_2)
    to_log = simd.where_less(alpha, simd.broadcast(ALPHA_MAX), to_log, zero)
    drawn = simd.where_less(zero, weight, simd.broadcast(1.0), zero)
    to_square = simd.where_less(zero, weight, simd.broadcast(-2.0) * to_log, zero)
    to_u = simd.where_less(zero, drawn, to_square * u, zero)
    to_v = simd.where_less(zero, drawn, to_square * v, zero)
    to_t = simd.fma(to_u, dot(record[0], ray[1]), simd.fma(to_v, dot(record[1], ray[1]), to_way * weight))
    to_n = simd.where_less(zero, drawn, zero - to_t / slope, zero)
    t = simd.where_less(zero, drawn, t, zero)
    point = (
        simd.where_less(zero, drawn, point[0], zero),
        simd.where_less(zero, drawn, point[1], zero),
        simd.where_less(zero, drawn, point[2], zero),
    )
    return t, point, to_u, to_v, to_n, to_log


@njit(**INLINED, **BORROWING)
def moved(record, to_u, to_v, to_n, k):
    """One coordinate of the gradient by the origin."""
    return simd.fma(to_u, record[0][k], simd.fma(to_v, record[1][k], to_n * record[2][k]))


@njit(**UNWRAPPED, **BORROWING)
def add_rows(hits, rows, records, rays, gradients, to_moments, to_alpha, stride, sums, to_rays):
    """Add what a packet's discs receive to their sums, but for the outer channels; and the rays' own."""
    places, _, _, alphas, before, _, _ = hits
    ray, to_way = all_rays(rays), simd.load(to_moments, LANES)
    red, green, blue = simd.load(gradients, 0), simd.load(gradients, LANES), simd.load(gradients, 2 * LANES)
    ox = oy = oz = dx = dy = dz = simd.broadcast(0.0)
    for row in range(rows):
        record = one_record(records, places[row])
        weight, alpha = row_weight(alphas, before, row), simd.load(alphas, row * LANES)
        t, p, to_u, to_v, to_n, to_log = hit_gradient(
            record, ray, alpha, weight, simd.load(to_alpha, row * LANES), to_way
        )
        x, y = moved(record, to_u, to_v, to_n, 0), moved(record, to_u, to_v, to_n, 1)
        z = moved(record, to_u, to_v, to_n, 2)
        ox, oy, oz = ox + x, oy + y, oz + z
        dx, dy, dz = simd.fma(t, x, dx), simd.fma(t, y, dy), simd.fma(t, z, dz)
        total = simd.lane_sums((
            to_u * p[0], to_u * p[1], to_u * p[2], to_u, to_v * p[0], to_v * p[1], to_v * p[2], to_v,
            to_n * p[0], to_n * p[1], to_n * p[2], to_n, to_log, weight * red, weight * green, weight * blue,
        ))  # fmt: skip
        at = places[row] * stride
        simd.store(sums, at, simd.load(sums, at) + total)
    simd.store(to_rays, 0, ox)
    simd.store(to_rays, LANES, oy)
    simd.store(to_rays, 2 * LANES, oz)
    simd.store(to_rays, 3 * LANES, dx)
    simd.store(to_rays, 4 * LANES, dy)
    simd.store(to_rays, 5 * LANES, dz)


@njit(**UNWRAPPED, **BORROWING)
def add_channels(hits, rows, channels, gradients, stride, sums, vectors):
    """Add what a packet's discs receive by the channels beyond the inner ones."""
    places, masks, _, alpha, before, _, _ = hits
    for row in range(rows):
        at, mask = places[row] * stride + LANES, masks[row]
        if mask & (mask - 1) == 0:
            lane = lowest_bit(mask)
            weight = alpha[row * LANES + lane] * before[row * LANES + lane]
            for channel in range(INNER, channels):
                sums[at + channel - INNER] += weight * gradients[channel * LANES + lane]
        else:
            weights = row_weight(alpha, before, row)
            for first in range(INNER, channels, LANES):
                for k in range(min(LANES, channels - first)):
                    simd.store(vectors, k * LANES, weights * simd.load(gradients, (first + k) * LANES))
                sum_lanes(vectors, vectors, 0)
                target = at + first - INNER
                simd.store(sums, target, simd.load(sums, target) + simd.load(vectors, 0))


@njit(**UNWRAPPED, **BORROWING)
def write_rays(members, to_rays, to_origins, to_directions):
    for lane in range(LANES):
        if members[lane] >= 0:
            for k in range(3):
                to_origins[members[lane], k] = to_rays[k * LANES + lane]
                to_directions[members[lane], k] = to_rays[(3 + k) * LANES + lane]


@njit(**UNWRAPPED)
def backward_strip(first, past, tree, asked, features, kept, to_found, stride, sums, to_asked):
    """Gradients of the packets from ``first`` to before ``past``."""
    channels, hits = to_found.features.shape[1], new_hits(CAPACITY)
    rays, members = np.empty(RAY * LANES, np.float32), np.empty(LANES, np.int64)
    search = new_search(tree.levels[1])
    passing, moments = np.empty(LANES, np.float32), np.empty(2 * LANES, np.float32)
    gradients = np.zeros(max(channels, INNER) * LANES, np.float32)
    to_moments, to_rays = np.zeros(3 * LANES, np.float32), np.empty(6 * LANES, np.float32)
    vectors = np.zeros(LANES * LANES, np.float32)
    pull, to_alpha = np.empty_like(hits.alpha), np.empty_like(hits.alpha)
    for packet in range(first, past):
        rays_of(packet, asked.origins.shape[0], asked.width, members)
        read_rays(asked.origins, asked.directions, asked.far, members, rays)
        if kept.rows[packet] >= 0:
            rows = recall(tree, rays, asked.near, kept, packet, search.distance, hits)
            put_in_order(hits, rows, tree.order)
        else:
            rows, hits = gather_all(tree, rays, asked.near, search, hits)
        if hits.alpha.size > pull.size:
            pull, to_alpha = np.empty_like(hits.alpha), np.empty_like(hits.alpha)
        weigh(hits, rows, rays, passing)
        sum_moments(hits, rows, moments)
        read_gradients(members, moments, to_found, gradients, to_moments)
        pulls(hits, rows, tree.order, features, channels, gradients, to_moments, pull)
        walk_back(hits, rows, passing, to_moments, pull, to_alpha)
        add_rows(hits, rows, tree.records, rays, gradients, to_moments, to_alpha, stride, sums, to_rays)
        add_channels(hits, rows, channels, gradients, stride, sums, vectors)
        write_rays(members, to_rays, to_asked[0], to_asked[1])


@njit(**UNWRAPPED)
def backward_part(part, parts, tree, asked, features, kept, to_found, stride, sums, to_asked):
    """Gradients of all rays; the first arguments are those of ``forward_part``.

    Args:
        part: which of the
        parts: that work at a time.
        tree: as above.
        asked: as above.
        features: as above.
        kept: what ``forward_part`` wrote.
        to_found: a ``Found``, the gradients of what was found.
        stride: floats that a place of the tree has in ``sums``: one vector, and one for each sixteen channels
            or part thereof beyond ``INNER``.
        sums: float32 ``(parts, places * stride)``, zero, to be added to.
        to_asked: float32 ``(R, 3)``, two of them, to be written: of origins and directions.
    """
    packets = packets_of(asked.origins.shape[0], asked.width)
    strips = (packets + STRIP - 1) // STRIP
    for strip in range(part, strips, parts):
        first = strip * STRIP
        backward_strip(
            first, min(first + STRIP, packets), tree, asked, features, kept, to_found, stride, sums[part],
            to_asked,
        )  # fmt: skip


@njit(cache=True)
def backward(parts, *given):
    """Find the gradients of all rays in as many parts as ``sums`` has, whatever the number of threads.

    The rest is given as to ``backward_part``.
    """
    run_in(task(backward_part, given), parts)
