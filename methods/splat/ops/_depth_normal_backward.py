# SPDX-License-Identifier: Apache-2.0
"""The backward kernels of normals from depth: each pixel gathers from its four neighbours."""

from graycard.methods._numba import njit
from graycard.methods.splat.ops._depth_normal_forward import meet, turned, unit_normal
from graycard.methods.splat.simd._parts import INLINED, UNWRAPPED, run, share, task


@njit(error_model="numpy", **INLINED)
def pull(depth, row, column, frame, upstream, pulls):
    """Return what the gradient of the normal at a pixel makes of the ratios of depths across and down.

    Writes it over the square of the ratios' denominators, and twice: a depth is pulled by that much times the
    depth on the other side.
    """
    rays, lens = frame.rays, frame.lens
    left, right = depth[row, column - 1], depth[row, column + 1]
    above, below = depth[row - 1, column], depth[row + 1, column]
    ray_x, ray_y = rays[0, column] + rays[1, row], rays[2, row]
    x, y, z, over, there = meet(left, right, above, below, ray_x, ray_y, lens)
    to_x, to_y, to_z = turned(frame.to_camera, upstream[0], upstream[1], upstream[2])
    along = (to_x * x + to_y * y + to_z * z) * over * over
    to_x, to_y, to_z = (to_x - along * x) * over, (to_y - along * y) * over, (to_z - along * z) * over
    to_q = to_y - ray_y * to_z
    to_p = to_x - ray_x * to_z - lens[2] * to_q
    across, down, nothing = right + left, below + above, x - x
    pulls[0, row, column] = (lens[3] + lens[3]) * lens[0] * to_p / (across * across) if there else nothing
    pulls[1, row, column] = (lens[3] + lens[3]) * lens[1] * to_q / (down * down) if there else nothing


@njit(**INLINED)
def times_opposite(pulled, opposite):
    """Return a pull times the depth on the other side, which may be anything where nothing pulls."""
    return pulled * opposite if pulled != 0 else pulled


@njit(**INLINED)
def gathered(depth, pulls, row, column):
    """Gradient of the depth of a pixel."""
    height, width = depth.shape
    total = pulls[0, 0, 0]  # on the border nothing pulls: zero in the dtype of the images
    if column > 1:
        total += times_opposite(pulls[0, row, column - 1], depth[row, column - 2])
    if column < width - 2:
        total -= times_opposite(pulls[0, row, column + 1], depth[row, column + 2])
    if row > 1:
        total += times_opposite(pulls[1, row - 1, column], depth[row - 2, column])
    if row < height - 2:
        total -= times_opposite(pulls[1, row + 1, column], depth[row + 2, column])
    return total


@njit(error_model="numpy", **UNWRAPPED)
def gather_rows(part, parts, depth, pulls, to_depth):
    """Find the gradient of the depth of each pixel from the pulls around it."""
    start, stop = share(part, parts, depth.shape[0])
    for row in range(start, stop):
        for column in range(depth.shape[1]):
            to_depth[row, column] = gathered(depth, pulls, row, column)


@njit(error_model="numpy", **UNWRAPPED)
def normal_pull_rows(part, parts, depth, frame, upstream, pulls):
    """Find what pulls the ratios of depths, from gradients of the normals."""
    start, stop = share(part, parts, depth.shape[0] - 2)
    for row in range(1 + start, 1 + stop):
        for column in range(1, depth.shape[1] - 1):
            pull(depth, row, column, frame, upstream[row, column], pulls)


@njit(cache=True)
def normals_backward(depth, frame, upstream, pulls, to_depth):
    """Find the gradient of the depth.

    Args:
        depth: as in ``normal_rows``.
        frame: as there.
        upstream: ``(H, W, 3)``, gradients of the normals.
        pulls: ``(2, H, W)``, zero, to work in.
        to_depth: ``(H, W)``, to be written.
    """
    run(task(normal_pull_rows, (depth, frame, upstream, pulls)))
    run(task(gather_rows, (depth, pulls, to_depth)))


@njit(error_model="numpy", **UNWRAPPED)
def mismatch_pull_rows(part, parts, depth, frame, normal, alpha, upstream, pulls, to_normal):
    """Find what pulls the ratios of depths, and the gradient of the normal."""
    start, stop = share(part, parts, depth.shape[0] - 2)
    for row in range(1 + start, 1 + stop):
        for column in range(1, depth.shape[1] - 1):
            x, y, z = unit_normal(depth, row, column, frame)
            weight, given = -upstream[row, column] * alpha[row, column], normal[row, column]
            to_unit = weight * given[0], weight * given[1], weight * given[2]
            pull(depth, row, column, frame, to_unit, pulls)
            to_normal[row, column, 0] = weight * x
            to_normal[row, column, 1] = weight * y
            to_normal[row, column, 2] = weight * z


@njit(cache=True)
def mismatch_backward(depth, frame, normal, alpha, upstream, pulls, to_depth, to_normal):
    """Find the gradients of depth and normal.

    Args:
        depth: as in ``mismatch_rows``.
        frame: as there.
        normal: as there.
        alpha: as there.
        upstream: ``(H, W)``, gradients of the values.
        pulls: ``(2, H, W)``, zero, to work in.
        to_depth: ``(H, W)``, to be written.
        to_normal: ``(H, W, 3)``, zero, to be written inside the border.
    """
    run(task(mismatch_pull_rows, (depth, frame, normal, alpha, upstream, pulls, to_normal)))
    run(task(gather_rows, (depth, pulls, to_depth)))
