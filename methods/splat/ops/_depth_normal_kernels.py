# SPDX-License-Identifier: Apache-2.0
"""Consistency of normals: how far normals are from those of the depth, in float32 and sixteen pixels of a row
at a time.

The formulas are those of ``_depth_normal_forward`` and ``_depth_normal_backward``, whose loops stay scalar:
Numba cannot prove that so many images do not overlap. Images are flat here.
"""

import numpy as np

from graycard.methods._numba import njit
from graycard.methods.splat.ops._depth_normal_backward import gathered
from graycard.methods.splat.raster._blocks import NORMAL
from graycard.methods.splat.simd import _pixels as pixels
from graycard.methods.splat.simd import _vector as simd
from graycard.methods.splat.simd._parts import INLINED, UNWRAPPED, run, share, task

LANES = simd.LANES
LEAST_WIDTH = LANES + 4
"""Border of an image: two columns on each side are not like the others."""


@njit(**INLINED)
def starts(column, width, border):
    """Return where a vector begins that would begin at a column, but for the last, which ends with the
    border.
    """
    return min(column, width - border - LANES)


@njit(**INLINED)
def where_surface(z, values):
    """Values where there is a point at this depth, zero elsewhere; NaN passes."""
    zero = simd.broadcast(0.0)
    return simd.where_at_least(z, simd.broadcast(np.inf), zero, simd.where_at_least(zero, z, zero, values))


@njit(**INLINED)
def meet_line(depth, at, width, x, y, lens):
    """Return, as ``meet``: the normal's p, q and z, one over its length, and the sums of depths across and
    down.

    Where one of the four neighbours is no point, p, q and one over the length are zero.
    """
    left, right = simd.load(depth, at - 1), simd.load(depth, at + 1)
    above, below = simd.load(depth, at - width), simd.load(depth, at + width)
    one = simd.broadcast(1.0)
    there = where_surface(left, where_surface(right, where_surface(above, where_surface(below, one))))
    across, down = right + left, below + above
    p = (right - left) / across * simd.broadcast(lens[0])
    q = simd.fnma(p, simd.broadcast(lens[2]), (below - above) / down * simd.broadcast(lens[1]))
    p, q = where_there(there, p), where_there(there, q)
    z = simd.fnma(x, p, simd.fnma(y, q, simd.broadcast(-1.0)))
    over = one / simd.square_root(simd.fma(p, p, simd.fma(q, q, z * z)))
    return p, q, z, where_there(there, over), across, down, there


@njit(**INLINED)
def where_there(there, values):
    """Values where all four neighbours are points, zero elsewhere; NaN where one of them is NaN."""
    zero = simd.broadcast(0.0)
    return simd.where_at_least(zero, there, zero, values)


@njit(**INLINED)
def turned_line(matrix, x, y, z):
    """Matrix, flat, times vectors."""
    rows = matrix
    return (
        simd.fma(
            simd.load_scalar(rows, 0),
            x,
            simd.fma(simd.load_scalar(rows, 1), y, simd.load_scalar(rows, 2) * z),
        ),
        simd.fma(
            simd.load_scalar(rows, 3),
            x,
            simd.fma(simd.load_scalar(rows, 4), y, simd.load_scalar(rows, 5) * z),
        ),
        simd.fma(
            simd.load_scalar(rows, 6),
            x,
            simd.fma(simd.load_scalar(rows, 7), y, simd.load_scalar(rows, 8) * z),
        ),
    )


@njit(**INLINED)
def dot_line(a, b):
    """Return the dot products of triples of vectors."""
    return simd.fma(a[0], b[0], simd.fma(a[1], b[1], a[2] * b[2]))


@njit(**INLINED)
def scaled_line(factor, a):
    """Return a triple of vectors times a vector."""
    return factor * a[0], factor * a[1], factor * a[2]


@njit(**INLINED)
def ray_of(rays, row, column):
    """Slopes x and y of sixteen rays, see ``normals_forward``."""
    x = simd.load(rays[0], column) + simd.broadcast(rays[1, row])
    return x, simd.broadcast(rays[2, row])


@njit(**INLINED)
def set_border(row, height, width, channels, value, image):
    """Write a row's pixels on the border; returns whether there are others."""
    first, length = row * width * channels, width * channels
    if row == 0 or row == height - 1:
        image[first : first + length] = value
        return False
    image[first : first + channels] = value
    image[first + length - channels : first + length] = value
    return True


@njit(**UNWRAPPED)
def compare_rows(part, parts, depth, width, frame, normal, alpha, values):
    """Do the same as ``mismatch_forward``; ``width`` of at least ``LEAST_WIDTH``, all of ``values`` is
    written.
    """
    height = depth.size // width
    start, stop = share(part, parts, height)
    for row in range(start, stop):
        if not set_border(row, height, width, 1, 1, values):
            continue
        for column in range(1, width - 1, LANES):
            column = starts(column, width, 1)
            at = row * width + column
            x, y = ray_of(frame.rays, row, column)
            p, q, z, over, _across, _down, _there = meet_line(depth, at, width, x, y, frame.lens)
            unit = turned_line(frame.to_world, p * over, q * over, z * over)
            together = dot_line(unit, pixels.load_line(normal, 3 * at, NORMAL))
            value = simd.fnma(simd.load(alpha, at), together, simd.broadcast(1.0))
            simd.store(values, at, value)


