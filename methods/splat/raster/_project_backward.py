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
    added,
    anchor_of,
    away_from,
    box_centre,
    centre_seen,
    disc_axes,
    dot,
    scaled,
    turned,
    turned_back,
    unit_quaternion,
)
from graycard.methods.splat.simd import _vector as simd
from graycard.methods.splat.simd._parts import INLINED, UNWRAPPED, run, share, task

TO_LOG, TO_LOW = 9, 10
"""Columns of a slot after the linear forms."""
TO_HEIGHT, TO_CENTRE_Z = len(PLAIN), len(PLAIN) + 1
ZERO = (0.0, 0.0, 0.0)


@njit(**INLINED)
def sum_slots(slots, first, past, width, at, total):
    """Sum one vector of each of a surfel's slots, in their order."""
    running = simd.broadcast(0.0)
    for slot in range(first, past):
        running = running + simd.load(slots, slot * width + at)
    simd.store(total, 0, running)


@njit(error_model="numpy", **INLINED)
def form_gradient(total, column, factor, to_rays, anchor):
    """From the gradient of a linear form on pixels to that on rays."""
    x, y = factor * np.float64(total[column]), factor * np.float64(total[column + 1])
    constant = factor * np.float64(total[column + 2])
    return turned(to_rays, (x + constant * anchor[0], y + constant * anchor[1], constant))


@njit(error_model="numpy", **INLINED)
def axis_gradient(to_form, axis, away, height, centre, scale):
    """Of one numerator, ``(height * axis - (axis . centre) * away) * HALF_ROOT / scale``.

    Returns:
        The derivatives by axis, away, height, centre and scale.
    """
    factor, along = HALF_ROOT / scale, dot(axis, centre)
    to_along = -factor * dot(away, to_form)
    to_height = factor * dot(axis, to_form)
    to_axis = added(scaled(factor * height, to_form), to_along, centre)
    to_scale = -(height * to_height + along * to_along) / scale
    return to_axis, scaled(-factor * along, to_form), to_height, scaled(to_along, axis), to_scale


@njit(error_model="numpy", **INLINED)
def column_gradient(sign, column, K, to_middle, to_norm):
    """Of a column a of (u, v, centre), from those of ``sum f m d`` and ``sum f d d``, see ``rim``."""
    x, y, _z = turned(K, column)
    depth = sign * (x * to_middle[0] + y * to_middle[1] + 2 * column[2] * to_norm)
    to_image = sign * column[2]
    return (
        to_image * (K[0, 0] * to_middle[0] + K[1, 0] * to_middle[1]),
        to_image * (K[0, 1] * to_middle[0] + K[1, 1] * to_middle[1]),
        to_image * (K[0, 2] * to_middle[0] + K[1, 2] * to_middle[1]) + depth,
    )


@njit(error_model="numpy", **INLINED)
def box_gradient(to_box, box, boxed, K, u, v, centre):
    """Of the columns u, v and centre, from that of the box's centre."""
    over = 1 / (boxed * (u[2] * u[2] + v[2] * v[2]) - centre[2] * centre[2])
    to_middle = to_box[0] * over, to_box[1] * over
    to_norm = -(to_middle[0] * box[0] + to_middle[1] * box[1])
    return (
        column_gradient(boxed, u, K, to_middle, to_norm),
        column_gradient(boxed, v, K, to_middle, to_norm),
        column_gradient(-1.0, centre, K, to_middle, to_norm),
    )


@njit(error_model="numpy", **INLINED)
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


