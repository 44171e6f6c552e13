# SPDX-License-Identifier: Apache-2.0
"""From ellipsoids to what the pixels need of them: the kernel that goes over Gaussians.

In float64, one at a time: the picture of a needle that is seen along its axis loses digits otherwise.
"""

from math import ceil, floor, log, sqrt

import numpy as np

from graycard.methods._numba import njit
from graycard.methods.splat._maps import ALPHA_MIN, NEAR
from graycard.methods.splat.ewa._gaussians import BEYOND_VIEW, DILATION
from graycard.methods.splat.raster._coefficients import (
    BEYOND,
    CENTRE_Z,
    LOG2_E,
    LOG_OPACITY,
    MARGIN,
    REST,
    WHOLE,
    U,
    V,
)
from graycard.methods.splat.simd._parts import BORROWING, INLINED, UNWRAPPED, run, share, task

LOG_ALPHA_MIN = log(ALPHA_MIN)


@njit(**INLINED, **BORROWING)
def in_camera(pose, x, y, z):
    """Turn a vector of the world to the camera's axes."""
    return (
        pose[0, 0] * x + pose[0, 1] * y + pose[0, 2] * z,
        pose[1, 0] * x + pose[1, 1] * y + pose[1, 2] * z,
        pose[2, 0] * x + pose[2, 1] * y + pose[2, 2] * z,
    )


@njit(**INLINED, **BORROWING)
def own_axes(rotations, row):
    """Return the three axes of an ellipsoid in the world: the columns of its rotation matrix."""
    w, x = np.float64(rotations[row, 0]), np.float64(rotations[row, 1])
    y, z = np.float64(rotations[row, 2]), np.float64(rotations[row, 3])
    over = 1 / sqrt(w * w + x * x + y * y + z * z)
    w, x, y, z = w * over, x * over, y * over, z * over
    return (
        (1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)),
        (2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x)),
        (2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)),
    )


@njit(**INLINED, **BORROWING)
def kept_slope(slope, focal, middle, size):
    """Keep the slope of a ray near the field of view, see ``footprints`` of the reference."""
    more = BEYOND_VIEW * 0.5 * size / focal
    return min(max(slope, -middle / focal - more), (size - middle) / focal + more)


@njit(**INLINED, **BORROWING)
def on_image(view, axis, size, slope_x, slope_y, over_z):
    """Return the picture of one axis of an ellipsoid, in pixels."""
    x, y, z = in_camera(view.pose, axis[0], axis[1], axis[2])
    x, y = size * over_z * (x - slope_x * z), size * over_z * (y - slope_y * z)
    return view.K[0, 0] * x + view.K[0, 1] * y, view.K[1, 1] * y


@njit(**INLINED, **BORROWING)
def picture(solids, row, view, x, y, z):
    """Return the variances xx, yy and xy of the picture, dilated, and by what that shrinks its height.

    The area of the picture, before it is dilated, is a sum of squares: nothing cancels.
    """
    slope_x = kept_slope(x / z, view.K[0, 0], view.K[0, 2], view.width)
    slope_y = kept_slope(y / z, view.K[1, 1], view.K[1, 2], view.height)
    first, second, third = own_axes(solids.rotations, row)
    ax, ay = on_image(view, first, np.float64(solids.scales[row, 0]), slope_x, slope_y, 1 / z)
    bx, by = on_image(view, second, np.float64(solids.scales[row, 1]), slope_x, slope_y, 1 / z)
    cx, cy = on_image(view, third, np.float64(solids.scales[row, 2]), slope_x, slope_y, 1 / z)
    xx, yy = ax * ax + bx * bx + cx * cx + DILATION, ay * ay + by * by + cy * cy + DILATION
    xy = ax * ay + bx * by + cx * cy
    area = (ax * by - ay * bx) ** 2 + (ax * cy - ay * cx) ** 2 + (bx * cy - by * cx) ** 2
    dilated = area + DILATION * (xx + yy - DILATION)
    return xx, yy, xy, dilated, sqrt(area / dilated)


