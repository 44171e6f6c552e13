# SPDX-License-Identifier: Apache-2.0
"""All discs that a packet of sixteen rays meets, and the order in which each ray meets them.

Rays that stay close are followed as one beam, down to single discs, each of which then meets all sixteen at
once. Rays that part are followed one by one, each meeting the sixteen discs of a leaf at once. Leaves come
nearest first: once every ray is as good as blocked, those behind need not be looked at.
"""

from typing import NamedTuple

import numpy as np

from graycard.methods._numba import njit
from graycard.methods.splat._maps import TRANSMITTANCE_MIN
from graycard.methods.splat.simd import _vector as simd
from graycard.methods.splat.simd._parts import BORROWING, UNWRAPPED
from graycard.methods.splat.simd._vector import LANES
from graycard.methods.splat.trace._beam import (
    BUCKETS,
    beam_of,
    bucket_of,
    farthest,
    leaves_touched,
    near_to_far,
    touched,
    width_of,
)
from graycard.methods.splat.trace._masks import lowest_bit, mask_at_least
from graycard.methods.splat.trace._meet import (
    all_rays,
    drawn_alpha,
    exponents,
    leaf_records,
    meet,
    one_ray,
    one_record,
)

BLOCKED = np.float32(0.5 * TRANSMITTANCE_MIN)
"""Transmittance at which a ray is surely blocked, whatever the order of the factors did to the digits."""
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
    """int32 ``(16 * capacity,)``: for each ray, the rows in the order in which it meets them."""
    counts: np.ndarray
    """int64 ``(16,)``: how many each ray meets."""


class Kept(NamedTuple):
    """Hits that the backward pass need not look for again; a ``depth`` of 0 keeps nothing."""

    places: np.ndarray
    """int32 ``(packets, depth)``: as in ``Hits``, as are the next."""
    masks: np.ndarray
    """uint16 ``(packets, depth)``."""
    rows: np.ndarray
    """int32 ``(packets,)``: how many there are, -1 where they are more than the depth."""


class Asked(NamedTuple):
    """The rays that are to be traced, and from where to where."""

    origins: np.ndarray
    """float32 ``(R, 3)``."""
    directions: np.ndarray
    """float32 ``(R, 3)``."""
    far: np.ndarray
    """float32 ``(R,)``: the last distance that counts; may be infinite."""
    width: int
    """Rays in a row of the image that they are, zero where they are none."""
    near: np.float32
    """The first distance that counts."""


class Found(NamedTuple):
    """Results of rays, or their gradients: all float32."""

    features: np.ndarray
    """Shape ``(R, C)``."""
    transmittance: np.ndarray
    """Shape ``(R,)``, as the next."""
    depth: np.ndarray


class Search(NamedTuple):
    """Memory of the descent through the tree."""

    leaves: np.ndarray
    spare: np.ndarray
    starts: np.ndarray
    distance: np.ndarray
    """float32 ``(16,)``, as is the next."""
    alpha: np.ndarray


@njit(**UNWRAPPED)
def new_hits(capacity):
    """Room for so many rows."""
    size = capacity * LANES
    return Hits(
        np.empty(capacity, np.int32),
        np.empty(capacity, np.int64),
        np.empty(size, np.float32),
        np.empty(size, np.float32),
        np.empty(size, np.float32),
        np.empty(size, np.int32),
        np.zeros(LANES, np.int64),
    )


@njit(**UNWRAPPED)
def new_search(leaves):
    """Room for a tree of so many leaves."""
    return Search(
        np.empty(leaves, np.int32),
        np.empty(leaves, np.int32),
        np.empty(BUCKETS + 2, np.int64),
        np.empty(LANES, np.float32),
        np.empty(LANES, np.float32),
    )


@njit(**UNWRAPPED, **BORROWING)
def put_in_order(hits, rows, order):
    """Write the sequences: by distance, equals by index of the surfel.

    Rows come nearly in order, for leaves do: each is put into its place among those before.
    """
    places, masks, distance, _, _, sequence, counts = hits
    counts[:] = 0
    for row in range(rows):
        mask, place = masks[row], places[row]
        while mask:
            lane = lowest_bit(mask)
            mask &= mask - 1
            t, first = distance[row * LANES + lane], lane * places.size
            at = first + counts[lane]
            while at > first:
                other = sequence[at - 1]
                t_other = distance[other * LANES + lane]
                if t_other < t or (t_other == t and order[places[other]] < order[place]):
                    break
                sequence[at] = other
                at -= 1
            sequence[at] = row
            counts[lane] += 1


@njit(**UNWRAPPED, **BORROWING)
def gather(tree, rays, near, search, hits):
    """Find what a packet meets.

    Args:
        tree: a ``Tree``.
        rays: float32: vectors of the origins' x, y, z and the directions', and others behind them.
        near: the first distance at which a disc counts.
        search: its memory.
        hits: the first four are to be written.

    Returns:
        The number of rows, -1 if there is not enough room for them.
    """
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


