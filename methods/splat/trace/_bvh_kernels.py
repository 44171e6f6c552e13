# SPDX-License-Identifier: Apache-2.0
"""Kernels that build the tree of boxes: prepare, sort along a Hilbert curve, fill.

Sixteen surfels that follow one another on the curve are a leaf, sixteen leaves a node, and so on: the shape
of the tree is known from the number of surfels, and no node holds a pointer. What belongs to sixteen
neighbours lies side by side, number by number, so that one vector operation serves all of them.
"""

from math import log, log2, sqrt

import numpy as np

from graycard.methods._numba import njit
from graycard.methods.splat._maps import ALPHA_MIN
from graycard.methods.splat.raster._coefficients import LOG2_E
from graycard.methods.splat.simd._parts import INLINED, UNWRAPPED, run, share, task
from graycard.methods.splat.simd._vector import LANES

RECORD = 13
"""Numbers of a surfel: U, V, N, centre (three each), log2 of the opacity. The exponent, to base two, at a
point p from the centre is (U . p)^2 + (V . p)^2, and N is the normal."""
LOG_OPACITY = 12
BOX = 6
"""Numbers of a box: its low corner, then its high one."""
COLUMNS = RECORD + BOX
FAR_AWAY = np.float32(1e30)
"""A box from here to minus here is one that nothing meets."""
WIDENED = 4e-6
"""By what share of its coordinates a box is larger than its disc, against rounding."""
UNIT = sqrt(LOG2_E / 2)
"""U and V are the axes by standard deviation times this."""
AXIS_BITS, DIGIT_BITS = 10, 10
DIGITS = 1 << DIGIT_BITS


@njit(**INLINED)
def rotation(q, row):
    """Columns of the rotation matrix of a quaternion ``(w, x, y, z)`` of any length, one after the other."""
    over = 1.0 / sqrt(q[row, 0] ** 2 + q[row, 1] ** 2 + q[row, 2] ** 2 + q[row, 3] ** 2)
    w, x, y, z = q[row, 0] * over, q[row, 1] * over, q[row, 2] * over, q[row, 3] * over
    return (
        (1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)),
        (2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x)),
        (2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)),
    )


@njit(forceinline=True)  # Python calls it too, as it does the next
def spread_bits(x):
    """Put two zeros between neighbouring bits of a ten-bit number."""
    x = (x | (x << 16)) & 0x030000FF
    x = (x | (x << 8)) & 0x0300F00F
    x = (x | (x << 4)) & 0x030C30C3
    return (x | (x << 2)) & 0x09249249


@njit(forceinline=True)
def curve_key(x, y, z):
    """Place of a cell of the grid on a Hilbert curve, which never jumps (Skilling 2004, axes to transpose).

    Boxes around neighbours on it have two thirds of the area that they have on a Morton curve.
    """
    for bit in range(AXIS_BITS - 1, 0, -1):
        low = (1 << bit) - 1
        x ^= low & -((x >> bit) & 1)
        swapped = (x ^ y) & low & (((y >> bit) & 1) - 1)
        x, y = x ^ swapped ^ (low & -((y >> bit) & 1)), y ^ swapped
        swapped = (x ^ z) & low & (((z >> bit) & 1) - 1)
        x, z = x ^ swapped ^ (low & -((z >> bit) & 1)), z ^ swapped
    y ^= x
    z ^= y
    turned = 0
    for bit in range(AXIS_BITS - 1, 0, -1):
        turned ^= ((1 << bit) - 1) & -((z >> bit) & 1)
    return spread_bits(x ^ turned) << 2 | spread_bits(y ^ turned) << 1 | spread_bits(z ^ turned)


