# SPDX-License-Identifier: Apache-2.0
"""The backward kernels of normals from depth: each pixel gathers from its four neighbours."""

from numba import njit, prange

from graycard.methods.splat.ops._depth_normal_forward import meet, turned, unit_normal


@njit(forceinline=True, error_model="numpy")
def pull(depth, row, column, rays, lens, to_camera, upstream, pulls):
    """What the gradient of the normal at a pixel makes of the ratios of depths across and down.

    Writes it over the square of the ratios' denominators, and twice: a depth is pulled by that much times the
    depth on the other side.
    """
    left, right = depth[row, column - 1], depth[row, column + 1]
    above, below = depth[row - 1, column], depth[row + 1, column]
    ray_x, ray_y = rays[0, column] + rays[1, row], rays[2, row]
    x, y, z, over, there = meet(left, right, above, below, ray_x, ray_y, lens)
    to_x, to_y, to_z = turned(to_camera, upstream[0], upstream[1], upstream[2])
    along = (to_x * x + to_y * y + to_z * z) * over * over
    to_x, to_y, to_z = (to_x - along * x) * over, (to_y - along * y) * over, (to_z - along * z) * over
    to_q = to_y - ray_y * to_z
    to_p = to_x - ray_x * to_z - lens[2] * to_q
    across, down, nothing = right + left, below + above, x - x
    pulls[0, row, column] = (lens[3] + lens[3]) * lens[0] * to_p / (across * across) if there else nothing
    pulls[1, row, column] = (lens[3] + lens[3]) * lens[1] * to_q / (down * down) if there else nothing


@njit(forceinline=True)
def times_opposite(pulled, opposite):
    """A pull times the depth on the other side, which may be anything where nothing pulls."""
    return pulled * opposite if pulled != 0 else pulled


@njit(forceinline=True)
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


@njit(parallel=True, cache=True, error_model="numpy")
def normals_backward(depth, rays, lens, to_camera, upstream, pulls, to_depth):
    """Gradient of the depth.

    Args:
        depth: as in ``normals_forward``.
        rays: as there.
        lens: as there.
        to_camera: ``(3, 3)``, rotation of the world.
        upstream: ``(H, W, 3)``, gradients of the normals.
        pulls: ``(2, H, W)``, zero, to work in.
        to_depth: ``(H, W)``, to be written.
    """
    height, width = depth.shape
    for row in prange(1, height - 1):
        for column in range(1, width - 1):
            pull(depth, row, column, rays, lens, to_camera, upstream[row, column], pulls)
    for row in prange(height):
        for column in range(width):
            to_depth[row, column] = gathered(depth, pulls, row, column)


@njit(parallel=True, cache=True, error_model="numpy")
def mismatch_backward(
    depth, rays, lens, to_world, to_camera, normal, alpha, upstream, pulls, to_depth, to_normal
):
    """Gradients of depth and normal.

    Args:
        depth: as in ``mismatch_forward``.
        rays: as there.
        lens: as there.
        to_world: as there.
        to_camera: its inverse.
        normal: as there.
        alpha: as there.
        upstream: ``(H, W)``, gradients of the values.
        pulls: ``(2, H, W)``, zero, to work in.
        to_depth: ``(H, W)``, to be written.
        to_normal: ``(H, W, 3)``, zero, to be written inside the border.
    """
    height, width = depth.shape
    for row in prange(1, height - 1):
        for column in range(1, width - 1):
            x, y, z = unit_normal(depth, row, column, rays, lens, to_world)
            weight, given = -upstream[row, column] * alpha[row, column], normal[row, column]
            to_unit = weight * given[0], weight * given[1], weight * given[2]
            pull(depth, row, column, rays, lens, to_camera, to_unit, pulls)
            to_normal[row, column, 0] = weight * x
            to_normal[row, column, 1] = weight * y
            to_normal[row, column, 2] = weight * z
    for row in prange(height):
        for column in range(width):
            to_depth[row, column] = gathered(depth, pulls, row, column)
