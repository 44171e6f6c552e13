# SPDX-License-Identifier: Apache-2.0
"""Light of lamps on surfaces, in float32 and sixteen surfaces at a time: one sweep over all lamps.

The formulas are those of ``_lamps`` and ``_material``; tests compare them and their gradients. A triple is a
tuple of three vectors: one a channel or an axis.
"""

from math import log, pi
from typing import NamedTuple

import numpy as np

from graycard.methods._numba import njit
from graycard.methods.shading._material import DIELECTRIC_F0, MIN_ALPHA
from graycard.methods.splat import vectors as simd
from graycard.methods.splat.parallel import BORROWING, INLINED, UNWRAPPED, run_in, share, task

PARTS = 8
"""Parts in which sums over surfaces are taken, whatever the number of threads."""
LANES = simd.LANES
NEAREST = 1e-12
"""Least squared distance of a lamp, as in ``_lamps``."""
TRIPLE = (0, 0, 0)
OVER_LN_2, OVER_PI = 1 / log(2), 1 / pi
SHORTEST = 1e-6
"""A vector of no more than this length is not brought to length 1."""


class Surfaces(NamedTuple):
    """S surfaces, a multiple of ``LANES``: flat float32 arrays, one row a surface."""

    points: np.ndarray
    normal: np.ndarray
    eye: np.ndarray
    base_color: np.ndarray
    roughness: np.ndarray
    metallic: np.ndarray
    vector: np.ndarray
    """Three a surface, or none: of what is in the way, see :func:`lit`."""
    shares: np.ndarray
    """One a surface, lamp after lamp, or none: what arrives of the lamps' light."""
    counted: np.ndarray
    """1 for surfaces, 0 for those that only fill the last vector."""


class LampRows(NamedTuple):
    """K lamps of L lobes each: flat float32 arrays."""

    positions: np.ndarray
    axes: np.ndarray
    """Unit axes of the lobes."""
    sharpness: np.ndarray
    amplitudes: np.ndarray
    known: np.ndarray
    """One a lamp: 1 where vectors tell what is in the way, else 0."""


@njit(**INLINED, **BORROWING)
def number(value):
    """Return a number in all lanes."""
    return simd.broadcast(np.float32(value))


@njit(**INLINED, **BORROWING)
def triple_of(array, at):
    """Three numbers, each in all lanes."""
    return simd.load_scalar(array, at), simd.load_scalar(array, at + 1), simd.load_scalar(array, at + 2)


@njit(**INLINED, **BORROWING)
def dot(a, b):
    """Return the product of two triples."""
    return simd.fma(a[2], b[2], simd.fma(a[1], b[1], a[0] * b[0]))


@njit(**INLINED, **BORROWING)
def scaled(factor, a):
    """Return a triple times a vector of numbers."""
    return factor * a[0], factor * a[1], factor * a[2]


@njit(**INLINED, **BORROWING)
def added(a, factor, b):
    """Return ``a + factor b``."""
    return simd.fma(factor, b[0], a[0]), simd.fma(factor, b[1], a[1]), simd.fma(factor, b[2], a[2])


@njit(**INLINED, **BORROWING)
def times(a, b):
    """Two triples, multiplied channel by channel."""
    return a[0] * b[0], a[1] * b[1], a[2] * b[2]


@njit(**INLINED, **BORROWING)
def way_to(lamps, lamp, points, softened):
    """Return the unit direction to a lamp, one over its distance, and by what its intensity is multiplied."""
    place, one = triple_of(lamps.positions, 3 * lamp), number(1.0)
    away = place[0] - points[0], place[1] - points[1], place[2] - points[2]
    squared = simd.maximum(dot(away, away), number(NEAREST))
    over = one / simd.square_root(squared)
    return scaled(over, away), over, one / (squared + softened)