@njit(**UNWRAPPED)
def prepare_part(part, parts, geometry, low, steps, rows, keys):
    """Numbers of the surfels, and their keys on the curve.

    Args:
        part: which of the
        parts: that work at a time.
        geometry: a ``Geometry``.
        low: float64 ``(3,)``, the least centre.
        steps: float64 ``(3,)``, steps of the curve per metre.
        rows: float32 ``(N, COLUMNS)``, to be written.
        keys: uint32 ``(N,)``, to be written.
    """
    centres, rotations, scales, opacities = geometry
    start, stop = share(part, parts, centres.shape[0])
    for n in range(start, stop):
        x, y, normal = rotation(rotations, n)
        seen = opacities[n] >= ALPHA_MIN
        rows[n, LOG_OPACITY] = log2(opacities[n]) if seen else -FAR_AWAY
        radius = sqrt(2 * log(opacities[n] / ALPHA_MIN)) if seen else 0.0
        for k in range(3):
            rows[n, k] = UNIT * x[k] / scales[n, 0]
            rows[n, 3 + k] = UNIT * y[k] / scales[n, 1]
            rows[n, 6 + k] = normal[k]
            rows[n, 9 + k] = centres[n, k]
            half = radius * sqrt((x[k] * scales[n, 0]) ** 2 + (y[k] * scales[n, 1]) ** 2)
            half += WIDENED * (abs(centres[n, k]) + half)
            rows[n, RECORD + k] = centres[n, k] - half if seen else FAR_AWAY
            rows[n, RECORD + 3 + k] = centres[n, k] + half if seen else -FAR_AWAY
        keys[n] = curve_key(
            int((centres[n, 0] - low[0]) * steps[0]),
            int((centres[n, 1] - low[1]) * steps[1]),
            int((centres[n, 2] - low[2]) * steps[2]),
        )


@njit(cache=True)
def prepare(*given):
    """Prepare all surfels; the arguments are those of ``prepare_part`` after its parts."""
    run(task(prepare_part, given))


@njit(cache=True)
def sort_keys(keys):
    """Return indices of keys of ``3 * AXIS_BITS`` bits in ascending order, equals as they came
    (radix sort).
    """
    order, other = np.arange(keys.size, dtype=np.int32), np.empty(keys.size, np.int32)
    for shift in range(0, 3 * AXIS_BITS, DIGIT_BITS):
        start = np.zeros(DIGITS + 1, np.int64)
        for n in range(keys.size):
            start[((keys[n] >> np.uint32(shift)) & np.uint32(DIGITS - 1)) + 1] += 1
        for digit in range(DIGITS):
            start[digit + 1] += start[digit]
        for place in range(keys.size):
            digit = (keys[order[place]] >> np.uint32(shift)) & np.uint32(DIGITS - 1)
            other[start[digit]] = order[place]
            start[digit] += 1
        order, other = other, order
    return order


