# SPDX-License-Identifier: Apache-2.0
"""From surfels to what the pixels need of them: the kernel that goes over surfels, forward."""

from math import ceil, floor, log, sqrt

import numpy as np

from graycard.methods._numba import njit
from graycard.methods.splat._maps import ALPHA_MIN, NEAR
from graycard.methods.splat.raster._coefficients import (
    CENTRE_Z,
    HEIGHT,
    LOG2_E,
    LOG_OPACITY,
    MARGIN,
    REST,
    WHOLE,
    D,
    U,
    V,
)
from graycard.methods.splat.raster._project_frame import (
    added,
    anchor_of,
    away_from,
    box_centre,
    centre_seen,
    disc_axes,
    dot,
    on_image,
    rim,
    scaled,
    turned,
    unit_quaternion,
)
from graycard.methods.splat.simd._parts import INLINED, UNWRAPPED, run, share, task

HALF_ROOT = sqrt(0.5)
LOG_ALPHA_MIN = log(ALPHA_MIN)


@njit(error_model="numpy", **INLINED)
def interval(middle, half, box, radius, size):
    """Pixels from and to (excluded) whose centres lie in either of two ranges.

    Clamped before they are rounded: to Numba a rounded number is an integer, and there is none for infinity.
    """
    low, high = min(middle - half, box - radius), max(middle + half, box + radius)
    first = ceil(min(max(low - 0.5 - MARGIN, 0.0), size))
    past = floor(min(max(high - 0.5 + MARGIN, -1.0), size - 1.0)) + 1
    return first, past


@njit(error_model="numpy", **INLINED)
def reach(square, K, u, v, centre, box, moved, size):
    """Pixels that the disc of ``square`` squared standard deviations, or its low-pass, may touch.

    Half the width of the rim's box is ``sqrt(middle^2 - sum f m m / sum f d d)``, see ``rim``.
    """
    x, y, xx, yy, norm = rim(square, K, u, v, centre)
    radius = sqrt(square / 2)
    half_x, half_y = np.inf, np.inf
    if norm < 0:
        half_x, half_y = sqrt(max(x * x - xx, 0.0)), sqrt(max(y * y - yy, 0.0))
    else:
        x, y = 0.0, 0.0
    left, right = interval(x + moved[0], half_x, box[0] + moved[0], radius, size[0])
    top, bottom = interval(y + moved[1], half_y, box[1] + moved[1], radius, size[1])
    return left, right, top, bottom


@njit(**INLINED)
def write_form(row, first, form):
    """Three numbers of a linear form."""
    row[first], row[first + 1], row[first + 2] = form


@njit(**INLINED)
def write_anchor(row, axis, value):
    """One coordinate of the anchor, in two parts."""
    row[WHOLE + axis] = np.float32(np.floor(value + 0.5))
    row[REST + axis] = np.float32(value - np.float64(row[WHOLE + axis]))


@njit(error_model="numpy", **INLINED)
def write_row(row, axes, centre, scales, logarithm, anchor, moved, to_rays):
    """The columns of ``_coefficients`` but for the depth of the centre."""
    u, v, away = axes
    height = dot(away, centre)
    first = scaled(HALF_ROOT / scales[0], added(scaled(height, u), -dot(u, centre), away))
    second = scaled(HALF_ROOT / scales[1], added(scaled(height, v), -dot(v, centre), away))
    write_form(row, U, on_image(first, to_rays, anchor))
    write_form(row, V, on_image(second, to_rays, anchor))
    write_form(row, D, on_image(away, to_rays, anchor))
    row[LOG_OPACITY] = logarithm * LOG2_E
    row[HEIGHT] = height / NEAR
    row[CENTRE_Z] = centre[2]
    write_anchor(row, 0, anchor[0] + moved[0])
    write_anchor(row, 1, anchor[1] + moved[1])


@njit(error_model="numpy", **INLINED)
def project_one(surfel, centre, discs, opacity, moved, view, row, normals):
    """Write the row and the world normal of a surfel in front of the camera; return its pixel bounds."""
    pose, K, to_rays, width, height = view
    size, scales = (width, height), discs.scales
    world = disc_axes(unit_quaternion(discs.rotations, surfel)[0])
    u, v, normal = turned(pose, world[0]), turned(pose, world[1]), turned(pose, world[2])
    sign = away_from(centre, normal)
    sizes = np.float64(scales[surfel, 0]), np.float64(scales[surfel, 1])
    wide, high = scaled(sizes[0], u), scaled(sizes[1], v)
    x, y, _boxed = box_centre(K, wide, high, centre)
    logarithm = log(opacity)
    square = max(2 * (logarithm - LOG_ALPHA_MIN), 0.0)
    bounds = reach(square, K, wide, high, centre, (x, y), moved, size)
    if bounds[0] < bounds[1] and bounds[2] < bounds[3]:
        anchor = anchor_of((x, y), moved, size)
        write_row(row, (u, v, scaled(sign, normal)), centre, sizes, logarithm, anchor, moved, to_rays)
        normals[surfel, 0], normals[surfel, 1], normals[surfel, 2] = scaled(-sign, world[2])
    return bounds


@njit(error_model="numpy", **UNWRAPPED)
def project_part(part, parts, discs, view, rows, bounds, depths, normals):
    """Prepare all surfels for the pixels.

    Args:
        part: which of the
        parts: that work at a time.
        discs: N of them, a ``Discs``.
        view: a ``View``.
        rows: float32 ``(N, COLUMNS)``, to be written where the bounds are not empty.
        bounds: int32 ``(N, 4)``, to be written: columns from, to, rows from, to; ends excluded; all zero
            for surfels that touch no pixel.
        depths: float64 ``(N,)``, to be written: of the centres.
        normals: float32 ``(N, 3)``, to be written as the rows are: in the world, facing the camera.
    """
    begin, end = share(part, parts, len(discs.centres))
    for surfel in range(begin, end):
        centre = centre_seen(discs.centres, surfel, view.pose)
        depths[surfel] = centre[2]
        opacity = np.float64(discs.opacities[surfel])
        left, right, top, bottom = 0, 0, 0, 0
        if centre[2] > NEAR and opacity >= ALPHA_MIN:
            moved = np.float64(discs.offsets[surfel, 0]), np.float64(discs.offsets[surfel, 1])
            left, right, top, bottom = project_one(
                surfel, centre, discs, opacity, moved, view, rows[surfel], normals
            )
        if left >= right or top >= bottom:
            left, right, top, bottom = 0, 0, 0, 0
        bounds[surfel, 0], bounds[surfel, 1] = left, right
        bounds[surfel, 2], bounds[surfel, 3] = top, bottom


@njit(cache=True)
def project(*given):
    """Prepare all surfels; the arguments are those of ``project_part`` after its parts."""
    run(task(project_part, given))
