# SPDX-License-Identifier: Apache-2.0
"""The tracer's forward kernel: a strip of packets of sixteen rays at a time."""

import numpy as np

from graycard.methods._numba import njit
from graycard.methods.splat._maps import TRANSMITTANCE_MIN
from graycard.methods.splat.simd import _vector as simd
from graycard.methods.splat.simd._parts import BORROWING, INLINED, UNWRAPPED, run, share, task
from graycard.methods.splat.simd._vector import LANES
from graycard.methods.splat.trace._gather import gather, keep, new_hits, new_search, put_in_order

STRIP = 16
"""Packets that one thread traces with the same memory."""
BLOCK = 4
"""Pixels on the side of the block that is a packet where rays are an image."""
RAY = 7
"""Numbers of a ray in a packet: origin, direction, and where it ends."""
FAR = (RAY - 1) * LANES
"""Start of the last of them."""
CAPACITY = 256
"""Rows for which there is room at first; it is doubled as often as a packet needs."""


@njit(cache=True)
def packets_of(count, width):
    """Return number of packets; ``width`` is zero where the rays are no image."""
    if width == 0:
        return (count + LANES - 1) // LANES
    return ((width + BLOCK - 1) // BLOCK) * ((count // width + BLOCK - 1) // BLOCK)


@njit(**UNWRAPPED, **BORROWING)
def rays_of(packet, count, width, members):
    """Rays of a packet, -1 where it reaches past the last or past the border of the image."""
    across = (width + BLOCK - 1) // BLOCK
    for lane in range(LANES):
        ray = packet * LANES + lane
        inside = ray < count
        if width > 0:
            row = packet // across * BLOCK + lane // BLOCK
            column = packet % across * BLOCK + lane % BLOCK
            ray, inside = row * width + column, column < width and row * width < count
        members[lane] = ray if inside else -1


@njit(**UNWRAPPED, **BORROWING)
def read_rays(origins, directions, far, members, rays):
    """Bring a packet's rays and their ends into vectors; its first stands for those that are not there."""
    for lane in range(LANES):
        ray = members[lane] if members[lane] >= 0 else members[0]
        for k in range(3):
            rays[k * LANES + lane] = origins[ray, k]
            rays[(3 + k) * LANES + lane] = directions[ray, k]
        rays[FAR + lane] = far[ray]


@njit(**UNWRAPPED)
def gather_all(tree, rays, near, search, hits):
    """Return the same as ``gather``, with as much memory as it takes, and in order: the number of rows,
    and the rows.
    """
    rows = gather(tree, rays, near, search, hits)
    while rows < 0:
        hits = new_hits(2 * hits.places.size)
        rows = gather(tree, rays, near, search, hits)
    put_in_order(hits, rows, tree.order)
    return rows, hits


@njit(**UNWRAPPED, **BORROWING)
def weigh(hits, rows, rays, transmittance):
    """Walk each ray's sequence: what passes before each disc, and after the last that counts."""
    places, _, distance, alpha, before, sequence, counts = hits
    for at in range(rows * LANES):
        before[at] = 0
    for lane in range(LANES):
        passing, first = np.float32(1), lane * places.size
        for step in range(first, first + counts[lane]):
            at = sequence[step] * LANES + lane
            if distance[at] > rays[FAR + lane]:
                break
            before[at] = passing
            passing -= passing * alpha[at]
            if passing <= TRANSMITTANCE_MIN:
                break
        transmittance[lane] = passing


@njit(**INLINED, **BORROWING)
def row_weight(alpha, before, row):
    return simd.load(alpha, row * LANES) * simd.load(before, row * LANES)


@njit(**UNWRAPPED, **BORROWING)
def scattered(values, members, out, channel):
    """Write a packet's vector to the rows of an array."""
    for lane in range(LANES):
        if members[lane] >= 0:
            out[members[lane], channel] = values[lane]


@njit(**UNWRAPPED, **BORROWING)
def sum_moments(hits, rows, moments):
    """Write the sums of w and of w t of a packet."""
    _, _, distance, alpha, before, _, _ = hits
    weight, way = simd.broadcast(0.0), simd.broadcast(0.0)
    for row in range(rows):
        weight = weight + row_weight(alpha, before, row)
        way = simd.fma(row_weight(alpha, before, row), simd.load(distance, row * LANES), way)
    simd.store(moments, 0, weight)
    simd.store(moments, LANES, way)


@njit(**UNWRAPPED, **BORROWING)
def write_features(hits, rows, order, features, members, out, vector):
    """Sum a packet's features and write them."""
    places, _, _, alpha, before, _, _ = hits
    channels = out.shape[1]
    for channel in range(channels):
        total = simd.broadcast(0.0)
        for row in range(rows):
            value = simd.load_scalar(features, order[places[row]] * channels + channel)
            total = simd.fma(row_weight(alpha, before, row), value, total)
        simd.store(vector, 0, total)
        scattered(vector, members, out, channel)


@njit(**UNWRAPPED)
def forward_strip(first, past, tree, asked, features, kept, found):
    """Trace the packets from ``first`` to before ``past``."""
    search, hits = new_search(tree.levels[1]), new_hits(CAPACITY)
    rays, members = np.empty(RAY * LANES, np.float32), np.empty(LANES, np.int64)
    passing, moments = np.empty(LANES, np.float32), np.empty(2 * LANES, np.float32)
    vector = np.empty(LANES, np.float32)
    for packet in range(first, past):
        rays_of(packet, asked.origins.shape[0], asked.width, members)
        read_rays(asked.origins, asked.directions, asked.far, members, rays)
        rows, hits = gather_all(tree, rays, asked.near, search, hits)
        keep(hits, rows, kept, packet)
        weigh(hits, rows, rays, passing)
        write_features(hits, rows, tree.order, features, members, found.features, vector)
        sum_moments(hits, rows, moments)
        for lane in range(LANES):
            if members[lane] >= 0:
                found.transmittance[members[lane]] = passing[lane]
                weight, way = moments[lane], moments[LANES + lane]
                found.depth[members[lane]] = way / weight if weight > 0 else np.float32(0)


@njit(**UNWRAPPED)
def forward_part(part, parts, tree, asked, features, kept, found):
    """Trace all rays.

    Args:
        part: which of the
        parts: that work at a time.
        tree: a ``Tree``.
        asked: an ``Asked``.
        features: float32, flat, as many channels a surfel as ``found`` has.
        kept: a ``Kept``, to be written, as is
        found: a ``Found``.
    """
    packets = packets_of(asked.origins.shape[0], asked.width)
    strips = (packets + STRIP - 1) // STRIP
    start, stop = share(part, parts, strips)
    for strip in range(start, stop):
        first = strip * STRIP
        past = min(first + STRIP, packets)
        forward_strip(first, past, tree, asked, features, kept, found)


@njit(cache=True)
def forward(*given):
    """Trace all rays; the arguments are those of ``forward_part`` after its parts."""
    run(task(forward_part, given))
