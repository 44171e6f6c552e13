# SPDX-License-Identifier: Apache-2.0
"""The forward kernels of normals from depth, and of how far a normal is from them.

Differences of neighbouring points lose digits: they are taken in float64, whatever the images' dtype.
"""

from math import inf, sqrt

from numba import njit, prange


@njit(forceinline=True)
def is_surface(z):
    """Whether there is a point at this depth; NaN passes, so that it shows in the result."""
    return not (z <= 0 or z == inf)


@njit(forceinline=True)
def has_normal(depth, row, column):
    """Whether all four neighbours are in the image, and points."""
    height, width = depth.shape
    if not (0 < row < height - 1 and 0 < column < width - 1):
        return False
    across = is_surface(depth[row, column - 1]) and is_surface(depth[row, column + 1])
    return across and is_surface(depth[row - 1, column]) and is_surface(depth[row + 1, column])


@njit(forceinline=True)
def ray_at(to_rays, row, column):
    """Slopes x and y of the ray through a pixel's centre, whose z is one; no K has more than a triangle."""
    x, y = column + 0.5, row + 0.5
    return to_rays[0, 0] * x + to_rays[0, 1] * y + to_rays[0, 2], to_rays[1, 1] * y + to_rays[1, 2]


@njit(forceinline=True)
def cross(a, b):
    """Vector product."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@njit(forceinline=True)
def dot(a, b):
    """Scalar product."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@njit(forceinline=True)
def step_between(depth, to_rays, row, column, down, right):
    """From the point before to the point after a pixel, twice the central difference."""
    ahead, behind = float(depth[row + down, column + right]), float(depth[row - down, column - right])
    x_ahead, y_ahead = ray_at(to_rays, row + down, column + right)
    x_behind, y_behind = ray_at(to_rays, row - down, column - right)
    return x_ahead * ahead - x_behind * behind, y_ahead * ahead - y_behind * behind, ahead - behind


@njit(forceinline=True)
def turned(matrix, vector):
    """Matrix times vector."""
    x, y, z = vector
    return (
        matrix[0, 0] * x + matrix[0, 1] * y + matrix[0, 2] * z,
        matrix[1, 0] * x + matrix[1, 1] * y + matrix[1, 2] * z,
        matrix[2, 0] * x + matrix[2, 1] * y + matrix[2, 2] * z,
    )


@njit(parallel=True, cache=True)
def normals_forward(depth, to_rays, to_world, normals):
    """Unit normals of the surface through the points at given depths.

    Args:
        depth: ``(H, W)``, metres.
        to_rays: float64 ``(3, 3)``, inverse of K.
        to_world: float64 ``(3, 3)``, rotation of the camera.
        normals: ``(H, W, 3)``, to be written.
    """
    height, width = depth.shape
    for row in prange(height):
        for column in range(width):
            normals[row, column, :] = 0
            if has_normal(depth, row, column):
                down = step_between(depth, to_rays, row, column, 1, 0)
                right = step_between(depth, to_rays, row, column, 0, 1)
                normal = cross(down, right)
                length = sqrt(dot(normal, normal))
                if length != 0:
                    x, y, z = turned(to_world, normal)
                    normals[row, column, 0] = x / length
                    normals[row, column, 1] = y / length
                    normals[row, column, 2] = z / length


@njit(parallel=True, cache=True)
def mismatch_forward(normals, normal, alpha, values):
    """``1 - alpha * normals . normal`` at each pixel: ``(H, W, 3)`` twice, ``(H, W)``, to be written."""
    height, width = alpha.shape
    for row in prange(height):
        for column in range(width):
            together = dot(normals[row, column], normal[row, column])
            values[row, column] = 1 - alpha[row, column] * together
