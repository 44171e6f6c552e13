# SPDX-License-Identifier: Apache-2.0
"""One surfel as a camera sees it, in scalars and triples of float64.

The projection cancels digits where discs are seen edge-on; float32 would lose them.
"""

from math import sqrt

import numpy as np

from graycard.methods._numba import njit
from graycard.methods.splat.raster._coefficients import BEYOND
from graycard.methods.splat.simd._parts import INLINED


@njit(error_model="numpy", **INLINED)
def dot(a, b):
    """Of two triples."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@njit(error_model="numpy", **INLINED)
def scaled(factor, a):
    """A triple times a number."""
    return factor * a[0], factor * a[1], factor * a[2]


@njit(error_model="numpy", **INLINED)
def added(a, factor, b):
    """``a + factor * b``, triples a and b."""
    return a[0] + factor * b[0], a[1] + factor * b[1], a[2] + factor * b[2]


@njit(error_model="numpy", **INLINED)
def turned(matrix, a):
    """The left 3 x 3 of a matrix times a triple."""
    return (
        matrix[0, 0] * a[0] + matrix[0, 1] * a[1] + matrix[0, 2] * a[2],
        matrix[1, 0] * a[0] + matrix[1, 1] * a[1] + matrix[1, 2] * a[2],
        matrix[2, 0] * a[0] + matrix[2, 1] * a[1] + matrix[2, 2] * a[2],
    )


@njit(error_model="numpy", **INLINED)
def turned_back(matrix, a):
    """The transposed left 3 x 3 of a matrix times a triple."""
    return (
        matrix[0, 0] * a[0] + matrix[1, 0] * a[1] + matrix[2, 0] * a[2],
        matrix[0, 1] * a[0] + matrix[1, 1] * a[1] + matrix[2, 1] * a[2],
        matrix[0, 2] * a[0] + matrix[1, 2] * a[1] + matrix[2, 2] * a[2],
    )


@njit(error_model="numpy", **INLINED)
def unit_quaternion(rotations, surfel):
    """``(w, x, y, z)`` of unit length, and the length that was there."""
    w, x = np.float64(rotations[surfel, 0]), np.float64(rotations[surfel, 1])
    y, z = np.float64(rotations[surfel, 2]), np.float64(rotations[surfel, 3])
    length = sqrt(w * w + x * x + y * y + z * z)
    over = 1 / length
    return (w * over, x * over, y * over, z * over), length


@njit(error_model="numpy", **INLINED)
def disc_axes(quaternion):
    """The disc's x, y and z axis in the world: the columns of the rotation matrix."""
    w, x, y, z = quaternion
    return (
        (1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)),
        (2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x)),
        (2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)),
    )


@njit(error_model="numpy", **INLINED)
def centre_seen(centres, surfel, pose):
    """The centre in the camera's frame, metres."""
    world = np.float64(centres[surfel, 0]), np.float64(centres[surfel, 1]), np.float64(centres[surfel, 2])
    return added(turned(pose, world), 1.0, (pose[0, 3], pose[1, 3], pose[2, 3]))


@njit(error_model="numpy", **INLINED)
def away_from(centre, normal):
    """1 or -1: what turns the disc's z axis away from the camera, along the ray to the centre."""
    return 1.0 if dot(normal, centre) > 0 else -1.0


@njit(error_model="numpy", **INLINED)
def on_image(form, to_rays, anchor):
    """A linear form on rays as one on pixels: slopes, and the value at the anchor."""
    x, y, constant = turned_back(to_rays, form)
    return x, y, x * anchor[0] + y * anchor[1] + constant


@njit(error_model="numpy", **INLINED)
def rim(square, K, u, v, centre):
    """The conic of the disc's rim, projected: the middle of its box, the middle over its norm, and the norm.

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


@njit(error_model="numpy", **INLINED)
def box_centre(K, u, v, centre):
    """Centre of the box of the disc of one standard deviation, projected, pixels; and whether it has one.

    Without a box the projected centre stands for it.
    """
    x, y, _xx, _yy, norm = rim(1.0, K, u, v, centre)
    if norm < 0:
        return x, y, 1.0
    x, y, _xx, _yy, _norm = rim(0.0, K, u, v, centre)
    return x, y, 0.0


@njit(error_model="numpy", **INLINED)
def anchor_of(box, moved, size):
    """Where the linear forms of a surfel begin, before its picture is moved, see ``_coefficients``."""
    x = min(max(box[0] + moved[0], -BEYOND), size[0] + BEYOND)
    y = min(max(box[1] + moved[1], -BEYOND), size[1] + BEYOND)
    return x - moved[0], y - moved[1]