@njit(error_model="numpy", **INLINED)
def unproject_one(surfel, discs, moved, view, row, total, heights, to_normal, to):
    """Write the gradients of one surfel from the sums of its slots."""
    pose, K, to_rays, image_width, image_height = view
    scales, size = discs.scales, (image_width, image_height)
    centre = centre_seen(discs.centres, surfel, pose)
    quaternion, length = unit_quaternion(discs.rotations, surfel)
    world = disc_axes(quaternion)
    u, v, normal = turned(pose, world[0]), turned(pose, world[1]), turned(pose, world[2])
    sign = away_from(centre, normal)
    away, sizes = scaled(sign, normal), (np.float64(scales[surfel, 0]), np.float64(scales[surfel, 1]))
    height = dot(away, centre)
    wide, high = scaled(sizes[0], u), scaled(sizes[1], v)
    box_x, box_y, boxed = box_centre(K, wide, high, centre)
    box = box_x, box_y
    anchor = anchor_of(box, moved, size)

    to_first = form_gradient(total, U, -2.0, to_rays, anchor)
    to_second = form_gradient(total, V, -2.0, to_rays, anchor)
    to_away = form_gradient(total, D, 2.0, to_rays, anchor)
    to_u, away_u, height_u, centre_u, to_size_u = axis_gradient(to_first, u, away, height, centre, sizes[0])
    to_v, away_v, height_v, centre_v, to_size_v = axis_gradient(to_second, v, away, height, centre, sizes[1])
    to_height = height_u + height_v
    to_centre = added(centre_u, 1.0, centre_v)
    if heights:
        to_height += np.float64(total[TO_HEIGHT])
        to_centre = added(to_centre, np.float64(total[TO_CENTRE_Z]), (0.0, 0.0, 1.0))
    to_away = added(added(added(to_away, 1.0, away_u), 1.0, away_v), to_height, centre)
    to_centre = added(to_centre, to_height, away)

    to_box = 2.0 * np.float64(total[TO_LOW]), 2.0 * np.float64(total[TO_LOW + 1])
    to_wide, to_high, centre_box = box_gradient(to_box, box, boxed, K, wide, high, centre)
    to_u, to_v = added(to_u, sizes[0], to_wide), added(to_v, sizes[1], to_high)
    to_centre = turned_back(pose, added(to_centre, 1.0, centre_box))
    to.centres[surfel, 0], to.centres[surfel, 1], to.centres[surfel, 2] = to_centre
    to.scales[surfel, 0] = to_size_u + dot(u, to_wide)
    to.scales[surfel, 1] = to_size_v + dot(v, to_high)
    to.opacities[surfel] = np.float64(total[TO_LOG]) / np.float64(discs.opacities[surfel])

    to_z = added(scaled(sign, turned_back(pose, to_away)), -sign, to_normal)
    to_world = turned_back(pose, to_u), turned_back(pose, to_v)
    to_quaternion = quaternion_gradient(quaternion, length, to_world[0], to_world[1], to_z)
    for part in range(4):
        to.rotations[surfel, part] = to_quaternion[part]
    for axis in range(2):
        by_numerators = row[U + axis] * total[U + 2] + row[V + axis] * total[V + 2]
        by_forms = 2.0 * (by_numerators - row[D + axis] * total[D + 2])
        to.offsets[surfel, axis] = to_box[axis] + by_forms


@njit(**INLINED)
def unpack_channels(surfel, slots, first, past, stride, channels, total, to_features):
    """Sum the channels that have slots of their own; returns the gradient of the normal."""
    x, y, z = 0.0, 0.0, 0.0
    normal = first_normal(channels)
    for at in range(0, stride, LANES):
        sum_slots(slots, first, past, stride, at, total)
        for lane in range(LANES):
            channel = at + lane
            if channel < channels:
                to_features[surfel, channel] = total[lane]
            elif channel == normal:
                x = np.float64(total[lane])
            elif channel == normal + 1:
                y = np.float64(total[lane])
            elif channel == normal + 2:
                z = np.float64(total[lane])
    return x, y, z


@njit(error_model="numpy", **UNWRAPPED)
def unproject_part(
    part, parts, discs, view, found, to_channels, stride, heights, to
):  # fmt: skip
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
    channels, rows, slots, to_geometry = to.features.shape[1], found.rows, found.slots, found.to_geometry
    begin, end = share(part, parts, len(discs.centres))
    for surfel in range(begin, end):
        first, past = slots[surfel], slots[surfel + 1]
        if first == past:
            to.centres[surfel], to.rotations[surfel], to.scales[surfel] = 0, 0, 0
            to.opacities[surfel], to.features[surfel] = 0, 0
            to.offsets[surfel] = 0
            continue
        total, to_normal = np.empty(LANES, np.float32), ZERO
        if to_channels is not None:
            to_normal = unpack_channels(
                surfel, to_channels, first, past, stride, channels, total, to.features
            )
        sum_slots(to_geometry, first, past, LANES, 0, total)
        if to_channels is None:
            for channel in range(channels):
                to.features[surfel, channel] = total[FIRST_CHANNEL + channel]
        moved = np.float64(discs.offsets[surfel, 0]), np.float64(discs.offsets[surfel, 1])
        unproject_one(surfel, discs, moved, view, rows[surfel], total, heights, to_normal, to)


@njit(cache=True)
def unproject(*given):
    """Find the gradients of all surfels; the arguments are those of ``unproject_part`` after its parts."""
    run(task(unproject_part, given))