@njit(**UNWRAPPED, **BORROWING)
def gather_packet(tree, rays, near, beam, end, search, hits):
    """Rows of a whole packet: discs whose boxes the beam may touch, each against all rays."""
    count, leaves, spare = leaves_touched(tree.boxes, tree.levels, beam, search.leaves, search.spare)
    near_to_far(tree.boxes, tree.levels[1], beam, end, count, leaves, spare, search.starts)
    places, masks, distance, alphas, _, _, _ = hits
    boxes, records = tree.boxes, tree.records
    ray = all_rays(rays)
    first, zero, one = simd.broadcast(near), simd.broadcast(0.0), simd.broadcast(1.0)
    along, from_start = simd.load(rays, (3 + beam.axis) * LANES), simd.load(rays, beam.axis * LANES)
    sign = simd.broadcast(beam.sign)
    passing, seen, rows, i, is_open = one, simd.broadcast(-NOWHERE), 0, 0, True
    while i < count:
        leaf = spare[i]
        i += 1
        near_by = touched(boxes, leaf, beam)
        while near_by:
            place = leaf * LANES + lowest_bit(near_by)
            near_by &= near_by - 1
            record = one_record(records, place)
            t, _, u, v, _ = meet(record, ray)
            exponent, faintest = exponents(record, first, t, u, v)
            mask = mask_at_least(faintest, exponent)
            if mask:
                alpha = drawn_alpha(record, exponent, faintest)
                if rows == places.size:
                    return -1
                t = simd.where_at_least(faintest, exponent, t, zero)
                simd.store(distance, rows * LANES, t)
                simd.store(alphas, rows * LANES, alpha)
                places[rows], masks[rows] = place, mask
                passing = passing * (one - alpha)
                seen = simd.maximum(seen, simd.fma(t, along, from_start) * sign)
                rows += 1
        if is_open and simd.largest_lane(passing) <= BLOCKED:
            is_open = False
            count = search.starts[bucket_of(simd.largest_lane(seen) - beam.start, end) + 1]
    return rows


@njit(**UNWRAPPED, **BORROWING)
def gather_ray(tree, rays, lane, near, beam, end, search, hits, rows):
    """Rows of one ray of a packet, from ``rows`` on: sixteen discs of a leaf at a time."""
    count, leaves, spare = leaves_touched(tree.boxes, tree.levels, beam, search.leaves, search.spare)
    near_to_far(tree.boxes, tree.levels[1], beam, end, count, leaves, spare, search.starts)
    places, masks, distance, alphas, _, _, _ = hits
    records, t_found, alpha_found = tree.records, search.distance, search.alpha
    ray, first, zero = one_ray(rays, lane), simd.broadcast(near), simd.broadcast(0.0)
    along = abs(rays[(3 + beam.axis) * LANES + lane])
    passing, seen, i, is_open = np.float32(1), np.float32(0), 0, True
    while i < count:
        leaf = spare[i]
        i += 1
        record = leaf_records(records, leaf)
        t, _, u, v, _ = meet(record, ray)
        exponent, faintest = exponents(record, first, t, u, v)
        mask = mask_at_least(faintest, exponent)
        if mask:
            simd.store(t_found, 0, t)
            simd.store(alpha_found, 0, drawn_alpha(record, exponent, faintest))
            while mask:
                disc = lowest_bit(mask)
                mask &= mask - 1
                if rows == places.size:
                    return -1
                simd.store(distance, rows * LANES, zero)
                simd.store(alphas, rows * LANES, zero)
                distance[rows * LANES + lane] = t_found[disc]
                alphas[rows * LANES + lane] = alpha_found[disc]
                places[rows], masks[rows] = leaf * LANES + disc, 1 << lane
                passing *= np.float32(1) - alpha_found[disc]
                seen = max(seen, t_found[disc])
                rows += 1
            if is_open and passing <= BLOCKED:
                is_open = False
                count = search.starts[bucket_of(seen * along, end) + 1]
    return rows


@njit(**UNWRAPPED, **BORROWING)
def keep(hits, rows, kept, packet):
    """Note a packet's discs and masks, if there is room."""
    places, masks, kept_places, kept_masks = hits.places, hits.masks, kept.places, kept.masks
    kept.rows[packet] = rows if rows <= kept_places.shape[1] else -1
    if rows <= kept_places.shape[1]:
        for row in range(rows):
            kept_places[packet, row], kept_masks[packet, row] = places[row], masks[row]


@njit(**UNWRAPPED, **BORROWING)
def recall(tree, rays, near, kept, packet, member, hits):
    """Rows of a packet whose discs and masks were kept: what ``gather`` wrote, to the bit.

    ``member`` is room for a vector.
    """
    kept_places, kept_masks, rows = kept.places, kept.masks, kept.rows[packet]
    places, masks, distance, alphas, _, _, _ = hits
    records, ray = tree.records, all_rays(rays)
    first, zero = simd.broadcast(near), simd.broadcast(0.0)
    for row in range(rows):
        place, mask = kept_places[packet, row], np.int64(kept_masks[packet, row])
        places[row], masks[row] = place, mask
        record = one_record(records, place)
        t, _, u, v, _ = meet(record, ray)
        exponent, faintest = exponents(record, first, t, u, v)
        alpha = drawn_alpha(record, exponent, faintest)
        t = simd.where_at_least(faintest, exponent, t, zero)
        if mask & (mask - 1) == 0:  # other rays that meet the disc have rows of their own
            simd.store(member, 0, zero)
            member[lowest_bit(mask)] = 1
            is_member = simd.load(member, 0)
            t = simd.where_less(zero, is_member, t, zero)
            alpha = simd.where_less(zero, is_member, alpha, zero)
        simd.store(distance, row * LANES, t)
        simd.store(alphas, row * LANES, alpha)
    return rows
