# SPDX-License-Identifier: Apache-2.0
"""Beams: which boxes a beam may touch: the rays of a packet, or one of them, as two wedges.

Along the axis on which the rays advance the most, the other two coordinates of every ray lie between two
straight lines. A box is left out where its rectangle, seen along one of those two axes, lies beside the
lines, or where it is behind all origins. One vector operation asks this of sixteen boxes.
"""

from typing import NamedTuple

import numpy as np

from graycard.methods._numba import njit
from graycard.methods.splat.simd import _vector as simd
from graycard.methods.splat.simd._parts import BORROWING, INLINED, UNWRAPPED
from graycard.methods.splat.simd._vector import LANES
from graycard.methods.splat.trace._bvh_kernels import BOX
from graycard.methods.splat.trace._masks import lowest_bit, mask_at_least

SLOWEST = 0.2
"""Share of its length by which each ray of a beam must advance along the axis."""
BUCKETS = 32
"""Steps of distance by which leaves are put in order."""
SHORTEST = np.float32(1e-20)


class Beam(NamedTuple):
    """Rays between lines; the distance s counts along the axis, forwards, from the hindmost origin."""

    axis: int
    sign: np.float32
    start: np.float32
    low_1: np.float32
    high_1: np.float32
    slope_low_1: np.float32
    slope_high_1: np.float32
    low_2: np.float32
    high_2: np.float32
    slope_low_2: np.float32
    slope_high_2: np.float32


@njit(**UNWRAPPED, **BORROWING)
def main_axis(rays, first, past):
    """Return the axis along which some rays of a packet advance the most, and its sign."""
    axis, most = 0, np.float32(0)
    for k in range(3):
        total = np.float32(0)
        for lane in range(first, past):
            total += rays[(3 + k) * LANES + lane]
        if abs(total) > abs(most):
            axis, most = k, total
    return axis, np.float32(1) if most >= 0 else np.float32(-1)


@njit(error_model="numpy", **UNWRAPPED, **BORROWING)
def lines(rays, first, past, axis, sign, start, other):
    """Bounds of another coordinate: least and largest value at the start, and least and largest slope."""
    low = slope_low = np.float32(np.inf)
    high = slope_high = np.float32(-np.inf)
    for lane in range(first, past):
        slope = rays[(3 + other) * LANES + lane] / abs(rays[(3 + axis) * LANES + lane])
        value = rays[other * LANES + lane] - slope * (sign * rays[axis * LANES + lane] - start)
        low, high = min(low, value), max(high, value)
        slope_low, slope_high = min(slope_low, slope), max(slope_high, slope)
    return low, high, slope_low, slope_high


@njit(**UNWRAPPED, **BORROWING)
def beam_of(rays, first, past):
    """Return the beam of some rays of a packet, and whether they all advance along one axis as a
    beam must.
    """
    axis, sign = main_axis(rays, first, past)
    start, slowest = np.float32(np.inf), np.float32(np.inf)
    for lane in range(first, past):
        start = min(start, sign * rays[axis * LANES + lane])
        slowest = min(slowest, sign * rays[(3 + axis) * LANES + lane])
    a = lines(rays, first, past, axis, sign, start, (axis + 1) % 3)
    b = lines(rays, first, past, axis, sign, start, (axis + 2) % 3)
    beam = Beam(axis, sign, start, a[0], a[1], a[2], a[3], b[0], b[1], b[2], b[3])
    return beam, slowest >= SLOWEST


@njit(**INLINED, **BORROWING)
def farthest(beam, reach):
    """Distance s to the far side of the box around everything; negative where it is behind the beam."""
    side = reach[3 + beam.axis] if beam.sign > 0 else -reach[beam.axis]
    return side - beam.start


@njit(**UNWRAPPED, **BORROWING)
def width_of(beam, end):
    """Metres: the larger of the beam's two widths at the distance ``end``."""
    first = beam.high_1 - beam.low_1 + end * (beam.slope_high_1 - beam.slope_low_1)
    second = beam.high_2 - beam.low_2 + end * (beam.slope_high_2 - beam.slope_low_2)
    return max(first, second)


