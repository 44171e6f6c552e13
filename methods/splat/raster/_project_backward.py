# SPDX-License-Identifier: Apache-2.0
"""From the slots of the pairs back to surfels: the kernel that goes over surfels, backward.

The derivatives are those of ``_project_forward``, by hand; ``to_x`` is the derivative of the loss by x.
"""

import numpy as np

from graycard.methods._numba import njit
from graycard.methods.splat.raster._backward import FIRST_CHANNEL, LANES, PLAIN
from graycard.methods.splat.raster._channels_backward import first_normal
from graycard.methods.splat.raster._coefficients import D, U, V
from graycard.methods.splat.raster._project_forward import HALF_ROOT
from graycard.methods.splat.raster._project_frame import (
    EIGHT,
    NUMBERS,
    added,
    anchor_of,
    box_centre,
    dot,
    gather,
    pair,
    scaled,
    seen,
    triple,
    turned,
    turned_back,
    write,
)
from graycard.methods.splat.simd import _doubles as doubles
from graycard.methods.splat.simd import _vector as simd
from graycard.methods.splat.simd._parts import BORROWING, INLINED, UNWRAPPED, run, share, task

TO_LOG, TO_LOW = 9, 10
"""Columns of a slot after the linear forms."""
TO_HEIGHT, TO_CENTRE_Z = len(PLAIN), len(PLAIN) + 1
ZERO = (0.0, 0.0, 0.0)
FACING, PULLS = LANES, LANES + 3
"""Place of the normal's gradient, in vectors, after the columns of a slot; and how many vectors there are."""
CENTRE, TURN, SIZES, BOX, MADE = 0, 3, 7, 9, 11
"""Places of the gradients that are made of them: centre, quaternion, scales, and the centre of
the box; and how many."""


@njit(**INLINED, **BORROWING)
def sum_slots(slots, first, past, width, at, total, place):
    """Sum one vector of each of a surfel's slots, in their order; write it from a place on."""
    running = simd.broadcast(0.0)
    for slot in range(first, past):
        running = running + simd.load(slots, slot * width + at)
    simd.store(total, place, running)


@njit(**INLINED, **BORROWING)
def form_gradient(pulls, column, factor, to_rays, anchor):
    """From the gradient of a linear form on pixels to that on rays."""
    x, y, constant = scaled(factor, triple(pulls, column))
    return turned(to_rays, (x + constant * anchor[0], y + constant * anchor[1], constant))


@njit(**INLINED, **BORROWING)
def axis_gradient(to_form, axis, away, height, centre, scale):
    """Return the gradient of one numerator, ``(height * axis - (axis . centre) * away) * HALF_ROOT / scale``.

    Returns:
        The derivatives by axis, away, height, centre and scale.
    """
    factor, along = HALF_ROOT / scale, dot(axis, centre)
    to_along = -factor * dot(away, to_form)
    to_height = factor * dot(axis, to_form)
    to_axis = added(scaled(factor * height, to_form), to_along, centre)
    to_scale = -(height * to_height + along * to_along) / scale
    return to_axis, scaled(-factor * along, to_form), to_height, scaled(to_along, axis), to_scale


@njit(**INLINED, **BORROWING)
def column_gradient(sign, column, K, to_middle, to_norm):
    """Return the gradient of a column a of (u, v, centre), from those of ``sum f m d`` and ``sum f d d``,
    see ``rim``.
    """
    x, y, _z = turned(K, column)
    depth = sign * (x * to_middle[0] + y * to_middle[1] + 2 * column[2] * to_norm)
    to_image = sign * column[2]
    return (
        to_image * (K[0, 0] * to_middle[0] + K[1, 0] * to_middle[1]),
        to_image * (K[0, 1] * to_middle[0] + K[1, 1] * to_middle[1]),
        to_image * (K[0, 2] * to_middle[0] + K[1, 2] * to_middle[1]) + depth,
    )


@njit(**INLINED, **BORROWING)
def box_gradient(to_box, box, boxed, K, u, v, centre):
    """Return the gradient of the columns u, v and centre, from that of the box's centre."""
    over = 1 / (boxed * (u[2] * u[2] + v[2] * v[2]) - centre[2] * centre[2])
    to_middle = to_box[0] * over, to_box[1] * over
    to_norm = -(to_middle[0] * box[0] + to_middle[1] * box[1])
    return (
        column_gradient(boxed, u, K, to_middle, to_norm),
        column_gradient(boxed, v, K, to_middle, to_norm),
        column_gradient(-1.0, centre, K, to_middle, to_norm),
    )


