# SPDX-License-Identifier: Apache-2.0
"""The backward kernels of normals from depth: each pixel gathers from its four neighbours."""

from math import sqrt

from numba import njit, prange

from graycard.methods.splat._depth_normal_forward import (
    cross,
    dot,
    has_normal,
    ray_at,
    step_between,
    turned,
)


@njit(forceinline=True)
def step_gradients(depth, to_rays, to_camera, row, column, upstream):
    """Gradients of the steps down and right by that of the unit normal in the world."""
    nothing = (0.0, 0.0, 0.0)
    if not has_normal(depth, row, column):
        return nothing, nothing
    down = step_between(depth, to_rays, row, column, 1, 0)
    right = step_between(depth, to_rays, row, column, 0, 1)
    normal = cross(down, right)
    length = sqrt(dot(normal, normal))
    if length == 0:
        return nothing, nothing
    given = turned(to_camera, (float(upstream[0]), float(upstream[1]), float(upstream[2])))
    along = dot(given, normal) / length**2
    across = (
        (given[0] - along * normal[0]) / length,
        (given[1] - along * normal[1]) / length,
        (given[2] - along * normal[2]) / length,
    )
    return cross(right, across), cross(across, down)


@njit(parallel=True, cache=True)
def normals_backward(depth, to_rays, to_camera, upstream, steps, to_depth):
    """Gradient of the depth.

    Args:
        depth: as in ``normals_forward``.
        to_rays: as there.
        to_camera: float64 ``(3, 3)``, rotation of the world.
        upstream: ``(H, W, 3)``, gradients of the normals.
        steps: float64 ``(H, W, 2, 3)``, room to work in: gradients of the steps down and right.
        to_depth: ``(H, W)``, to be written.
    """
    height, width = depth.shape
    for row in prange(height):
        for column in range(width):
            down, right = step_gradients(depth, to_rays, to_camera, row, column, upstream[row, column])
            for axis in range(3):
                steps[row, column, 0, axis] = down[axis]
                steps[row, column, 1, axis] = right[axis]
    for row in prange(height):
        for column in range(width):
            x, y = ray_at(to_rays, row, column)
            ray, total = (x, y, 1.0), 0.0
            if row > 0:
                total += dot(ray, steps[row - 1, column, 0])
            if row < height - 1:
                total -= dot(ray, steps[row + 1, column, 0])
            if column > 0:
                total += dot(ray, steps[row, column - 1, 1])
            if column < width - 1:
                total -= dot(ray, steps[row, column + 1, 1])
            to_depth[row, column] = total


@njit(parallel=True, cache=True)
def mismatch_backward(normals, normal, alpha, upstream, to_normals, to_normal):
    """Gradients of both normals in ``mismatch_forward``: ``(H, W, 3)``, to be written."""
    height, width = alpha.shape
    for row in prange(height):
        for column in range(width):
            weight = -upstream[row, column] * alpha[row, column]
            for axis in range(3):
                to_normals[row, column, axis] = weight * normal[row, column, axis]
                to_normal[row, column, axis] = weight * normals[row, column, axis]