@njit(**UNWRAPPED)
def fill_leaves_part(part, parts, rows, order, records, boxes):
    """Bring the numbers of the surfels into the order of the curve.

    Args:
        part: which of the
        parts: that work at a time.
        rows: as ``prepare`` wrote them.
        order: int32 ``(16 leaves,)``, the surfel in each place, -1 where there is none.
        records: float32, flat, ``RECORD`` vectors a leaf, to be written.
        boxes: float32, flat, ``BOX`` vectors a leaf first, to be written.
    """
    start, stop = share(part, parts, order.size // LANES)
    for leaf in range(start, stop):
        for lane in range(LANES):
            surfel = order[leaf * LANES + lane]
            for k in range(RECORD):
                empty = -FAR_AWAY if k == LOG_OPACITY else np.float32(0)
                records[(leaf * RECORD + k) * LANES + lane] = rows[surfel, k] if surfel >= 0 else empty
            for k in range(BOX):
                empty = FAR_AWAY if k < 3 else -FAR_AWAY
                value = rows[surfel, RECORD + k] if surfel >= 0 else empty
                boxes[(leaf * BOX + k) * LANES + lane] = value


@njit(cache=True)
def fill_leaves(*given):
    """Fill all leaves; the arguments are those of ``fill_leaves_part`` after its parts."""
    run(task(fill_leaves_part, given))


@njit(cache=True)
def fill_level(boxes, children, below, above):
    """Boxes around groups of sixteen boxes.

    Args:
        boxes: as above.
        children: number of groups on the level below.
        below: the first of them.
        above: the first group of the level to be written.
    """
    for parent in range((children + LANES - 1) // LANES * LANES):
        at = (above + parent // LANES) * BOX * LANES + parent % LANES
        for k in range(BOX):
            value = FAR_AWAY if k < 3 else -FAR_AWAY
            if parent < children:
                first = ((below + parent) * BOX + k) * LANES
                for lane in range(LANES):
                    child = boxes[first + lane]
                    value = min(value, child) if k < 3 else max(value, child)
            boxes[at + k * LANES] = value


@njit(**UNWRAPPED)
def gather_gradients_part(part, parts, geometry, order, sums, stride, to):
    """From gradients of the records to those of the surfels.

    Args:
        part: which of the
        parts: that work at a time.
        geometry: as above.
        order: as above.
        sums: float32 ``(parts, places * stride)``; the first ``RECORD`` of each place: for each of U, V, N
            the sum of its pull times the point (three) and of the pull itself, place 3, 7, 11; then of log2
            of the opacity.
        stride: floats a place.
        to: a ``Geometry``, to be written.
    """
    start, stop = share(part, parts, order.size // LANES)
    for leaf in range(start, stop):
        total = np.empty(RECORD)
        for place in range(leaf * LANES, (leaf + 1) * LANES):
            n = order[place]
            if n >= 0:
                add_parts(sums, place * stride, total)
                surfel_gradient(geometry, n, total, to)


@njit(cache=True)
def gather_gradients(*given):
    """Find the gradients of surfels; arguments are those of ``gather_gradients_part`` after its parts."""
    run(task(gather_gradients_part, given))


@njit(**UNWRAPPED)
def add_parts(sums, at, total):
    """Sum the numbers of one place over the parts, in their order."""
    total[:] = 0
    for part in range(sums.shape[0]):
        for k in range(RECORD):
            total[k] += sums[part, at + k]


@njit(**UNWRAPPED)
def surfel_gradient(geometry, n, total, to):
    """Apply the chain rule through ``prepare`` for one surfel."""
    _, rotations, scales, opacities = geometry
    axes = rotation(rotations, n)
    over = (UNIT / scales[n, 0], UNIT / scales[n, 1], 1.0)
    for a in range(2):
        along = 0.0
        for k in range(3):
            along += total[4 * a + k] * axes[a][k]
        to.scales[n, a] = -along * over[a] / scales[n, a]
    for k in range(3):
        moved = 0.0
        for a in range(3):
            moved += total[4 * a + 3] * over[a] * axes[a][k]
        to.centres[n, k] = -moved
    to.opacities[n] = total[12] * LOG2_E / opacities[n] if opacities[n] > 0 else 0.0
    turn_gradient(rotations, n, over, total, to.rotations)


@njit(**UNWRAPPED)
def turn_gradient(rotations, n, over, total, to_rotations):
    """Return the gradient of a quaternion, from the pulls on the columns of its matrix; tangent to the
    sphere of rotations.
    """
    q = rotations[n]
    norm = sqrt(q[0] ** 2 + q[1] ** 2 + q[2] ** 2 + q[3] ** 2)
    w, x, y, z = q[0] / norm, q[1] / norm, q[2] / norm, q[3] / norm
    g = np.empty((3, 3))  # row: of the world, column: of the disc
    for a in range(3):
        for k in range(3):
            g[k, a] = total[4 * a + k] * over[a]
    to = to_rotations[n]
    to[0] = 2 * (x * (g[2, 1] - g[1, 2]) + y * (g[0, 2] - g[2, 0]) + z * (g[1, 0] - g[0, 1]))
    to[1] = 2 * (w * (g[2, 1] - g[1, 2]) + y * (g[1, 0] + g[0, 1]) + z * (g[2, 0] + g[0, 2]))
    to[1] -= 4 * x * (g[1, 1] + g[2, 2])
    to[2] = 2 * (w * (g[0, 2] - g[2, 0]) + x * (g[1, 0] + g[0, 1]) + z * (g[2, 1] + g[1, 2]))
    to[2] -= 4 * y * (g[0, 0] + g[2, 2])
    to[3] = 2 * (w * (g[1, 0] - g[0, 1]) + x * (g[2, 0] + g[0, 2]) + y * (g[2, 1] + g[1, 2]))
    to[3] -= 4 * z * (g[0, 0] + g[1, 1])
    radial = to[0] * w + to[1] * x + to[2] * y + to[3] * z
    to[0], to[1] = (to[0] - radial * w) / norm, (to[1] - radial * x) / norm
    to[2], to[3] = (to[2] - radial * y) / norm, (to[3] - radial * z) / norm


@njit(**UNWRAPPED)
def gather_features_part(part, parts, order, sums, stride, first, to_features):
    """Gradients of the features from the parts: ``first`` is the float of a place where they begin."""
    start, stop = share(part, parts, order.size)
    for place in range(start, stop):
        n = order[place]
        if n >= 0:
            for channel in range(to_features.shape[1]):
                total = 0.0
                for copy in range(sums.shape[0]):
                    total += sums[copy, place * stride + first + channel]
                to_features[n, channel] = total


@njit(cache=True)
def gather_features(*given):
    """Find the gradients of features; arguments are those of ``gather_features_part`` after its parts."""
    run(task(gather_features_part, given))