@njit(cache=True)
def mismatch_lines_forward(*given):
    """Compare normals with those of the depth; arguments are those of ``compare_rows`` after its parts."""
    run(task(compare_rows, given))


@njit(**INLINED)
def pull_line(depth, at, width, ray, frame, normal, weight):
    """Return the gradient, as ``pull``, of the unit normal times a normal and a weight.

    Returns:
        What pulls the ratios across and down, and the gradient of the normal.
    """
    x, y = ray
    p, q, z, over, across, down, there = meet_line(depth, at, width, x, y, frame.lens)
    unit = p * over, q * over, z * over
    asked = turned_line(frame.to_camera, *scaled_line(weight, normal))
    along = dot_line(asked, unit)
    to_x, to_y, to_z = scaled_line(
        over,
        (
            simd.fnma(along, unit[0], asked[0]),
            simd.fnma(along, unit[1], asked[1]),
            simd.fnma(along, unit[2], asked[2]),
        ),
    )
    to_q = simd.fnma(y, to_z, to_y)
    to_p = simd.fnma(simd.broadcast(frame.lens[2]), to_q, simd.fnma(x, to_z, to_x))
    to_across = simd.broadcast(2 * frame.lens[0]) * to_p / (across * across)
    to_down = simd.broadcast(2 * frame.lens[1]) * to_q / (down * down)
    to_normal = scaled_line(weight, turned_line(frame.to_world, *unit))
    return where_there(there, to_across), where_there(there, to_down), to_normal


@njit(**INLINED)
def times_opposite_line(pulls, at, depth, opposite):
    """Return a pull times the depth on the other side, which may be anything where nothing pulls."""
    pulled, zero = simd.load(pulls, at), simd.broadcast(0.0)
    product = pulled * simd.load(depth, opposite)
    return simd.where_less(zero, pulled, product, simd.where_less(pulled, zero, product, pulled))


@njit(**INLINED)
def gather_line(depth, width, across, down, at):
    """Return the same as ``gathered``, two pixels or more from the border."""
    total = times_opposite_line(across, at - 1, depth, at - 2)
    total = total - times_opposite_line(across, at + 1, depth, at + 2)
    total = total + times_opposite_line(down, at - width, depth, at - 2 * width)
    return total - times_opposite_line(down, at + width, depth, at + 2 * width)


@njit(**UNWRAPPED)
def pull_rows(part, parts, depth, width, frame, normal, alpha, upstream, pulls, to_normal):
    """Find what pulls the ratios of depths, and the gradient of the normal."""
    height, across, down = depth.size // width, pulls[0].reshape(-1), pulls[1].reshape(-1)
    start, stop = share(part, parts, height)
    for row in range(start, stop):
        set_border(row, height, width, 1, 0, across)
        set_border(row, height, width, 1, 0, down)
        if not set_border(row, height, width, 3, 0, to_normal):
            continue
        for column in range(1, width - 1, LANES):
            column = starts(column, width, 1)
            at = row * width + column
            weight = simd.fnma(simd.load(upstream, at), simd.load(alpha, at), simd.broadcast(0.0))
            to_across, to_down, made = pull_line(
                depth, at, width, ray_of(frame.rays, row, column), frame,
                pixels.load_line(normal, 3 * at, NORMAL), weight,
            )  # fmt: skip
            simd.store(across, at, to_across)
            simd.store(down, at, to_down)
            pixels.store_line(to_normal, 3 * at, made)


@njit(**UNWRAPPED)
def gather_rows(part, parts, depth, width, pulls, to_depth):
    """Find the gradient of the depth of each pixel from the pulls around it."""
    height, across, down = depth.size // width, pulls[0].reshape(-1), pulls[1].reshape(-1)
    image = depth.reshape(height, width)
    start, stop = share(part, parts, height)
    for row in range(start, stop):
        inside = 1 < row < height - 2
        for column in range(width):
            if not (inside and 1 < column < width - 2):
                to_depth[row * width + column] = gathered(image, pulls, row, column)
        if inside:
            for column in range(2, width - 2, LANES):
                at = row * width + starts(column, width, 2)
                simd.store(to_depth, at, gather_line(depth, width, across, down, at))


@njit(cache=True)
def mismatch_lines_backward(depth, width, frame, normal, alpha, upstream, pulls, to_depth, to_normal):
    """Do the same as ``mismatch_backward``; all of ``pulls``, ``(2, H, W)``, and of ``to_normal`` is
    written.
    """
    run(task(pull_rows, (depth, width, frame, normal, alpha, upstream, pulls, to_normal)))
    run(task(gather_rows, (depth, width, pulls, to_depth)))