@njit(**INLINED, **BORROWING)
def quaternion_gradient(quaternion, length, to_x, to_y, to_z):
    """From the gradients of the disc's axes in the world to that of the quaternion before it was scaled."""
    w, x, y, z = quaternion
    to_w = 2 * (z * to_x[1] - y * to_x[2] - z * to_y[0] + x * to_y[2] + y * to_z[0] - x * to_z[1])
    to_i = y * to_x[1] + z * to_x[2] + y * to_y[0] + w * to_y[2] + z * to_z[0] - w * to_z[1]
    to_j = x * to_x[1] - w * to_x[2] + x * to_y[0] + z * to_y[2] + w * to_z[0] + z * to_z[1]
    to_k = w * to_x[1] + x * to_x[2] - w * to_y[0] + y * to_y[2] + x * to_z[0] + y * to_z[1]
    to_i = 2 * (to_i - 2 * x * (to_y[1] + to_z[2]))
    to_j = 2 * (to_j - 2 * y * (to_x[0] + to_z[2]))
    to_k = 2 * (to_k - 2 * z * (to_x[0] + to_y[1]))
    radial = w * to_w + x * to_i + y * to_j + z * to_k
    over = 1 / length
    return (
        (to_w - radial * w) * over,
        (to_i - radial * x) * over,
        (to_j - radial * y) * over,
        (to_k - radial * z) * over,
    )


@njit(**INLINED, **BORROWING)
def unproject_eight(numbers, pulls, view, heights, made):
    """Write the gradients of eight surfels from the sums of their slots and those of their normals."""
    pose, K, to_rays, size = view.pose, view.K, view.to_rays, (view.width, view.height)
    discs = seen(numbers, pose)
    u, v, away, centre, sizes = discs.u, discs.v, discs.away, discs.centre, discs.sizes
    height = dot(away, centre)
    box_x, box_y, boxed = box_centre(K, discs.wide, discs.high, centre)
    box = box_x, box_y
    anchor = anchor_of(box, discs.moved, size)

    to_first = form_gradient(pulls, U, -2.0, to_rays, anchor)
    to_second = form_gradient(pulls, V, -2.0, to_rays, anchor)
    to_away = form_gradient(pulls, D, 2.0, to_rays, anchor)
    to_u, away_u, height_u, centre_u, to_size_u = axis_gradient(to_first, u, away, height, centre, sizes[0])
    to_v, away_v, height_v, centre_v, to_size_v = axis_gradient(to_second, v, away, height, centre, sizes[1])
    to_height = height_u + height_v
    to_centre = added(centre_u, 1.0, centre_v)
    if heights:
        to_height = to_height + doubles.load(pulls, TO_HEIGHT * EIGHT)
        to_centre = added(to_centre, doubles.load(pulls, TO_CENTRE_Z * EIGHT), (0.0, 0.0, 1.0))
    to_away = added(added(added(to_away, 1.0, away_u), 1.0, away_v), to_height, centre)
    to_centre = added(to_centre, to_height, away)

    to_low = pair(pulls, TO_LOW)
    to_box = 2.0 * to_low[0], 2.0 * to_low[1]
    to_wide, to_high, centre_box = box_gradient(to_box, box, boxed, K, discs.wide, discs.high, centre)
    to_u, to_v = added(to_u, sizes[0], to_wide), added(to_v, sizes[1], to_high)
    write(made, CENTRE, turned_back(pose, added(to_centre, 1.0, centre_box)))
    write(made, SIZES, (to_size_u + dot(u, to_wide), to_size_v + dot(v, to_high)))
    write(made, BOX, to_box)
    to_z = added(scaled(discs.sign, turned_back(pose, to_away)), -discs.sign, triple(pulls, FACING))
    to_x, to_y = turned_back(pose, to_u), turned_back(pose, to_v)
    write(made, TURN, quaternion_gradient(discs.quaternion, discs.length, to_x, to_y, to_z))


@njit(error_model="numpy", **INLINED, **BORROWING)
def scatter(made, lane, surfel, discs, rows, totals, to):
    """Write the gradients of one surfel, the sum of whose slots is in ``totals``."""
    place = lane * LANES
    for axis in range(3):
        to.centres[surfel, axis] = made[(CENTRE + axis) * EIGHT + lane]
    for part in range(4):
        to.rotations[surfel, part] = made[(TURN + part) * EIGHT + lane]
    to.opacities[surfel] = np.float64(totals[place + TO_LOG]) / np.float64(discs.opacities[surfel])
    for axis in range(2):
        to.scales[surfel, axis] = made[(SIZES + axis) * EIGHT + lane]
        by_numerators = rows[surfel, U + axis] * totals[place + U + 2]
        by_numerators += rows[surfel, V + axis] * totals[place + V + 2]
        by_forms = 2.0 * (by_numerators - rows[surfel, D + axis] * totals[place + D + 2])
        to.offsets[surfel, axis] = made[(BOX + axis) * EIGHT + lane] + by_forms


