# SPDX-License-Identifier: Apache-2.0
"""The way back of ``_lamp_kernels``: what is found on the way is found again, nothing is kept.

``to_x`` is the gradient of the loss in x.
"""

from typing import NamedTuple

import numpy as np

from graycard.methods._numba import njit
from graycard.methods.shading._lamp_kernels import (
    LANES,
    OVER_PI,
    PARTS,
    SHORTEST,
    TRIPLE,
    added,
    along,
    dot,
    facets_of,
    fresnel_of,
    front_of,
    grazing_of,
    intensity_of,
    lobe_of,
    material_at,
    number,
    place_at,
    scaled,
    share_of,
    smith,
    times,
    triple_of,
    vector_at,
    way_to,
)
from graycard.methods.shading._material import DIELECTRIC_F0, MIN_ALPHA
from graycard.methods.splat import vectors as simd
from graycard.methods.splat.parallel import BORROWING, INLINED, UNWRAPPED, run_in, share, task

OF_LAMP, OF_LOBE = 3, 7
"""Numbers of a lamp that have a gradient: its place; and of each lobe: axis, sharpness and amplitude."""


class ToSurfaces(NamedTuple):
    """Gradients by surface, to be written: of arrays of ``Surfaces`` that are named so."""

    normal: np.ndarray
    base_color: np.ndarray
    roughness: np.ndarray
    metallic: np.ndarray
    vector: np.ndarray


@njit(**INLINED, **BORROWING)
def add_to(sums, place, values):
    """Add a vector to those of a place."""
    simd.store(sums, place, simd.load(sums, place) + values)


@njit(**INLINED, **BORROWING)
def add_triple_to(sums, place, values):
    """Add a triple to three places, one after the other."""
    add_to(sums, place, values[0])
    add_to(sums, place + LANES, values[1])
    add_to(sums, place + 2 * LANES, values[2])


@njit(**INLINED, **BORROWING)
def through_length(unit, over, to_unit):
    """From the gradient of ``u = x / |x|`` to that of x; ``over`` is ``1 / |x|``."""
    return scaled(over, added(to_unit, number(0.0) - dot(unit, to_unit), unit))


@njit(**INLINED, **BORROWING)
def through_lobes(lamps, numbers, toward, to_sent, sums, place):
    """Add the gradients of a lamp's lobes from that of its intensity; the gradient of the direction.

    ``numbers`` are that of the lamp and how many lobes it has.
    """
    lamp, lobes = numbers
    zero = number(0.0)
    to_toward = zero, zero, zero
    for lobe in range(lobes):
        every = lamp * lobes + lobe
        aside, strength = lobe_of(lamps, every, toward)
        asked = strength * dot(to_sent, triple_of(lamps.amplitudes, 3 * every))
        to_aside = scaled(number(0.0) - simd.load_scalar(lamps.sharpness, every) * asked, aside)
        to_toward = added(to_toward, number(1.0), to_aside)
        own = place + (OF_LAMP + OF_LOBE * lobe) * LANES
        add_triple_to(sums, own, to_aside)
        add_to(sums, own + 3 * LANES, number(-0.5) * dot(aside, aside) * asked)
        add_triple_to(sums, own + 4 * LANES, scaled(strength, to_sent))
    return to_toward


@njit(**INLINED, **BORROWING)
def through_smith(shadowed, root, cosine, squared, to_shadowed):
    """Gradients of the cosine and of ``a²`` from that of ``c + R``, see ``smith``."""
    one = number(1.0)
    to_cosine = to_shadowed * simd.fma((one - squared) * cosine, one / root, one)
    return to_cosine, number(0.5) * to_shadowed * simd.fnma(cosine, cosine, one) / root


