# SPDX-License-Identifier: Apache-2.0
"""From surfels to what the pixels need of them: the kernel that goes over surfels, forward."""

from math import log, sqrt

import numpy as np

from graycard.methods._numba import njit
from graycard.methods.splat._maps import ALPHA_MIN, NEAR
from graycard.methods.splat.raster._coefficients import (
    CENTRE_Z,
    COLUMNS,
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
    EIGHT,
    NUMBERS,
    added,
    anchor_of,
    box_centre,
    dot,
    gather,
    on_image,
    rim,
    scaled,
    seen,
    write,
)
from graycard.methods.splat.simd import _doubles as doubles
from graycard.methods.splat.simd._parts import BORROWING, INLINED, UNWRAPPED, run, share, task

HALF_ROOT = sqrt(0.5)
LOG_ALPHA_MIN = log(ALPHA_MIN)
BOUNDS, FACING, MADE = COLUMNS, COLUMNS + 4, COLUMNS + 7
"""Places, in vectors, of what is made beside the columns: bounds and normals; and how many there are."""


@njit(**INLINED, **BORROWING)
def interval(middle, half, box, radius, size):
    """Pixels from and to (excluded) whose centres lie in either of two ranges.

    Whole numbers of the image, also where a range has no end.
    """
    low = doubles.minimum(middle - half, box - radius)
    high = doubles.maximum(middle + half, box + radius)
    first = doubles.ceil(doubles.minimum(doubles.maximum(low - 0.5 - MARGIN, 0.0), size))
    past = doubles.floor(doubles.minimum(doubles.maximum(high - 0.5 + MARGIN, -1.0), size - 1.0))
    return first, past + 1


@njit(**INLINED, **BORROWING)
def reach(square, K, u, v, centre, box, moved, size):
    """Pixels that the disc of ``square`` squared standard deviations, or its low-pass, may touch.

    Half the width of the rim's box is ``sqrt(middle^2 - sum f m m / sum f d d)``, see ``rim``.
    """
    x, y, xx, yy, norm = rim(square, K, u, v, centre)
    radius = doubles.square_root(square / 2)
    half_x = doubles.square_root(doubles.maximum(x * x - xx, 0.0))
    half_y = doubles.square_root(doubles.maximum(y * y - yy, 0.0))
    half_x = doubles.where_less(norm, 0.0, half_x, np.inf)
    half_y = doubles.where_less(norm, 0.0, half_y, np.inf)
    x, y = doubles.where_less(norm, 0.0, x, 0.0), doubles.where_less(norm, 0.0, y, 0.0)
    left, right = interval(x + moved[0], half_x, box[0] + moved[0], radius, size[0])
    top, bottom = interval(y + moved[1], half_y, box[1] + moved[1], radius, size[1])
    return left, right, top, bottom


@njit(**INLINED, **BORROWING)
def write_anchor(made, axis, value):
    """One coordinate of the anchor, in two parts."""
    whole = doubles.rounded_to_float32(doubles.floor(value + 0.5))
    write(made, WHOLE + axis, (whole,))
    write(made, REST + axis, (value - whole,))


@njit(**INLINED, **BORROWING)
def write_columns(made, discs, logarithm, anchor, to_rays):
    """Write the columns of ``_coefficients`` of eight surfels."""
    u, v, away, centre, scales = discs.u, discs.v, discs.away, discs.centre, discs.sizes
    height = dot(away, centre)
    first = scaled(HALF_ROOT / scales[0], added(scaled(height, u), -dot(u, centre), away))
    second = scaled(HALF_ROOT / scales[1], added(scaled(height, v), -dot(v, centre), away))
    write(made, U, on_image(first, to_rays, anchor))
    write(made, V, on_image(second, to_rays, anchor))
    write(made, D, on_image(away, to_rays, anchor))
    write(made, LOG_OPACITY, (logarithm * LOG2_E,))
    write(made, HEIGHT, (height / NEAR,))
    write(made, CENTRE_Z, (centre[2],))
    write_anchor(made, 0, anchor[0] + discs.moved[0])
    write_anchor(made, 1, anchor[1] + discs.moved[1])


@njit(**INLINED, **BORROWING)
def project_eight(numbers, logarithms, view, made):
    """Write the columns, bounds and world normals of eight surfels, and their z-depths."""
    size, discs = (view.width, view.height), seen(numbers, view.pose)
    logarithm = doubles.load(logarithms, 0)
    x, y, _boxed = box_centre(view.K, discs.wide, discs.high, discs.centre)
    square = doubles.maximum(2 * (logarithm - LOG_ALPHA_MIN), 0.0)
    write(
        made,
        BOUNDS,
        reach(square, view.K, discs.wide, discs.high, discs.centre, (x, y), discs.moved, size),
    )
    write_columns(made, discs, logarithm, anchor_of((x, y), discs.moved, size), view.to_rays)
    write(made, FACING, scaled(-discs.sign, discs.world[2]))


@njit(**INLINED, **BORROWING)
def scatter(made, lane, surfel, is_drawn, rows, bounds, normals):
    """Write what was made of one surfel if it is drawn and touches a pixel, else empty bounds."""
    left, right = np.int32(made[BOUNDS * EIGHT + lane]), np.int32(made[(BOUNDS + 1) * EIGHT + lane])
    top, bottom = np.int32(made[(BOUNDS + 2) * EIGHT + lane]), np.int32(made[(BOUNDS + 3) * EIGHT + lane])
    if not is_drawn or left >= right or top >= bottom:
        left, right, top, bottom = np.int32(0), np.int32(0), np.int32(0), np.int32(0)
    bounds[surfel, 0], bounds[surfel, 1] = left, right
    bounds[surfel, 2], bounds[surfel, 3] = top, bottom
    if left == right:
        return
    for column in range(COLUMNS):
        rows[surfel, column] = made[column * EIGHT + lane]
    for axis in range(3):
        normals[surfel, axis] = made[(FACING + axis) * EIGHT + lane]


@njit(**UNWRAPPED, **BORROWING)
def project_range(begin, end, discs, view, room, rows, bounds, depths, normals):
    """Prepare some surfels, eight at a time; the rest is given as to ``project_part``."""
    numbers, logarithms, made = room
    for first in range(begin, end, EIGHT):
        gather(discs, first, end, numbers)
        for lane in range(EIGHT):
            opacity = np.float64(discs.opacities[min(first + lane, end - 1)])
            logarithms[lane] = log(max(opacity, ALPHA_MIN))
        project_eight(numbers, logarithms, view, made)
        for surfel in range(first, min(first + EIGHT, end)):
            depths[surfel] = made[CENTRE_Z * EIGHT + surfel - first]
            is_drawn = depths[surfel] > NEAR and np.float64(discs.opacities[surfel]) >= ALPHA_MIN
            scatter(made, surfel - first, surfel, is_drawn, rows, bounds, normals)


@njit(**UNWRAPPED)
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
    room = np.empty(NUMBERS * EIGHT), np.empty(EIGHT), np.empty(MADE * EIGHT)
    project_range(begin, end, discs, view, room, rows, bounds, depths, normals)


@njit(cache=True)
def project(*given):
    """Prepare all surfels; the arguments are those of ``project_part`` after its parts."""
    run(task(project_part, given))
