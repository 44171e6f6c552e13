# SPDX-License-Identifier: Apache-2.0
"""Eight surfels as a camera sees them, in vectors of float64 and triples of these.

The projection cancels digits where discs are seen edge-on; float32 would lose them.
"""

from typing import Any, NamedTuple

from graycard.methods._numba import njit
from graycard.methods.splat.raster._coefficients import BEYOND
from graycard.methods.splat.simd import _doubles as doubles
from graycard.methods.splat.simd._parts import BORROWING, INLINED

EIGHT = doubles.LANES
CENTRE, TURN, SCALE, MOVED, NUMBERS = 0, 3, 7, 9, 11
"""Places, in vectors, of what is read of eight surfels: centre, quaternion, scales, offsets; how many."""


class Seen(NamedTuple):
    """Eight discs in the camera's frame; all are vectors, or tuples of them."""

    centre: Any
    """Metres."""
    quaternion: Any
    """Return the vector scaled to unit length."""
    length: Any
    """It had this one before."""
    world: Any
    """The disc's three axes in the world."""
    u: Any
    """The first of them as the camera sees it; ``v`` is the second."""
    v: Any
    sign: Any
    """1 or -1: what turns the third axis away from the camera, along the ray to the centre."""
    away: Any
    """That axis, turned so."""
    sizes: Any
    """Standard deviations, metres."""
    wide: Any
    """The first axis, as long as the disc's standard deviation; ``high`` is the second."""
    high: Any
    moved: Any
    """Pixels."""


@njit(**INLINED, **BORROWING)
def gather(discs, first, past, numbers):
    """Write what is read of eight surfels as vectors; the last surfel stands for those after it."""
    centres, rotations, scales, _opacities, offsets = discs
    for lane in range(EIGHT):
        surfel = min(first + lane, past - 1)
        for axis in range(3):
            numbers[(CENTRE + axis) * EIGHT + lane] = centres[surfel, axis]
        for axis in range(4):
            numbers[(TURN + axis) * EIGHT + lane] = rotations[surfel, axis]
        for axis in range(2):
            numbers[(SCALE + axis) * EIGHT + lane] = scales[surfel, axis]
            numbers[(MOVED + axis) * EIGHT + lane] = offsets[surfel, axis]


@njit(**INLINED, **BORROWING)
def pair(numbers, place):
    """Two vectors."""
    return doubles.load(numbers, place * EIGHT), doubles.load(numbers, (place + 1) * EIGHT)


@njit(**INLINED, **BORROWING)
def triple(numbers, place):
    """Three vectors."""
    return *pair(numbers, place), doubles.load(numbers, (place + 2) * EIGHT)


@njit(**INLINED, **BORROWING)
def write(numbers, place, vectors):
    """Write vectors one after the other."""
    for index, vector in enumerate(vectors):
        doubles.store(numbers, (place + index) * EIGHT, vector)


@njit(**INLINED, **BORROWING)
def dot(a, b):
    """Return the dot product of two triples."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@njit(**INLINED, **BORROWING)
def scaled(factor, a):
    """Return a triple times a number."""
    return factor * a[0], factor * a[1], factor * a[2]


@njit(**INLINED, **BORROWING)
def added(a, factor, b):
    """Return ``a + factor * b``, triples a and b."""
    return a[0] + factor * b[0], a[1] + factor * b[1], a[2] + factor * b[2]


@njit(**INLINED, **BORROWING)
def turned(matrix, a):
    """Return the left 3 x 3 of a matrix times a triple."""
    return (
        matrix[0, 0] * a[0] + matrix[0, 1] * a[1] + matrix[0, 2] * a[2],
        matrix[1, 0] * a[0] + matrix[1, 1] * a[1] + matrix[1, 2] * a[2],
        matrix[2, 0] * a[0] + matrix[2, 1] * a[1] + matrix[2, 2] * a[2],
    )


@njit(**INLINED, **BORROWING)
def turned_back(matrix, a):
    """Return the transposed left 3 x 3 of a matrix times a triple."""
    return (
        matrix[0, 0] * a[0] + matrix[1, 0] * a[1] + matrix[2, 0] * a[2],
        matrix[0, 1] * a[0] + matrix[1, 1] * a[1] + matrix[2, 1] * a[2],
        matrix[0, 2] * a[0] + matrix[1, 2] * a[1] + matrix[2, 2] * a[2],
    )


@njit(**INLINED, **BORROWING)
def unit_quaternion(w, x, y, z):
    """Return the same of unit length, and the length that was there."""
    length = doubles.square_root(w * w + x * x + y * y + z * z)
    over = 1 / length
    return (w * over, x * over, y * over, z * over), length


@njit(**INLINED, **BORROWING)
def disc_axes(quaternion):
    """Return the disc's x, y and z axis in the world: the columns of the rotation matrix."""
    w, x, y, z = quaternion
    return (
        (1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)),
        (2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x)),
        (2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)),
    )


