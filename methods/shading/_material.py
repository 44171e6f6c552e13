# SPDX-License-Identifier: Apache-2.0
"""Material: a Lambertian lobe and a GGX lobe with Schlick's Fresnel.

With base colour ``c``, roughness ``r`` and metallic ``m``, towards the unit vectors ``l`` and ``v`` on the
side of the normal ``n``, with ``h = (l + v) / |l + v|``::

    f(l, v) = (1 - m) c / pi + D(n.h) G(n.l) G(n.v) F(v.h) / (4 n.l n.v)
    alpha = r²,  f0 = 0.04 (1 - m) + m c,  F = f0 + (1 - f0) (1 - v.h)^5

D and G are GGX with Smith's shadowing of each direction by itself (Walter et al. 2007, eq. 33 and 34), F is
Schlick 1994. This is the truth's own ``lambert-ggx``. Its other materials are none of this class: a *matte*
one has no GGX lobe at all (its f0 is 0, here it is 0.04), ``principled`` has a diffuse lobe that returns
light to where it came from and the Fresnel term of a dielectric, conductors have that of a metal.
"""

from dataclasses import dataclass
from typing import NamedTuple

import torch
from torch.nn.functional import normalize

DIELECTRIC_F0 = 0.04
"""Reflectance at normal incidence of a refractive index of 1.5."""
MIN_ALPHA = 1e-4
"""Below it the lobe is that of this alpha, as in the truth."""


@dataclass(frozen=True, eq=False)
class Material:
    """Parameters of surfaces; differentiable."""

    base_color: torch.Tensor
    """Shape ``(..., 3)``, linear Rec.709, 0 to 1."""
    roughness: torch.Tensor
    """Shape ``(...)``, 0 to 1: the square root of GGX's alpha."""
    metallic: torch.Tensor
    """Shape ``(...)``, 0 to 1."""

    @property
    def diffuse(self) -> torch.Tensor:
        """Reflectance of the Lambertian lobe, shape ``(..., 3)``."""
        return (1 - self.metallic)[..., None] * self.base_color

    @property
    def f0(self) -> torch.Tensor:
        """Reflectance of microfacets at normal incidence, shape ``(..., 3)``."""
        metallic = self.metallic[..., None]
        return DIELECTRIC_F0 * (1 - metallic) + metallic * self.base_color

    @property
    def alpha(self) -> torch.Tensor:
        """Width of the GGX lobe, shape ``(...)``."""
        return self.roughness.square().clamp(min=MIN_ALPHA)

    def __getitem__(self, index: torch.Tensor) -> "Material":
        """Only some surfaces, by index or mask."""
        return Material(self.base_color[index], self.roughness[index], self.metallic[index])


class Lobes(NamedTuple):
    """Something by lobes, each of shape ``(..., 3)``."""

    diffuse: torch.Tensor
    specular: torch.Tensor

    @property
    def whole(self) -> torch.Tensor:
        """Both together."""
        return self.diffuse + self.specular


def scattering(material: Material, normal: torch.Tensor, eye: torch.Tensor, light: torch.Tensor) -> Lobes:
    """Return the material times the cosine at the light, ``f(l, v) n.l``: what is returned of light that
    faces it.

    All shapes are broadcast against each other. Where the eye or the light is behind the surface, it is 0.

    Args:
        material: Of the surfaces.
        normal: Shape ``(..., 3)``, unit.
        eye: Shape ``(..., 3)``, unit, from the surface to the eye.
        light: Shape ``(..., 3)``, unit, from the surface to the light.

    Returns:
        Per sr; differentiable in everything.
    """
    cos_v, cos_l = _dot(normal, eye), _dot(normal, light)
    front = (cos_v > 0) & (cos_l > 0)
    cos_v, cos_l = torch.where(front, cos_v, 1.0), torch.where(front, cos_l, 0.0)
    # Behind, the middle may have no direction, and a slope of nan.
    middle = normalize(torch.where(front[..., None], eye + light, eye), dim=-1)
    alpha = material.alpha
    fresnel = schlick(material.f0, _dot(eye, middle).clamp(0, 1)[..., None])
    facets = (
        ggx_density(normal, middle, alpha) * smith_shadowing(cos_v, alpha) * smith_shadowing(cos_l, alpha)
    )
    glossy = torch.where(front, facets / (4 * cos_v), 0.0)[..., None] * fresnel
    return Lobes(material.diffuse * (cos_l / torch.pi)[..., None], glossy)


def schlick(f0: torch.Tensor, cosine: torch.Tensor) -> torch.Tensor:
    """Fresnel reflectance at an angle (Schlick 1994, eq. 15), of the shapes broadcast.

    Args:
        f0: Reflectance at normal incidence.
        cosine: Between the direction and the microfacet's normal, 0 to 1.
    """
    return f0 + (1 - f0) * (1 - cosine) ** 5


def ggx_density(normal: torch.Tensor, middle: torch.Tensor, alpha: torch.Tensor) -> torch.Tensor:
    """Density of microfacets that face along ``middle``, shape ``(...)``, per sr (Walter et al., eq. 33).

    From the sine of the angle between them, not from its cosine: a sharp lobe is lost in the rounding of
    float32 otherwise.

    Args:
        normal: Shape ``(..., 3)``, unit.
        middle: Shape ``(..., 3)``, unit.
        alpha: Shape ``(...)``, above 0.
    """
    cosine = _dot(normal, middle)
    across = middle - cosine[..., None] * normal
    squared = alpha**2
    below = _dot(across, across) + squared * cosine**2
    return torch.where(cosine > 0, squared / (torch.pi * below**2), 0.0)


def smith_shadowing(cosine: torch.Tensor, alpha: torch.Tensor) -> torch.Tensor:
    """Share of microfacets that a direction sees unhindered, of the shapes broadcast (Walter, eq. 34).

    Args:
        cosine: Between the normal and the direction, 0 to 1; 0 sees none.
        alpha: Above 0.
    """
    squared = alpha**2
    return 2 * cosine / (cosine + (squared + (1 - squared) * cosine**2).sqrt())


def _dot(a: torch.Tensor, b: torch.Tensor) -> torch.Tensor:
    return (a * b).sum(dim=-1)
