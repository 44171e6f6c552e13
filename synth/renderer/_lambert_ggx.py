# SPDX-License-Identifier: Apache-2.0
"""The material of the papers as a Mitsuba BSDF: a Lambertian lobe and a GGX lobe with Schlick's Fresnel.

Import it only after ``use_renderer``. With base colour ``c``, roughness ``r`` and metallic ``m``::

    f(wi, wo) = (1 - m) c / pi + D(h) G(wi, wo) F(wi.h) / (4 cos_i cos_o)
    alpha = r²,  f0 = 0.04 (1 - m) + m c,  F = f0 + (1 - f0) (1 - wi.h)^5

The microfacet terms D and G are GGX with Smith's shadowing (Walter et al. 2007, "Microfacet Models for
Refraction through Rough Surfaces", eq. 33 and 34), F is Schlick 1994, the split by ``metallic`` is Burley
2012. The lobes are added and not coupled, as the methods do: seen at a grazing angle a dielectric whose
base colour is near 1 returns more light than it gets. Averaged over directions it does not, up to a base
colour of 0.9; a metal never does.

It runs in every variant with the same values. With LLVM it costs what a compiled material costs; in
``scalar_rgb`` each evaluation passes through the Python interpreter, some fifty times slower.
"""

from typing import Any, NamedTuple

import drjit as dr
import mitsuba as mi

from graycard.synth.renderer._plugin import register_plugin

PLUGIN = "lambert_ggx"

MIN_ALPHA = 1e-4
"""Below it float32 does not resolve the lobe."""

DIELECTRIC_F0 = 0.04
"""Reflectance at normal incidence of a refractive index of 1.5."""

_DEFAULTS = {"base_color": 0.5, "roughness": 0.5, "metallic": 0.0}


class _Surface(NamedTuple):
    """The parameters where a ray has met the surface."""

    diffuse: Any
    """Reflectance of the Lambertian lobe."""
    f0: Any
    microfacets: Any


def register() -> str:
    """Make the material known to the variant in use; the name of its plugin."""
    methods = {
        "__init__": _initialise,
        "sample": _sample,
        "eval": _eval,
        "pdf": _pdf,
        "eval_pdf": _eval_pdf,
        "traverse": _traverse,
        "has_attribute": _has_attribute,
        "eval_attribute": _eval_attribute,
        "eval_attribute_1": _eval_attribute_1,
        "eval_attribute_3": _eval_attribute,
        "eval_diffuse_reflectance": _eval_diffuse_reflectance,
        "to_string": _to_string,
    }
    register_plugin(PLUGIN, "BSDF", methods)
    return PLUGIN


def _initialise(self: Any, properties: mi.Properties) -> None:
    mi.BSDF.__init__(self, properties)
    self.parameters = {name: properties.get_texture(name, value) for name, value in _DEFAULTS.items()}
    lobes = [mi.BSDFFlags.DiffuseReflection, mi.BSDFFlags.GlossyReflection]
    self.m_components = [lobe | mi.BSDFFlags.FrontSide for lobe in lobes]
    self.m_flags = self.m_components[0] | self.m_components[1]


def _traverse(self: Any, callback: Any) -> None:
    for name, texture in self.parameters.items():
        callback.put(name, texture, mi.ParamFlags.Differentiable)


def _to_string(self: Any) -> str:
    return f"LambertGGX[{', '.join(self.parameters)}]"


def _has_attribute(self: Any, name: str, active: Any = True) -> Any:
    del active
    return name in self.parameters


def _eval_attribute(self: Any, name: str, si: Any, active: Any = True) -> Any:
    return self.parameters[name].eval(si, active)


def _eval_attribute_1(self: Any, name: str, si: Any, active: Any = True) -> Any:
    return self.parameters[name].eval_1(si, active)


def _eval_diffuse_reflectance(self: Any, si: Any, active: Any = True) -> Any:
    """Return the base colour whatever the metallic share, as Mitsuba's own principled material has it."""
    return self.parameters["base_color"].eval(si, active)


def _eval(self: Any, ctx: Any, si: Any, wo: Any, active: Any = True) -> Any:
    return _value(ctx, _surface(self, si, active), si.wi, wo, active)


def _pdf(self: Any, ctx: Any, si: Any, wo: Any, active: Any = True) -> Any:
    return _density(ctx, _surface(self, si, active), si.wi, wo, active)


def _eval_pdf(self: Any, ctx: Any, si: Any, wo: Any, active: Any = True) -> Any:
    surface = _surface(self, si, active)
    return _value(ctx, surface, si.wi, wo, active), _density(ctx, surface, si.wi, wo, active)


