# SPDX-License-Identifier: Apache-2.0
"""All discs that a packet of sixteen rays meets, and the order in which each ray meets them.

Rays that stay close are followed as one beam, down to single discs, each of which then meets all sixteen at
once. Rays that part are followed one by one, each meeting the sixteen discs of a leaf at once. Leaves come
nearest first: once every ray is as good as blocked, those behind need not be looked at.
"""

from typing import NamedTuple

import numpy as np
from numba import njit

from graycard.methods.splat import _simd as simd
from graycard.methods.splat._maps import TRANSMITTANCE_MIN
from graycard.methods.splat._simd import LANES
from graycard.methods.splat._trace_beam import (
    BUCKETS,
    beam_of,
    farthest,
    leaves_touched,
    near_to_far,
    touched,
    width_of,
)
from graycard.methods.splat._trace_masks import lowest_bit, mask_at_least
from graycard.methods.splat._trace_meet import (
    all_rays,
    drawn_alpha,
    leaf_records,
    meet,
    one_ray,
    one_record,
)

BLOCKED = np.float32(0.5 * TRANSMITTANCE_MIN)
"""Transmittance at which a ray is surely blocked, whatever the order of the factors did to the last digits."""
NARROW = 1.0
"""A packet is a beam if it is no wider than this many leaves."""
NOWHERE = np.float32(3e38)


class Hits(NamedTuple):
    """Discs that a packet meets, one after the other as they are found: "rows", of sixteen rays each."""

    places: np.ndarray
    """int32 ``(capacity,)``: place of the disc in the tree."""
    masks: np.ndarray
    """int64 ``(capacity,)``: which rays meet it."""
    distance: np.ndarray
    """float32, flat, a vector a row; 0 where a ray does not meet the disc, as in the next two."""
    alpha: np.ndarray
    before: np.ndarray
    """float32, flat: what passes the discs before; 0 too where that is too little to count."""
    sequence: np.ndarray
    """int32 ``(16, capacity)``: rows in the order in which each ray meets them."""
    counts: np.ndarray
    """int64 ``(16,)``: how many each ray meets."""


class Search(NamedTuple):
    """Memory of the descent through the tree."""

    leaves: np.ndarray
    spare: np.ndarray
    heads: np.ndarray
    distance: np.ndarray
    """float32 ``(16,)``, as is the next."""
    alpha: np.ndarray


@njit(cache=True)
def new_hits(capacity):
    """Room for so many rows."""
    size = capacity * LANES
    return Hits(
        np.empty(capacity, np.int32),
        np.empty(capacity, np.int64),
        np.empty(size, np.float32),
        np.empty(size, np.float32),
        np.empty(size, np.float32),
        np.empty((LANES, capacity), np.int32),
        np.zeros(LANES, np.int64),
    )


@njit(cache=True)
def new_search(leaves):
    """Room for a tree of so many leaves."""
    return Search(
        np.empty(leaves, np.int32),
        np.empty(leaves, np.int32),
        np.empty(BUCKETS, np.int32),
        np.empty(LANES, np.float32),
        np.empty(LANES, np.float32),
    )


@njit(cache=True)
def insert(hits, order, row, lane):
    """Put a row into the sequence of a ray: by distance, equals by index of the surfel."""
    distance, sequence = hits.distance, hits.sequence[lane]
    t, surfel, at = distance[row * LANES + lane], order[hits.places[row]], hits.counts[lane]
    while at > 0:
        other = sequence[at - 1]
        t_other = distance[other * LANES + lane]
        if t_other < t or (t_other == t and order[hits.places[other]] < surfel):
            break
        sequence[at] = other
        at -= 1
    sequence[at] = row
    hits.counts[lane] += 1


@njit(cache=True)
def gather(tree, rays, near, search, hits):
    """Find and order what a packet meets.

    Args:
        tree: a ``Tree``.
        rays: float32 ``(96,)``: vectors of the origins' x, y, z and the directions'.
        near: distance from which on a disc counts.
        search: its memory.
        hits: to be written, all but ``before``.

    Returns:
        The number of rows, -1 if there is not enough room for them.
    """
    hits.counts[:] = 0
    beam, advances = beam_of(rays, 0, LANES)
    end = farthest(beam, tree.reach)
    if advances and width_of(beam, end) <= NARROW * tree.leaf_size:
        return gather_packet(tree, rays, near, beam, end, search, hits)
    rows = 0
    for lane in range(LANES):
        if rows >= 0:
            beam, _ = beam_of(rays, lane, lane + 1)
            end = farthest(beam, tree.reach)
            rows = gather_ray(tree, rays, lane, near, beam, end, search, hits, rows)
    return rows