@njit(**INLINED, **BORROWING)
def clear_row(values, row):
    """Zero one row."""
    for column in range(values.shape[1]):
        values[row, column] = 0


@njit(**INLINED, **BORROWING)
def clear(surfel, to):
    """No gradients for a surfel."""
    to.opacities[surfel] = 0
    clear_row(to.centres, surfel)
    clear_row(to.rotations, surfel)
    clear_row(to.scales, surfel)
    clear_row(to.features, surfel)
    clear_row(to.offsets, surfel)


@njit(**INLINED, **BORROWING)
def unpack_channels(surfel, slots, first, past, stride, channels, spare, to_features):
    """Sum the channels that have slots of their own; returns the gradient of the normal."""
    x, y, z = 0.0, 0.0, 0.0
    normal = first_normal(channels)
    for at in range(0, stride, LANES):
        sum_slots(slots, first, past, stride, at, spare, 0)
        for lane in range(LANES):
            channel = at + lane
            if channel < channels:
                to_features[surfel, channel] = spare[lane]
            elif channel == normal:
                x = np.float64(spare[lane])
            elif channel == normal + 1:
                y = np.float64(spare[lane])
            elif channel == normal + 2:
                z = np.float64(spare[lane])
    return x, y, z


@njit(**INLINED, **BORROWING)
def sum_surfel(surfel, lane, found, to_channels, stride, totals, spare, pulls, to):
    """Sum the slots of one surfel: write its channels, and the rest to a lane of ``pulls``."""
    first, past, channels = found.slots[surfel], found.slots[surfel + 1], to.features.shape[1]
    to_normal, place = ZERO, lane * LANES
    if to_channels is not None:
        to_normal = unpack_channels(surfel, to_channels, first, past, stride, channels, spare, to.features)
    sum_slots(found.to_geometry, first, past, LANES, 0, totals, place)
    if to_channels is None:
        for channel in range(channels):
            to.features[surfel, channel] = totals[place + FIRST_CHANNEL + channel]
    for column in range(LANES):
        pulls[column * EIGHT + lane] = totals[place + column]
    for axis in range(3):
        pulls[(FACING + axis) * EIGHT + lane] = to_normal[axis]


@njit(**UNWRAPPED, **BORROWING)
def unproject_range(begin, end, discs, view, found, to_channels, stride, heights, room, to):
    """Gradients of some surfels, eight at a time; the rest is given as to ``unproject_part``."""
    numbers, pulls, made, totals, spare = room
    for first in range(begin, end, EIGHT):
        past = min(first + EIGHT, end)
        if found.slots[first] < found.slots[past]:
            for surfel in range(first, past):
                lane = surfel - first
                sum_surfel(surfel, lane, found, to_channels, stride, totals, spare, pulls, to)
            gather(discs, first, end, numbers)
            unproject_eight(numbers, pulls, view, heights, made)
        for surfel in range(first, past):
            if found.slots[surfel] < found.slots[surfel + 1]:
                scatter(made, surfel - first, surfel, discs, found.rows, totals, to)
            else:
                clear(surfel, to)


@njit(**UNWRAPPED)
def unproject_part(part, parts, discs, view, found, to_channels, stride, heights, to):
    """Gradients of the surfels; the first arguments are those of ``project``.

    Args:
        part: which of the
        parts: that work at a time.
        discs: as there.
        view: as there.
        found: a ``Found``.
        to_channels: what ``backward`` wrote; or None.
        stride: as there.
        heights: whether there are depths and normals.
        to: ``Gradients``, to be written.
    """
    begin, end = share(part, parts, len(discs.centres))
    room = (
        np.empty(NUMBERS * EIGHT),
        np.zeros(PULLS * EIGHT),
        np.empty(MADE * EIGHT),
        np.empty(LANES * EIGHT, np.float32),
        np.empty(LANES, np.float32),
    )
    unproject_range(begin, end, discs, view, found, to_channels, stride, heights, room, to)


@njit(cache=True)
def unproject(*given):
    """Find the gradients of all surfels; the arguments are those of ``unproject_part`` after its parts."""
    run(task(unproject_part, given))