def _sample(self: Any, ctx: Any, si: Any, sample1: Any, sample2: Any, active: Any = True) -> Any:
    """Return a direction from one of the lobes, and ``f cos_o / pdf`` of all lobes that ``ctx`` allows."""
    surface = _surface(self, si, active)
    glossy = sample1 < _glossy_share(ctx, surface, si.wi)
    h, _ = surface.microfacets.sample(si.wi, sample2)
    wo = dr.select(glossy, mi.reflect(si.wi, mi.Normal3f(h)), mi.warp.square_to_cosine_hemisphere(sample2))
    bs: Any = dr.zeros(mi.BSDFSample3f)
    bs.wo = wo
    bs.pdf = _density(ctx, surface, si.wi, wo, active)
    bs.eta = 1.0
    types = int(mi.BSDFFlags.GlossyReflection), int(mi.BSDFFlags.DiffuseReflection)
    bs.sampled_type = dr.select(glossy, mi.UInt32(types[0]), mi.UInt32(types[1]))
    bs.sampled_component = dr.select(glossy, mi.UInt32(1), mi.UInt32(0))
    possible = active & (bs.pdf > 0)
    weight = _value(ctx, surface, si.wi, wo, possible) / dr.select(possible, bs.pdf, 1.0)
    return bs, dr.select(possible, weight, 0.0)


def _surface(self: Any, si: Any, active: Any) -> _Surface:
    color = self.parameters["base_color"].eval(si, active)
    metallic = self.parameters["metallic"].eval_1(si, active)
    alpha = dr.maximum(dr.square(self.parameters["roughness"].eval_1(si, active)), MIN_ALPHA)
    return _Surface(
        (1 - metallic) * color,
        DIELECTRIC_F0 * (1 - metallic) + metallic * color,
        mi.MicrofacetDistribution(mi.MicrofacetType.GGX, alpha, sample_visible=True),
    )


def _value(ctx: Any, surface: _Surface, wi: Any, wo: Any, active: Any) -> Any:
    """Return the enabled lobes times ``cos_o``."""
    cos_i, cos_o = mi.Frame3f.cos_theta(wi), mi.Frame3f.cos_theta(wo)
    active = active & (cos_i > 0) & (cos_o > 0)
    value = mi.Color3f(0.0)
    if ctx.is_enabled(mi.BSDFFlags.DiffuseReflection, 0):
        value += surface.diffuse * dr.inv_pi * cos_o
    if ctx.is_enabled(mi.BSDFFlags.GlossyReflection, 1):
        h = dr.normalize(wi + wo)
        facets = surface.microfacets.eval(h) * surface.microfacets.G(wi, wo, h)
        value += schlick(surface.f0, dr.dot(wi, h)) * facets / dr.select(active, 4 * cos_i, 1.0)
    return dr.select(active, value, 0.0)


def _density(ctx: Any, surface: _Surface, wi: Any, wo: Any, active: Any) -> Any:
    """Probability density of :func:`_sample` in solid angle."""
    cos_i, cos_o = mi.Frame3f.cos_theta(wi), mi.Frame3f.cos_theta(wo)
    active = active & (cos_i > 0) & (cos_o > 0)
    h = dr.normalize(wi + wo)
    per_reflection = 4 * dr.dot(wo, h)
    glossy = surface.microfacets.pdf(wi, h) / dr.select(active, per_reflection, 1.0)
    share = _glossy_share(ctx, surface, wi)
    return dr.select(active, dr.lerp(cos_o * dr.inv_pi, glossy, share), 0.0)


def _glossy_share(ctx: Any, surface: _Surface, wi: Any) -> Any:
    """Return how often the GGX lobe is sampled: its share in what a smooth surface would return."""
    if not ctx.is_enabled(mi.BSDFFlags.DiffuseReflection, 0):
        return mi.Float(1.0)
    if not ctx.is_enabled(mi.BSDFFlags.GlossyReflection, 1):
        return mi.Float(0.0)
    glossy = mi.luminance(schlick(surface.f0, dr.maximum(mi.Frame3f.cos_theta(wi), 0.0)))
    # not under 1/4: a lobe that is rarely sampled and bright is noise
    return dr.maximum(glossy / (glossy + mi.luminance(surface.diffuse)), 0.25)


def schlick(f0: Any, cosine: Any) -> Any:
    """Fresnel reflectance at an angle, from that at normal incidence (Schlick 1994, eq. 15).

    Args:
        f0: Reflectance at normal incidence.
        cosine: Between the direction and the microfacet's normal, 0 to 1.
    """
    return f0 + (1 - f0) * dr.power(1 - cosine, 5)
