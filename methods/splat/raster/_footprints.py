# SPDX-License-Identifier: Apache-2.0
"""Weight and depth of a disc or an ellipsoid in sixteen pixels, and the light that is left behind it.

An ellipsoid's picture is a Gaussian on the image. Its columns are those of ``_coefficients``: u and v are
linear in the pixel, without a denominator, and scaled so that alpha is ``opacity * exp(-(u^2 + v^2))``.
"""

from graycard.methods._numba import njit
from graycard.methods.splat._maps import ALPHA_MAX
from graycard.methods.splat.ewa._gaussians import ELLIPSOID_ALPHA_MAX, ELLIPSOID_TRANSMITTANCE_MIN
from graycard.methods.splat.raster._blocks import (
    LOG_ALPHA_MIN,
    depth_at,
    exponent_of,
    linear_form,
    meet,
    where_drawn,
)
from graycard.methods.splat.raster._coefficients import CENTRE_Z, LOG2_E, LOG_OPACITY, U, V
from graycard.methods.splat.simd import _many as many
from graycard.methods.splat.simd import _vector as simd
from graycard.methods.splat.simd._parts import INLINED

SOLID = (0,)
"""Tells kernels by its type that ellipsoids are drawn; discs are where None stands in its place."""


@njit(**INLINED)
def disc_weight(staged, at, x, y, before):
    """Return weight, transmittance after it, and depth of a disc, at pixels that lie so from its anchor."""
    met = meet(staged, at, x, y)
    exponent = exponent_of(staged, at, met[3], met[4])
    alpha = simd.minimum(many.decay(exponent), simd.broadcast(ALPHA_MAX))
    weight = where_drawn(exponent, before, alpha * before)
    depth, _z = depth_at(staged, at, met)
    return weight, before - weight, depth


@njit(**INLINED)
def ellipsoid_weight(staged, at, x, y, before):
    """Return the same of an ellipsoid.

    The one that would bring the transmittance to the least, or below, ends the pixel and is not drawn. The
    transmittance is negative from then on, and no other is drawn either.
    """
    zero, least = simd.broadcast(0.0), simd.broadcast(ELLIPSOID_TRANSMITTANCE_MIN)
    enough = simd.broadcast(LOG_ALPHA_MIN)
    u, v = linear_form(staged, at + U, x, y), linear_form(staged, at + V, x, y)
    square = simd.fma(u, u, v * v)
    exponent = simd.fnma(simd.broadcast(LOG2_E), square, simd.load_scalar(staged, at + LOG_OPACITY))
    alpha = simd.minimum(many.decay(exponent), simd.broadcast(ELLIPSOID_ALPHA_MAX))
    weight = alpha * before
    after = before - weight
    ended = simd.minimum(before, zero - before)
    drawn = simd.where_less(least, after, weight, zero)
    after = simd.where_less(least, after, after, ended)
    drawn = simd.where_at_least(exponent, enough, drawn, zero)
    after = simd.where_at_least(exponent, enough, after, before)
    return drawn, after, simd.load_scalar(staged, at + CENTRE_Z)