@njit(**INLINED, **BORROWING)
def write_bounds(bounds, row, column, middle, half, size):
    """Write pixels from and to (excluded) whose centres lie within half a width; tell if there are any."""
    first = ceil(min(max(middle - half - 0.5 - MARGIN, 0.0), size))
    past = floor(min(max(middle + half - 0.5 + MARGIN, -1.0), size - 1.0)) + 1
    bounds[row, column], bounds[row, column + 1] = np.int32(first), np.int32(past)
    return first < past


@njit(**INLINED, **BORROWING)
def write_anchor(rows, row, axis, value):
    """Write one coordinate of the anchor in two parts."""
    whole = np.float64(np.float32(floor(value + 0.5)))
    rows[row, WHOLE + axis], rows[row, REST + axis] = whole, value - whole


@njit(**UNWRAPPED, **BORROWING)
def project_one(solids, row, view, antialiased, rows, bounds, z):
    """Write the columns and bounds of a Gaussian in front of the camera; say whether it touches a pixel."""
    centre = solids.centres
    x, y, _z = in_camera(view.pose, centre[row, 0], centre[row, 1], centre[row, 2])
    x, y = x + view.pose[0, 3], y + view.pose[1, 3]
    xx, yy, xy, area, thinning = picture(solids, row, view, x, y, z)
    opacity = np.float64(solids.opacities[row]) * (thinning if antialiased else 1.0)
    if not opacity >= ALPHA_MIN:
        return False
    square = 2 * (log(opacity) - LOG_ALPHA_MIN)
    mx = (view.K[0, 0] * x + view.K[0, 1] * y) / z + view.K[0, 2]
    my = view.K[1, 1] * y / z + view.K[1, 2]
    across = write_bounds(bounds, row, 0, mx, sqrt(square * xx), view.width)
    down = write_bounds(bounds, row, 2, my, sqrt(square * yy), view.height)
    if not (across and down):
        return False
    anchor_x = min(max(mx, -BEYOND), view.width + BEYOND)
    anchor_y = min(max(my, -BEYOND), view.height + BEYOND)
    dx, dy = anchor_x - mx, anchor_y - my
    ux, vy = sqrt(yy / (2 * area)), sqrt(0.5 / yy)
    uy = -ux * xy / yy
    rows[row, U], rows[row, U + 1], rows[row, U + 2] = ux, uy, ux * dx + uy * dy
    rows[row, V], rows[row, V + 1], rows[row, V + 2] = 0.0, vy, vy * dy
    rows[row, LOG_OPACITY], rows[row, CENTRE_Z] = log(opacity) * LOG2_E, z
    write_anchor(rows, row, 0, anchor_x)
    write_anchor(rows, row, 1, anchor_y)
    return True


@njit(**UNWRAPPED)
def project_part(part, parts, solids, view, antialiased, rows, bounds, depths):
    """Prepare Gaussians for the pixels.

    Args:
        part: which of the
        parts: that work at a time.
        solids: N of them, a ``Discs`` with three scales each; offsets are not looked at.
        view: a ``View``.
        antialiased: whether opacities are lowered as the pictures are dilated.
        rows: float32 ``(N, COLUMNS)``, to be written where the bounds are not empty.
        bounds: int32 ``(N, 4)``, to be written, as in ``_project_forward``.
        depths: float64 ``(N,)``, to be written: of the centres.
    """
    begin, end = share(part, parts, len(solids.centres))
    pose = view.pose
    for row in range(begin, end):
        x, y, z = solids.centres[row, 0], solids.centres[row, 1], solids.centres[row, 2]
        depth = pose[2, 0] * x + pose[2, 1] * y + pose[2, 2] * z + pose[2, 3]
        depths[row] = depth
        seen = depth > NEAR and project_one(solids, row, view, antialiased, rows, bounds, depth)
        if not seen:
            bounds[row, 0], bounds[row, 1], bounds[row, 2], bounds[row, 3] = 0, 0, 0, 0


@njit(cache=True)
def project(*given):
    """Prepare all Gaussians; the arguments are those of ``project_part`` after its parts."""
    run(task(project_part, given))