@njit(**INLINED, **BORROWING)
def beside(boxes, at, other, entry, leave, low, high, slope_low, slope_high):
    """By how much sixteen rectangles overlap a wedge; negative where they lie beside it."""
    upper_s = leave if slope_high >= 0 else entry
    lower_s = entry if slope_low >= 0 else leave
    upper = simd.fma(simd.broadcast(slope_high), upper_s, simd.broadcast(high))
    lower = simd.fma(simd.broadcast(slope_low), lower_s, simd.broadcast(low))
    above = upper - simd.load(boxes, at + other * LANES)
    return simd.minimum(above, simd.load(boxes, at + (3 + other) * LANES) - lower)


@njit(**INLINED, **BORROWING)
def touched(boxes, group, beam):
    """Return which of sixteen boxes a beam may touch, as the bits of a number."""
    at, axis = group * (BOX * LANES), beam.axis
    near = axis if beam.sign > 0 else 3 + axis
    far = 3 + axis if beam.sign > 0 else axis
    sign, start = simd.broadcast(beam.sign), simd.broadcast(beam.start)
    zero = simd.broadcast(0.0)
    entry = simd.maximum(simd.load(boxes, at + near * LANES) * sign - start, zero)
    leave = simd.load(boxes, at + far * LANES) * sign - start
    first = beside(
        boxes, at, (axis + 1) % 3, entry, leave, beam.low_1, beam.high_1, beam.slope_low_1, beam.slope_high_1
    )
    second = beside(
        boxes, at, (axis + 2) % 3, entry, leave, beam.low_2, beam.high_2, beam.slope_low_2, beam.slope_high_2
    )
    return mask_at_least(simd.minimum(leave, simd.minimum(first, second)), zero)


@njit(**UNWRAPPED, **BORROWING)
def leaves_touched(boxes, levels, beam, found, spare):
    """Leaves that a beam may touch.

    Args:
        boxes: those of the tree.
        levels: its levels.
        beam: the beam.
        found: int32, as long as there are leaves, to be written.
        spare: another.

    Returns:
        Their number; the array that holds them, one of the two; the other.
    """
    found[0], count = 0, 1
    for level in range(levels.size - 1, 0, -1):
        past = 0
        for i in range(count):
            mask = touched(boxes, levels[level] + found[i], beam)
            while mask:
                spare[past] = found[i] * LANES + lowest_bit(mask)
                past += 1
                mask &= mask - 1
        found, spare, count = spare, found, past
    return count, found, spare


@njit(error_model="numpy", **INLINED, **BORROWING)
def bucket_of(distance, end):
    """Return the step of distance, of those from the start to ``end``."""
    return int(min(max(distance, 0.0) * (BUCKETS / max(end, SHORTEST)), BUCKETS - 1.0))


@njit(error_model="numpy", **UNWRAPPED, **BORROWING)
def near_to_far(boxes, first_group, beam, end, count, leaves, ordered, starts):
    """Put leaves in the order of the buckets of distance in which their boxes begin.

    Args:
        boxes: those of the tree.
        first_group: of the level that holds the leaves' boxes.
        beam: the beam.
        end: distance s at which the last bucket ends.
        count: number of leaves.
        leaves: their numbers.
        ordered: int32, to be written: their numbers in order.
        starts: int64 ``(BUCKETS + 2,)``, to be written: how many leaves lie in the buckets before each.
    """
    starts[:] = 0
    near = beam.axis if beam.sign > 0 else 3 + beam.axis
    for i in range(count):
        at = ((first_group + leaves[i] // LANES) * BOX + near) * LANES + leaves[i] % LANES
        starts[bucket_of(beam.sign * boxes[at] - beam.start, end) + 2] += 1
    for bucket in range(2, BUCKETS + 1):
        starts[bucket + 1] += starts[bucket]
    for i in range(count):
        at = ((first_group + leaves[i] // LANES) * BOX + near) * LANES + leaves[i] % LANES
        bucket = bucket_of(beam.sign * boxes[at] - beam.start, end)
        ordered[starts[bucket + 1]] = leaves[i]
        starts[bucket + 1] += 1
