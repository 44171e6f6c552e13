# SPDX-License-Identifier: Apache-2.0
"""The forward kernels of normals from depth, and of how far a normal is from them.

With the ray ``(x, y, 1)`` of a pixel, the points to its left and right at depths l and r differ by ``(r - l)
(x, y, 1) + (r + l) e``, e being the step from ray to ray; likewise above and below. The cross product of both
is along ``(p, q, -1 - x p - y q)``, where p is ``(r - l) / (r + l)`` over the length of e, and q likewise but
for the skew. Depths are only subtracted from their neighbours: no digits are lost, float32 is enough.
"""

from math import inf, sqrt

from numba import njit, prange


@njit(forceinline=True, error_model="numpy")
def is_surface(z):
    """Whether there is a point at this depth; NaN passes, so that it shows in the result."""
    return not ((z <= 0) | (z == inf))


@njit(forceinline=True, error_model="numpy")
def meet(left, right, above, below, x, y, lens):
    """The normal at a pixel.

    Args:
        left: depth of this neighbour, and
        right: of this, and
        above: of this, and
        below: of this.
        x: of the ray, and
        y: of the ray.
        lens: steps of x by column, of y by row, of x by row over that; inverted the first two.

    Returns:
        Its x, y and z in the camera's frame times its length before it is scaled to one; one over that
        length; whether all four neighbours are points: else all is zero.
    """
    there = is_surface(left) & is_surface(right) & is_surface(above) & is_surface(below)
    nothing = x - x
    p = (right - left) / (right + left) * lens[0]
    q = (below - above) / (below + above) * lens[1] - p * lens[2]
    p, q = p if there else nothing, q if there else nothing
    z = -(x * p + y * q) - lens[3]
    over = lens[3] / sqrt(p * p + q * q + z * z)
    return p, q, z, over if there else nothing, there


@njit(forceinline=True)
def turned(matrix, x, y, z):
    """Matrix times vector."""
    return (
        matrix[0, 0] * x + matrix[0, 1] * y + matrix[0, 2] * z,
        matrix[1, 0] * x + matrix[1, 1] * y + matrix[1, 2] * z,
        matrix[2, 0] * x + matrix[2, 1] * y + matrix[2, 2] * z,
    )


@njit(forceinline=True)
def unit_normal(depth, row, column, rays, lens, to_world):
    """The unit normal in the world at a pixel inside the border, zero where there is none."""
    x, y, z, over, _there = meet(
        depth[row, column - 1], depth[row, column + 1], depth[row - 1, column], depth[row + 1, column],
        rays[0, column] + rays[1, row], rays[2, row], lens,
    )  # fmt: skip
    return turned(to_world, x * over, y * over, z * over)


@njit(parallel=True, cache=True, error_model="numpy")
def normals_forward(depth, rays, lens, to_world, normals):
    """Unit normals of the surface through the points at given depths.

    Args:
        depth: ``(H, W)``, metres; all arrays are of its dtype.
        rays: ``(3, max(H, W))``: x by column, what a row adds to it, y by row.
        lens: ``(4,)``, see ``meet``; the last is one.
        to_world: ``(3, 3)``, rotation of the camera.
        normals: ``(H, W, 3)``, zero, to be written inside the border.
    """
    height, width = depth.shape
    for row in prange(1, height - 1):
        for column in range(1, width - 1):
            x, y, z = unit_normal(depth, row, column, rays, lens, to_world)
            normals[row, column, 0] = x
            normals[row, column, 1] = y
            normals[row, column, 2] = z


@njit(parallel=True, cache=True, error_model="numpy")
def mismatch_forward(depth, rays, lens, to_world, normal, alpha, values):
    """``1 - alpha * n . normal`` at each pixel, n being that of ``normals_forward``.

    Args:
        depth: as there.
        rays: as there.
        lens: as there.
        to_world: as there.
        normal: ``(H, W, 3)``.
        alpha: ``(H, W)``.
        values: ``(H, W)``, one, to be written inside the border.
    """
    height, width = depth.shape
    for row in prange(1, height - 1):
        for column in range(1, width - 1):
            x, y, z = unit_normal(depth, row, column, rays, lens, to_world)
            given = normal[row, column]
            together = x * given[0] + y * given[1] + z * given[2]
            values[row, column] = lens[3] - alpha[row, column] * together