@njit(**INLINED, **BORROWING)
def seen(numbers, pose):
    """Return eight surfels as ``Seen``, from what ``gather`` wrote."""
    moved = pose[0, 3], pose[1, 3], pose[2, 3]
    centre = added(turned(pose, triple(numbers, CENTRE)), 1.0, moved)
    quaternion, length = unit_quaternion(*pair(numbers, TURN), *pair(numbers, TURN + 2))
    world = disc_axes(quaternion)
    u, v, normal = turned(pose, world[0]), turned(pose, world[1]), turned(pose, world[2])
    sign = doubles.where_less(0.0, dot(normal, centre), 1.0, -1.0)
    sizes = pair(numbers, SCALE)
    wide, high = scaled(sizes[0], u), scaled(sizes[1], v)
    away = scaled(sign, normal)
    return Seen(centre, quaternion, length, world, u, v, sign, away, sizes, wide, high, pair(numbers, MOVED))


@njit(**INLINED, **BORROWING)
def on_image(form, to_rays, anchor):
    """Return a linear form on rays as one on pixels: slopes, and the value at the anchor."""
    x, y, constant = turned_back(to_rays, form)
    return x, y, x * anchor[0] + y * anchor[1] + constant


@njit(**INLINED, **BORROWING)
def rim(square, K, u, v, centre):
    """Return the conic of the disc's rim, projected: the middle of its box, the middle over its norm, and the
    norm.

    With the image coordinates ``m = K a`` of the columns a of (u, v, centre), depths d and signs
    f = (r^2, r^2, -1), the middle is ``sum f m d / sum f d d``: the pole of the image's edge direction
    with respect to the dual conic (Huang et al. 2024, supplement). Where the norm, ``sum f d d``, is not
    negative the disc reaches the camera's plane and there is no box.
    """
    norm = square * (u[2] * u[2] + v[2] * v[2]) - centre[2] * centre[2]
    mu, mv, mc = turned(K, u), turned(K, v), turned(K, centre)
    x = square * (mu[0] * u[2] + mv[0] * v[2]) - mc[0] * centre[2]
    y = square * (mu[1] * u[2] + mv[1] * v[2]) - mc[1] * centre[2]
    xx = square * (mu[0] * mu[0] + mv[0] * mv[0]) - mc[0] * mc[0]
    yy = square * (mu[1] * mu[1] + mv[1] * mv[1]) - mc[1] * mc[1]
    over = 1 / norm
    return x * over, y * over, xx * over, yy * over, norm


@njit(**INLINED, **BORROWING)
def box_centre(K, u, v, centre):
    """Centre of the box of the disc of one standard deviation, projected, pixels; and whether it has one.

    Without a box the projected centre stands for it.
    """
    x, y, _xx, _yy, norm = rim(1.0, K, u, v, centre)
    plain_x, plain_y, _xx, _yy, _norm = rim(0.0, K, u, v, centre)
    return (
        doubles.where_less(norm, 0.0, x, plain_x),
        doubles.where_less(norm, 0.0, y, plain_y),
        doubles.where_less(norm, 0.0, 1.0, 0.0),
    )


@njit(**INLINED, **BORROWING)
def anchor_of(box, moved, size):
    """Return where the linear forms of a surfel begin, before its picture is moved, see ``_coefficients``."""
    x = doubles.minimum(doubles.maximum(box[0] + moved[0], -BEYOND), size[0] + BEYOND)
    y = doubles.minimum(doubles.maximum(box[1] + moved[1], -BEYOND), size[1] + BEYOND)
    return x - moved[0], y - moved[1]