@njit(**INLINED, **BORROWING)
def lobe_of(lamps, lobe, toward):
    """Return ``toward`` plus a lobe's axis, and the lobe's brightness there in shares of its amplitude."""
    aside = added(toward, number(1.0), triple_of(lamps.axes, 3 * lobe))
    exponent = number(-0.5 * OVER_LN_2) * simd.load_scalar(lamps.sharpness, lobe) * dot(aside, aside)
    return aside, simd.exp2(exponent)


@njit(**INLINED, **BORROWING)
def intensity_of(lamps, lamp, lobes, toward):
    """Return the intensity that a lamp sends against ``toward``."""
    zero = number(0.0)
    sent = zero, zero, zero
    for lobe in range(lamp * lobes, (lamp + 1) * lobes):
        _, strength = lobe_of(lamps, lobe, toward)
        sent = added(sent, strength, triple_of(lamps.amplitudes, 3 * lobe))
    return sent


@njit(**INLINED, **BORROWING)
def unit_vector(array, at):
    """Return a triple of length 1, and one over the length that it had."""
    read = simd.load_line(array, 3 * at, TRIPLE)
    over = number(1.0) / simd.maximum(simd.square_root(dot(read, read)), number(SHORTEST))
    return scaled(over, read), over


@njit(**INLINED, **BORROWING)
def along(vector, toward):
    """Return the cosine between the vector of what is in the way and a direction, 0 where it is less; and its
    seventh power.
    """
    cosine = simd.maximum(dot(vector, toward), number(0.0))
    squared = cosine * cosine
    return cosine, squared * squared * squared * cosine


@njit(**INLINED, **BORROWING)
def smith(cosine, squared):
    """``c + R`` with ``R = sqrt(a² + (1 - a²) c²)``, and R: Smith's shadowing is ``2 c / (c + R)``."""
    root = simd.square_root(simd.fma((number(1.0) - squared) * cosine, cosine, squared))
    return cosine + root, root


@njit(**INLINED, **BORROWING)
def front_of(normal, eye, toward):
    """Cosines at the eye and at the light, 1 and 0 where one of them is behind the surface; and where none
    is: 1, else 0.
    """
    zero, one = number(0.0), number(1.0)
    cos_v, cos_l = dot(normal, eye), dot(normal, toward)
    front = simd.where_less(zero, cos_v, simd.where_less(zero, cos_l, one, zero), zero)
    return simd.where_less(zero, front, cos_v, one), front * cos_l, front


@njit(**INLINED, **BORROWING)
def facets_of(normal, eye, toward, front, squared):
    """Microfacets between the eye and the light: their normal, one over the length that it had, its cosine
    to the surface's, what it has across that, the denominator of GGX's density, and the density.
    """
    middle = added(eye, front, toward)
    over = number(1.0) / simd.square_root(dot(middle, middle))
    middle = scaled(over, middle)
    cosine = dot(normal, middle)
    across = added(middle, number(0.0) - cosine, normal)
    below = simd.fma(squared * cosine, cosine, dot(across, across))
    return middle, over, cosine, across, below, number(OVER_PI) * squared / (below * below)


@njit(**INLINED, **BORROWING)
def grazing_of(eye, middle):
    """``1 - v.h``, at least 0, and its fourth power."""
    left = simd.maximum(number(1.0) - simd.maximum(dot(eye, middle), number(0.0)), number(0.0))
    squared = left * left
    return left, squared * squared


@njit(**INLINED, **BORROWING)
def place_at(surfaces, at):
    """Points, normals and directions to the eye."""
    points = simd.load_line(surfaces.points, 3 * at, TRIPLE)
    normal = simd.load_line(surfaces.normal, 3 * at, TRIPLE)
    return points, normal, simd.load_line(surfaces.eye, 3 * at, TRIPLE)


@njit(**INLINED, **BORROWING)
def vector_at(surfaces, at):
    """Return the vector of what is in the way, and one over the length that it had; zeros where there is
    none.
    """
    zero = number(0.0)
    if surfaces.vector.size > 0:
        return unit_vector(surfaces.vector, at)
    return (zero, zero, zero), zero


