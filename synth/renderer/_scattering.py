# SPDX-License-Identifier: Apache-2.0
"""Scattering: what a surface does with light, by lobes. Import it only after ``use_renderer``."""

from collections.abc import Callable
from typing import Any, NamedTuple

import drjit as dr
import mitsuba as mi


class Scattering(NamedTuple):
    """Scattering: what a surface does with light: towards a light that was sampled, and along the
    path's next ray.
    """

    value: Any
    """Value of the material towards the light, times the cosine."""
    diffuse: Any
    """Share of ``value`` that the diffuse lobe has."""
    density: Any
    """Density of sampling the light's direction by the material."""
    sample: Any
    """The next direction, a ``BSDFSample3f``."""
    weight: Any
    """Material times cosine over density, of the next direction."""
    diffuse_share: Any
    """Share of ``weight`` that the diffuse lobe has, 0 to 1."""


Response = Callable[[Any, Any, Any, Any, Any, Any], Scattering]
"""``(bsdf, si, wo, (sample1, sample2), first, active)``; ``first`` is where the camera's own hit is."""


def as_it_is(bsdf: Any, si: Any, wo: Any, samples: Any, first: Any, active: Any) -> Scattering:
    """Return Result: what the material does, split by lobes where ``first``."""
    value, density, sample, weight = bsdf.eval_pdf_sample(mi.BSDFContext(), si, wo, *samples, active)
    first = first & active
    towards_light, onwards = _diffuse_values(bsdf, si, (wo, sample.wo), first)
    return Scattering(
        value,
        _share(towards_light, value),
        density,
        sample,
        weight,
        _share(onwards, weight * sample.pdf),
    )


def white_first(bsdf: Any, si: Any, wo: Any, samples: Any, first: Any, active: Any) -> Scattering:
    """Return Result: what the material does, with a white Lambertian one in its place where ``first``."""
    value, density, sample, weight = bsdf.eval_pdf_sample(mi.BSDFContext(), si, wo, *samples, active)
    front = mi.Frame3f.cos_theta(si.wi) > 0
    cosine = dr.select(front, dr.maximum(mi.Frame3f.cos_theta(wo), 0), 0) * dr.inv_pi
    cosine_wo = mi.warp.square_to_cosine_hemisphere(samples[1])
    sample.wo = dr.select(first, cosine_wo, sample.wo)
    sample.pdf = dr.select(first, mi.Frame3f.cos_theta(cosine_wo) * dr.inv_pi, sample.pdf)
    diffuse = mi.UInt32(int(mi.BSDFFlags.DiffuseReflection))
    sample.sampled_type = dr.select(first, diffuse, sample.sampled_type)
    return Scattering(
        dr.select(first, mi.Color3f(cosine), value),
        mi.Color3f(1),
        dr.select(first, cosine, density),
        sample,
        dr.select(first, mi.Color3f(dr.select(front, 1.0, 0.0)), weight),
        mi.Color3f(1),
    )


def _share(part: Any, whole: Any) -> Any:
    return dr.select(whole > 0, dr.clip(part / dr.select(whole > 0, whole, 1), 0, 1), 0)


def _diffuse_values(bsdf: Any, si: Any, directions: tuple[Any, ...], active: Any) -> list[Any]:
    """Return the diffuse lobe of any material towards each direction, times the cosine.

    Mitsuba's ``principled`` ignores which lobes a context asks for; it alone has an attribute ``specular``.
    """
    principled = active & bsdf.has_attribute("specular", active)
    others = active & ~principled
    context = mi.BSDFContext()
    context.type_mask = mi.BSDFFlags.DiffuseReflection
    disney = _disney(bsdf, si, principled)
    return [
        dr.select(principled, _disney_diffuse(disney, si.wi, wo), bsdf.eval(context, si, wo, others))
        for wo in directions
    ]


class _Disney(NamedTuple):
    """Inputs of the diffuse lobe of the principled material."""

    reflectance: Any
    roughness: Any


def _disney(bsdf: Any, si: Any, active: Any) -> _Disney:
    metallic = bsdf.eval_attribute_1("metallic", si, active)
    color = bsdf.eval_attribute("base_color", si, active)
    return _Disney((1 - metallic) * color, bsdf.eval_attribute_1("roughness", si, active))


def _disney_diffuse(material: _Disney, wi: Any, wo: Any) -> Any:
    """Diffuse lobe with retro-reflection, times the cosine (Burley 2015, section 3, without sheen)."""
    cos_i, cos_o = mi.Frame3f.cos_theta(wi), mi.Frame3f.cos_theta(wo)
    grazing_i, grazing_o = _grazing(cos_i), _grazing(cos_o)
    retro = 2 * material.roughness * dr.square(dr.dot(dr.normalize(wi + wo), wo))
    lambert = (1 - 0.5 * grazing_i) * (1 - 0.5 * grazing_o)
    back = retro * (grazing_o + grazing_i + grazing_o * grazing_i * (retro - 1))
    value = material.reflectance * dr.inv_pi * cos_o * (lambert + back)
    return dr.select((cos_i > 0) & (cos_o > 0), value, 0)


def _grazing(cosine: Any) -> Any:
    """Schlick's weight of the grazing reflectance."""
    return dr.power(dr.clip(1 - cosine, 0, 1), 5)
