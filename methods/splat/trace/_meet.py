# SPDX-License-Identifier: Apache-2.0
"""Intersections of rays with discs: sixteen rays and one disc, or one ray and sixteen discs, are the same
arithmetic.
"""

from math import log2

import numpy as np

from graycard.methods._numba import njit
from graycard.methods.splat._maps import ALPHA_MAX, ALPHA_MIN
from graycard.methods.splat.simd import _vector as simd
from graycard.methods.splat.simd._parts import BORROWING, INLINED
from graycard.methods.splat.simd._vector import LANES
from graycard.methods.splat.trace._bvh_kernels import LOG_OPACITY, RECORD

LOG_ALPHA_MIN = log2(ALPHA_MIN)
MISSED = np.float32(1e30)
"""The exponent of what is not met."""


@njit(**INLINED, **BORROWING)
def one_record(records, place):
    """Return the numbers of the surfel in one place, each in all lanes."""
    at = place // LANES * (RECORD * LANES) + place % LANES
    ld = simd.load_scalar
    u = (ld(records, at), ld(records, at + 16), ld(records, at + 32))
    v = (ld(records, at + 48), ld(records, at + 64), ld(records, at + 80))
    n = (ld(records, at + 96), ld(records, at + 112), ld(records, at + 128))
    c = (ld(records, at + 144), ld(records, at + 160), ld(records, at + 176))
    return u, v, n, c, ld(records, at + LOG_OPACITY * LANES)


@njit(**INLINED, **BORROWING)
def leaf_records(records, leaf):
    """Return the numbers of a leaf's surfels, one a lane."""
    at, ld = leaf * (RECORD * LANES), simd.load
    u = (ld(records, at), ld(records, at + 16), ld(records, at + 32))
    v = (ld(records, at + 48), ld(records, at + 64), ld(records, at + 80))
    n = (ld(records, at + 96), ld(records, at + 112), ld(records, at + 128))
    c = (ld(records, at + 144), ld(records, at + 160), ld(records, at + 176))
    return u, v, n, c, ld(records, at + LOG_OPACITY * LANES)


@njit(**INLINED, **BORROWING)
def all_rays(rays):
    """Origins and directions of a packet, one ray a lane."""
    origin = (simd.load(rays, 0), simd.load(rays, 16), simd.load(rays, 32))
    return origin, (simd.load(rays, 48), simd.load(rays, 64), simd.load(rays, 80))


@njit(**INLINED, **BORROWING)
def one_ray(rays, lane):
    """Origin and direction of one ray of a packet, in all lanes."""
    ld = simd.load_scalar
    origin = (ld(rays, lane), ld(rays, lane + 16), ld(rays, lane + 32))
    return origin, (ld(rays, lane + 48), ld(rays, lane + 64), ld(rays, lane + 80))


@njit(**INLINED, **BORROWING)
def dot(a, b):
    return simd.fma(a[0], b[0], simd.fma(a[1], b[1], a[2] * b[2]))


@njit(**INLINED, **BORROWING)
def meet(record, ray):
    """Intersections of rays with the planes of discs.

    The point is found from the disc's centre, with one rounding of the sum: what remains of distances that
    are large beside the disc is as exact as they are.

    Returns:
        Distance t, point from the centre, u, v, slope N . d; not finite where the ray runs in the plane.
    """
    u, v, normal, centre, _ = record
    origin, direction = ray
    offset = (origin[0] - centre[0], origin[1] - centre[1], origin[2] - centre[2])
    slope = dot(normal, direction)
    t = (simd.broadcast(0.0) - dot(normal, offset)) / slope
    point = (
        simd.fma(t, direction[0], offset[0]),
        simd.fma(t, direction[1], offset[1]),
        simd.fma(t, direction[2], offset[2]),
    )
    return t, point, dot(u, point), dot(v, point), slope


@njit(**INLINED, **BORROWING)
def exponents(record, near, t, u, v):
    """Return the exponent of each hit, ``MISSED`` where too near, and the last one at which a hit counts."""
    exponent = simd.where_at_least(t, near, simd.fma(u, u, v * v), simd.broadcast(MISSED))
    return exponent, record[4] - simd.broadcast(LOG_ALPHA_MIN)


@njit(**INLINED, **BORROWING)
def drawn_alpha(record, exponent, last):
    """Alpha as it is drawn, zero where the exponent is beyond the last that counts."""
    alpha = simd.minimum(simd.exp2(record[4] - exponent), simd.broadcast(ALPHA_MAX))
    return simd.where_at_least(last, exponent, alpha, simd.broadcast(0.0))