@njit(**INLINED, **BORROWING)
def through_facets(normal, eye, toward, front, squared, glossy):
    """Return the glossy lobe without Fresnel's term, and what turns its gradient into those of others.

    ``glossy`` holds the cosines at the eye and at the light, and what ``facets_of`` says.

    Returns:
        Shares of the gradient of the logarithm of the lobe that go to the normal, the light and ``a²``, and
        the lobe over the cosine at the light, which may be 0.
    """
    cos_v, cos_l, (middle, over, cosine, across, below, density) = glossy
    one, two = number(1.0), number(2.0)
    seen_v, root_v = smith(cos_v, squared)
    seen_l, root_l = smith(cos_l, squared)
    to_cos_v, to_squared_v = through_smith(seen_v, root_v, cos_v, squared, number(-1.0) / seen_v)
    to_cos_l, to_squared_l = through_smith(seen_l, root_l, cos_l, squared, number(-1.0) / seen_l)
    to_below = number(-2.0) / below
    to_squared = simd.fma(to_below * cosine, cosine, one / squared) + to_squared_v + to_squared_l
    to_cosine = two * to_below * simd.fma(squared, cosine, number(0.0) - dot(across, normal))
    to_middle = added(scaled(to_cosine, normal), two * to_below, across)
    to_toward = scaled(front, through_length(middle, over, to_middle))
    to_toward = added(to_toward, to_cos_l, normal)
    to_normal = added(scaled(to_cosine, middle), number(-2.0) * cosine * to_below, across)
    to_normal = added(added(to_normal, to_cos_v, eye), to_cos_l, toward)
    return to_normal, to_toward, to_squared, density / (seen_v * seen_l)


@njit(**INLINED, **BORROWING)
def through_surface(normal, eye, toward, material, to_returned, facing):
    """Pass gradients of the light that one lamp has returned back to surface and lamp.

    Returns:
        Gradients of what faces the lamp, of the direction to it, of normals, and of the three of
        ``material_at``.
    """
    squared, f0, matte = material
    one = number(1.0)
    cos_v, cos_l, front = front_of(normal, eye, toward)
    facets = facets_of(normal, eye, toward, front, squared)
    left, fourth = grazing_of(eye, facets[0])
    grazing = fourth * left
    fresnel = fresnel_of(f0, grazing)
    through = through_facets(normal, eye, toward, front, squared, (cos_v, cos_l, facets))
    glossy = through[3] * cos_l
    lobe = added(scaled(glossy, fresnel), number(OVER_PI) * cos_l, matte)
    to_lobe = scaled(front, times(to_returned, facing))
    to_fresnel = scaled(glossy, to_lobe)
    to_grazing = dot(to_fresnel, (one - f0[0], one - f0[1], one - f0[2]))
    bright = dot(to_lobe, fresnel)
    to_cos_l = simd.fma(number(OVER_PI), dot(to_lobe, matte), bright * through[3])
    to_log = bright * glossy
    to_normal = added(scaled(to_log, through[0]), to_cos_l, toward)
    to_toward = added(scaled(to_log, through[1]), to_cos_l, normal)
    to_middle = scaled(number(-5.0) * fourth * to_grazing, eye)
    to_toward = added(to_toward, front, through_length(facets[0], facets[1], to_middle))
    to_material = (
        to_log * through[2],
        scaled(one - grazing, to_fresnel),
        scaled(number(OVER_PI) * cos_l, to_lobe),
    )
    return times(to_returned, lobe), to_toward, to_normal, to_material


