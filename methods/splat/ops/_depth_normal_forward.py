# SPDX-License-Identifier: Apache-2.0
"""The forward kernels of normals from depth, and of how far a normal is from them.

With the ray ``(x, y, 1)`` of a pixel, the points to its left and right at depths l and r differ by ``(r - l)
(x, y, 1) + (r + l) e``, e being the step from ray to ray; likewise above and below. The cross product of both
is along ``(p, q, -1 - x p - y q)``, where p is ``(r - l) / (r + l)`` over the length of e, and q likewise but
for the skew. Depths are only subtracted from their neighbours: no digits are lost, float32 is enough.
"""

from math import inf, sqrt

from graycard.methods._numba import njit
from graycard.methods.splat.simd._parts import INLINED, UNWRAPPED, run, share, task


@njit(error_model="numpy", **INLINED)
def is_surface(z):
    """Return whether there is a point at this depth; NaN passes, so that it shows in the result."""
    return not ((z <= 0) | (z == inf))


@njit(error_model="numpy", **INLINED)
def meet(left, right, above, below, x, y, lens):
    """Return the normal at a pixel.

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


@njit(**INLINED)
def turned(matrix, x, y, z):
    """Matrix times vector."""
    return (
        matrix[0, 0] * x + matrix[0, 1] * y + matrix[0, 2] * z,
        matrix[1, 0] * x + matrix[1, 1] * y + matrix[1, 2] * z,
        matrix[2, 0] * x + matrix[2, 1] * y + matrix[2, 2] * z,
    )


@njit(**INLINED)
def unit_normal(depth, row, column, frame):
    """Return the unit normal in the world at a pixel inside the border, zero where there is none."""
    x, y, z, over, _there = meet(
        depth[row, column - 1], depth[row, column + 1], depth[row - 1, column], depth[row + 1, column],
        frame.rays[0, column] + frame.rays[1, row], frame.rays[2, row], frame.lens,
    )  # fmt: skip
    return turned(frame.to_world, x * over, y * over, z * over)


@njit(error_model="numpy", **UNWRAPPED)
def normal_rows(part, parts, depth, frame, normals):
    """Write unit normals of the surface through the points at given depths.

    Args:
        part: which of the
        parts: that work at a time.
        depth: ``(H, W)``, metres; all arrays are of its dtype.
        frame: a ``Frame``.
        normals: ``(H, W, 3)``, zero, to be written inside the border.
    """
    height, width = depth.shape
    start, stop = share(part, parts, height - 2)
    for row in range(1 + start, 1 + stop):
        for column in range(1, width - 1):
            x, y, z = unit_normal(depth, row, column, frame)
            normals[row, column, 0] = x
            normals[row, column, 1] = y
            normals[row, column, 2] = z


@njit(cache=True)
def normals_forward(*given):
    """Find the normals; the arguments are those of ``normal_rows`` after its parts."""
    run(task(normal_rows, given))


@njit(error_model="numpy", **UNWRAPPED)
def mismatch_rows(part, parts, depth, frame, normal, alpha, values):
    """``1 - alpha * n . normal`` at each pixel, n being that of ``normal_rows``.

    Args:
        part: which of the
        parts: that work at a time.
        depth: as there.
        frame: as there.
        normal: ``(H, W, 3)``.
        alpha: ``(H, W)``.
        values: ``(H, W)``, one, to be written inside the border.
    """
    height, width = depth.shape
    start, stop = share(part, parts, height - 2)
    for row in range(1 + start, 1 + stop):
        for column in range(1, width - 1):
            x, y, z = unit_normal(depth, row, column, frame)
            given = normal[row, column]
            together = x * given[0] + y * given[1] + z * given[2]
            values[row, column] = frame.lens[3] - alpha[row, column] * together


@njit(cache=True)
def mismatch_forward(*given):
    """Compare normals with the depth's; the arguments are those of ``mismatch_rows`` after its parts."""
    run(task(mismatch_rows, given))