@njit(**INLINED, **BORROWING)
def material_at(surfaces, at):
    """``alpha²``, reflectance at normal incidence, and that of the matte lobe."""
    base = simd.load_line(surfaces.base_color, 3 * at, TRIPLE)
    metallic, roughness = simd.load(surfaces.metallic, at), simd.load(surfaces.roughness, at)
    alpha = simd.maximum(roughness * roughness, number(MIN_ALPHA))
    plain = number(DIELECTRIC_F0) * (number(1.0) - metallic)
    f0 = added((plain, plain, plain), metallic, base)
    return alpha * alpha, f0, scaled(number(1.0) - metallic, base)


@njit(**INLINED, **BORROWING)
def fresnel_of(f0, grazing):
    """Schlick's, with ``grazing`` the fifth power of ``1 - v.h``."""
    left = number(1.0) - grazing
    return simd.fma(f0[0], left, grazing), simd.fma(f0[1], left, grazing), simd.fma(f0[2], left, grazing)


@njit(**INLINED, **BORROWING)
def share_of(surfaces, lamps, lamp, at, cosine, power):
    """Share of a lamp's light that arrives, and the part of it that vectors do not tell."""
    traced = number(1.0)
    if surfaces.shares.size > 0:
        traced = simd.load(surfaces.shares, lamp * surfaces.counted.size + at)
    told = simd.fnma(simd.load_scalar(lamps.known, lamp) * cosine, power, number(1.0))
    return told * traced, traced


@njit(**UNWRAPPED, **BORROWING)
def light_surfaces(part, parts, surfaces, lamps, softened, given, returned):
    """Light a part of the surfaces, see :func:`lit`."""
    count, lobes = lamps.known.size, lamps.sharpness.size // max(1, lamps.known.size)
    first, past = share(part, parts, surfaces.counted.size // LANES)
    zero = number(0.0)
    for block in range(first, past):
        at = block * LANES
        points, normal, eye = place_at(surfaces, at)
        squared, f0, matte = material_at(surfaces, at)
        vector, _ = vector_at(surfaces, at)
        counted = simd.load(surfaces.counted, at)
        total = zero, zero, zero
        for lamp in range(count):
            toward, _, falloff = way_to(lamps, lamp, points, number(softened))
            cosine, power = along(vector, toward)
            arrives, _ = share_of(surfaces, lamps, lamp, at, cosine, power)
            facing = scaled(falloff * arrives, intensity_of(lamps, lamp, lobes, toward))
            place = (part * count + lamp) * LANES
            sum_of_channels = facing[0] + facing[1] + facing[2]
            simd.store(given, place, simd.fma(counted, sum_of_channels, simd.load(given, place)))
            cos_v, cos_l, front = front_of(normal, eye, toward)
            middle, _, _, _, _, density = facets_of(normal, eye, toward, front, squared)
            left, fourth = grazing_of(eye, middle)
            shadowed = smith(cos_v, squared)[0] * smith(cos_l, squared)[0]
            lobe = scaled(density * cos_l / shadowed, fresnel_of(f0, fourth * left))
            lobe = added(lobe, number(OVER_PI) * cos_l, matte)
            total = added(total, number(1.0), times(lobe, facing))
        simd.store_line(returned, 3 * at, total)


@njit(cache=True)
def lit(surfaces, lamps, softened, given, returned):
    """Light surfaces with all lamps.

    A surface's vector ``v``, brought to length 1, tells what is in the way of the lamps that it knows: of
    light from the direction ``w`` there arrives ``1 - max(0, v . w)^8``.

    Args:
        surfaces: Of type :class:`Surfaces`.
        lamps: Of type :class:`LampRows`.
        softened: Added to squared distances.
        given: ``(PARTS * K * LANES,)``, zero, to be added to: irradiance by part, lamp and lane, summed over
            surfaces and channels.
        returned: ``(3 S,)``, to be written: radiance that surfaces return, of all lamps together.
    """
    run_in(task(light_surfaces, (surfaces, lamps, softened, given, returned)), PARTS)