@njit(**UNWRAPPED, **BORROWING)
def light_backward(part, parts, surfaces, lamps, softened, upstream, sums, to_surfaces):
    """Write the gradients of a part of the surfaces, and add those of the lamps, see :func:`lit_backward`."""
    count, lobes = lamps.known.size, lamps.sharpness.size // max(1, lamps.known.size)
    first, past = share(part, parts, surfaces.counted.size // LANES)
    zero, one = number(0.0), number(1.0)
    for block in range(first, past):
        at = block * LANES
        points, normal, eye = place_at(surfaces, at)
        material, counted = material_at(surfaces, at), simd.load(surfaces.counted, at)
        vector, over_vector = vector_at(surfaces, at)
        asked = scaled(counted, simd.load_line(upstream[1], 3 * at, TRIPLE))
        to_normal = to_f0 = to_matte = to_vector = (zero, zero, zero)
        to_squared = zero
        for lamp in range(count):
            place = (part * count + lamp) * (OF_LAMP + OF_LOBE * lobes) * LANES
            toward, over, falloff = way_to(lamps, lamp, points, number(softened))
            sent = intensity_of(lamps, lamp, lobes, toward)
            blocked, power = along(vector, toward)
            arrives, traced = share_of(surfaces, lamps, lamp, at, blocked, power)
            facing = scaled(falloff * arrives, sent)
            to_facing, to_toward, more, of_material = through_surface(
                normal, eye, toward, material, asked, facing
            )
            to_normal = added(to_normal, one, more)
            to_squared = to_squared + of_material[0]
            to_f0, to_matte = added(to_f0, one, of_material[1]), added(to_matte, one, of_material[2])
            wanted = simd.load_scalar(upstream[0], lamp) * counted
            to_facing = added(to_facing, wanted, (one, one, one))
            reached = dot(to_facing, sent)
            to_blocked = number(-8.0) * reached * falloff * traced * power
            to_blocked = to_blocked * simd.load_scalar(lamps.known, lamp)
            to_vector = added(to_vector, to_blocked, toward)
            to_toward = added(to_toward, to_blocked, vector)
            to_sent = scaled(falloff * arrives, to_facing)
            by_lobes = through_lobes(lamps, (lamp, lobes), toward, to_sent, sums, place)
            to_place = through_length(toward, over, added(to_toward, one, by_lobes))
            farther = number(-2.0) * reached * arrives * falloff * falloff / over
            add_triple_to(sums, place, added(to_place, farther, toward))
        found = to_normal, to_squared, to_f0, to_matte
        store_gradients(surfaces, at, found, to_surfaces)
        if surfaces.vector.size > 0:
            longer = simd.where_less(over_vector, number(1 / SHORTEST), one, zero)
            to_read = through_length(vector, over_vector, to_vector)
            simd.store_line(to_surfaces.vector, 3 * at, scaled(longer, to_read))


@njit(**INLINED, **BORROWING)
def store_gradients(surfaces, at, found, to_surfaces):
    """Write gradients of normals and materials."""
    to_normal, to_squared, to_f0, to_matte = found
    base = simd.load_line(surfaces.base_color, 3 * at, TRIPLE)
    metallic, roughness = simd.load(surfaces.metallic, at), simd.load(surfaces.roughness, at)
    simd.store_line(to_surfaces.normal, 3 * at, to_normal)
    to_base = added(scaled(metallic, to_f0), number(1.0) - metallic, to_matte)
    simd.store_line(to_surfaces.base_color, 3 * at, to_base)
    more = added(base, number(-DIELECTRIC_F0), (number(1.0), number(1.0), number(1.0)))
    simd.store(to_surfaces.metallic, at, dot(to_f0, more) - dot(to_matte, base))
    alpha = roughness * roughness
    to_roughness = number(4.0) * to_squared * alpha * roughness  # of r^4
    to_roughness = simd.where_less(number(MIN_ALPHA), alpha, to_roughness, number(0.0))
    simd.store(to_surfaces.roughness, at, to_roughness)


@njit(cache=True)
def lit_backward(surfaces, lamps, softened, upstream, sums, to_surfaces):
    """Write the gradients of :func:`graycard.methods.shading._lamp_kernels.lit`.

    Args:
        surfaces: as there.
        lamps: as there.
        softened: as there.
        upstream: ``(K,)``: of irradiance by lamp, summed over surfaces and channels; and ``(3 S,)``: of what
            is returned.
        sums: ``(PARTS * K * (OF_LAMP + L * OF_LOBE) * LANES,)``, zero, to be added to: gradients of the
            lamps, their place before their lobes.
        to_surfaces: Of type :class:`ToSurfaces`, to be written.
    """
    run_in(task(light_backward, (surfaces, lamps, softened, upstream, sums, to_surfaces)), PARTS)