@njit(cache=True)
def gather_packet(tree, rays, near, beam, end, search, hits):
    """Rows of a whole packet: discs whose boxes the beam may touch, each against all rays."""
    count, leaves, following = leaves_touched(tree.boxes, tree.levels, beam, search.leaves, search.spare)
    near_to_far(tree.boxes, tree.levels[1], beam, end, count, leaves, following, search.heads)
    ray = all_rays(rays)
    first, zero, one = simd.broadcast(near), simd.broadcast(0.0), simd.broadcast(1.0)
    along, from_start = simd.load(rays, (3 + beam.axis) * LANES), simd.load(rays, beam.axis * LANES)
    sign = simd.broadcast(beam.sign)
    passing, seen, rows, last = one, zero, 0, NOWHERE
    for bucket in range(BUCKETS):
        if bucket * (end / BUCKETS) > last:
            break
        i = search.heads[bucket]
        while i >= 0:
            leaf, i = leaves[i], following[i]
            boxes = touched(tree.boxes, leaf, beam)
            while boxes:
                place = leaf * LANES + lowest_bit(boxes)
                boxes &= boxes - 1
                record = one_record(tree.records, place)
                t, _, u, v, _ = meet(record, ray)
                alpha, exponent, faintest = drawn_alpha(record, first, t, u, v)
                mask = mask_at_least(faintest, exponent)
                if mask:
                    if rows == hits.places.size:
                        return -1
                    t = simd.where_at_least(faintest, exponent, t, zero)
                    simd.store(hits.distance, rows * LANES, t)
                    simd.store(hits.alpha, rows * LANES, alpha)
                    hits.places[rows], hits.masks[rows] = place, mask
                    passing = passing * (one - alpha)
                    seen = simd.maximum(seen, simd.fma(t, along, from_start) * sign)
                    while mask:
                        insert(hits, tree.order, rows, lowest_bit(mask))
                        mask &= mask - 1
                    rows += 1
        if last == NOWHERE and simd.largest_lane(passing) <= BLOCKED:
            last = simd.largest_lane(seen) - beam.start
    return rows


@njit(cache=True)
def gather_ray(tree, rays, lane, near, beam, end, search, hits, rows):
    """Rows of one ray of a packet, from ``rows`` on: sixteen discs of a leaf at a time."""
    count, leaves, following = leaves_touched(tree.boxes, tree.levels, beam, search.leaves, search.spare)
    near_to_far(tree.boxes, tree.levels[1], beam, end, count, leaves, following, search.heads)
    ray, first, zero = one_ray(rays, lane), simd.broadcast(near), simd.broadcast(0.0)
    passing, seen, last = np.float32(1), np.float32(0), NOWHERE
    for bucket in range(BUCKETS):
        if bucket * (end / BUCKETS) > last:
            break
        i = search.heads[bucket]
        while i >= 0:
            leaf, i = leaves[i], following[i]
            record = leaf_records(tree.records, leaf)
            t, _, u, v, _ = meet(record, ray)
            alpha, exponent, faintest = drawn_alpha(record, first, t, u, v)
            mask = mask_at_least(faintest, exponent)
            if mask:
                simd.store(search.distance, 0, t)
                simd.store(search.alpha, 0, alpha)
            while mask:
                disc = lowest_bit(mask)
                mask &= mask - 1
                if rows == hits.places.size:
                    return -1
                simd.store(hits.distance, rows * LANES, zero)
                simd.store(hits.alpha, rows * LANES, zero)
                hits.distance[rows * LANES + lane] = search.distance[disc]
                hits.alpha[rows * LANES + lane] = search.alpha[disc]
                hits.places[rows], hits.masks[rows] = leaf * LANES + disc, 1 << lane
                insert(hits, tree.order, rows, lane)
                passing *= np.float32(1) - search.alpha[disc]
                seen = max(seen, search.distance[disc])
                rows += 1
        if last == NOWHERE and passing <= BLOCKED:
            axis = beam.axis
            last = seen * abs(rays[(3 + axis) * LANES + lane])
    return rows
