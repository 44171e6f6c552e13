# SPDX-License-Identifier: Apache-2.0
"""Every material that a family may use: reciprocal, passive, and sampled as its value says."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from graycard.synth import Conductor, Glossy, LambertGGX, Matte
from graycard.synth._scene import Material
from surface_interaction import directions, interaction

COUNT = 20_000
COLOR = (0.5, 0.3, 0.1)
COPPER = (0.2, 0.92, 1.1), (3.9, 2.45, 2.14)

MATERIALS: dict[str, Material] = {
    "matte": Matte(COLOR),
    "principled, dielectric, glossy": Glossy(COLOR, 0.25),
    "principled, dielectric, rough": Glossy(COLOR, 0.8),
    "principled, mixed": Glossy(COLOR, 0.5, 0.5),
    "principled, metal": Glossy(COLOR, 0.3, 1.0),
    "lambert-ggx, dielectric, glossy": LambertGGX(COLOR, 0.2),
    "lambert-ggx, dielectric, rough": LambertGGX(COLOR, 0.8),
    "lambert-ggx, mixed": LambertGGX(COLOR, 0.5, 0.5),
    "lambert-ggx, metal": LambertGGX(COLOR, 0.3, 1.0),
    "conductor, glossy": Conductor(*COPPER, 0.25),
    "conductor, rough": Conductor(*COPPER, 0.8),
}
EACH = pytest.mark.parametrize("material", MATERIALS.values(), ids=MATERIALS.keys())

Judge = Callable[[str, float, float], None]

pytestmark = pytest.mark.usefixtures("llvm")


def made(material: Material) -> Any:
    from graycard.synth.renderer._mitsuba import _bsdf, load

    return load(_bsdf(material))


def towards(degrees: float, count: int) -> np.ndarray:
    angle = np.radians(degrees)
    return np.repeat([[np.sin(angle)], [0.0], [np.cos(angle)]], count, axis=1)


def context(lobe: str) -> Any:
    import mitsuba as mi

    ctx = mi.BSDFContext()
    ctx.type_mask = getattr(mi.BSDFFlags, lobe)
    return ctx


def value(material: Material, wi: np.ndarray, wo: np.ndarray, lobe: str = "All") -> np.ndarray:
    """The material without the cosine, shape ``(3, N)``."""
    import mitsuba as mi

    out = mi.Vector3f(wo.astype(np.float32))
    found = made(material).eval(context(lobe), interaction(wi), out)
    return np.array(found, dtype=np.float64) / wo[2].astype(np.float32)


def albedo(
    material: Material, wi: np.ndarray, lobe: str = "All", seed: int = 1
) -> tuple[np.ndarray, np.ndarray]:
    """Mean of the directional albedo over ``wi`` by sampling, and its standard error, each ``(3,)``."""
    from graycard.synth.renderer._mitsuba import load

    sampler = load({"type": "independent"})
    sampler.seed(seed, wi.shape[1])
    args = interaction(wi), sampler.next_1d(), sampler.next_2d()
    samples = np.array(made(material).sample(context(lobe), *args)[1], dtype=np.float64)
    return samples.mean(axis=1), samples.std(axis=1) / np.sqrt(wi.shape[1])


@EACH
def test_it_is_reciprocal(material: Material, judge: Judge) -> None:
    wi, wo = directions(3), directions(4)
    there, back = value(material, wi, wo), value(material, wo, wi)
    off = np.abs(there - back) / np.maximum(np.maximum(there, back), 1e-3)
    assert np.median(there) > 1e-3
    judge("reciprocity: largest relative error", off.max(), 1e-5)


def steepest(material: Material) -> float:
    """Up to which angle a material may be asked to return no more light than it gets, degrees.

    The dielectrics of Disney and of the papers add a specular lobe to a diffuse one without taking from it:
    at grazing angles, where Fresnel's reflectance nears 1, they return more than they get.
    """
    layered = isinstance(material, Glossy | LambertGGX) and material.metallic < 0.5
    return 65 if layered else 88


WHITES: dict[str, Material] = {
    "white": Matte((1.0, 1.0, 1.0)),
    "white principled metal, smooth": Glossy((1.0, 1.0, 1.0), 0.05, 1.0),
    "white principled metal, rough": Glossy((1.0, 1.0, 1.0), 1.0, 1.0),
    "white lambert-ggx metal, smooth": LambertGGX((1.0, 1.0, 1.0), 0.05, 1.0),
    "white lambert-ggx metal, rough": LambertGGX((1.0, 1.0, 1.0), 1.0, 1.0),
    "bright lambert-ggx, mixed": LambertGGX((0.8, 0.8, 0.8), 0.3, 0.5),
}


@pytest.mark.parametrize(
    "material", [*MATERIALS.values(), *WHITES.values()], ids=[*MATERIALS.keys(), *WHITES.keys()]
)
def test_it_returns_no_more_light_than_it_gets(material: Material, judge: Judge) -> None:
    for degrees in (0, 45, 65, 75, 85, 88):
        if degrees <= steepest(material):
            found, error = albedo(material, towards(degrees, 1 << 16))
            excess = float((found - 1 - 4 * error).max())
            judge(f"energy gained at {degrees} degrees, over 4 sigma", excess, 1e-5)
            assert found.min() > 0.05


@pytest.mark.parametrize("roughness", [0.1, 0.4, 1.0])
@pytest.mark.parametrize("kind", [Glossy, LambertGGX])
def test_over_all_directions_a_dielectric_gains_nothing_up_to_a_base_color_of_nine_tenths(
    kind: type[Glossy] | type[LambertGGX], roughness: float, judge: Judge
) -> None:
    """The sky is uniform: a dielectric gains at grazing angles as much as it loses elsewhere."""
    cosine = np.sqrt(np.random.default_rng(0).random(1 << 18))
    wi = np.stack([np.sqrt(1 - cosine**2), np.zeros_like(cosine), cosine])
    found, error = albedo(kind((0.9, 0.9, 0.9), roughness), wi)
    judge("albedo under a uniform sky", float((found + 4 * error).max()), 1)
    assert found.min() > 0.9


@pytest.mark.parametrize(
    ("material", "lobe"),
    [
        *((material, "All") for material in MATERIALS.values()),
        (MATERIALS["lambert-ggx, mixed"], "DiffuseReflection"),
        (MATERIALS["lambert-ggx, mixed"], "GlossyReflection"),
    ],
    ids=[*MATERIALS.keys(), "lambert-ggx, its diffuse lobe", "lambert-ggx, its glossy lobe"],
)
def test_it_is_sampled_as_its_value_says(material: Material, lobe: str, judge: Judge) -> None:
    """The directional albedo by sampling against that by quadrature of the value over the hemisphere."""
    u, v = np.stack(np.meshgrid(*2 * [(np.arange(800) + 0.5) / 800])).reshape(2, -1)
    wo = np.stack([np.sqrt(u) * np.cos(2 * np.pi * v), np.sqrt(u) * np.sin(2 * np.pi * v), np.sqrt(1 - u)])
    expected = np.pi * value(material, towards(50, u.size), wo, lobe).mean(axis=1)
    found, error = albedo(material, towards(50, 1 << 17), lobe)
    judge("sampling against value, over 4 sigma", float((np.abs(found - expected) - 4 * error).max()), 1e-4)
    judge("sampling: relative standard error", float((error / found).max()), 5e-3)


@EACH
def test_along_the_normal_its_value_is_the_closed_form(material: Material, judge: Judge) -> None:
    """``(1 - m) c / pi + F0 D(n) / 4`` with GGX's ``D(n) = 1 / (pi alpha²)`` and alpha = roughness²."""
    match material:
        case Matte():
            expected = np.array(COLOR) / np.pi
        case Conductor(roughness=roughness):
            expected = np.array(material.f0) / (4 * np.pi * roughness**4)
        case Glossy(_, roughness, metallic) | LambertGGX(_, roughness, metallic):
            f0 = 0.04 * (1 - metallic) + metallic * np.array(COLOR)
            expected = (1 - metallic) * np.array(COLOR) / np.pi + f0 / (4 * np.pi * roughness**4)
    found = value(material, towards(0, 1), towards(0, 1))[:, 0]
    judge("value along the normal: largest relative error", np.abs(found / expected - 1).max(), 1e-5)


def schlick(f0: np.ndarray, cosine: float) -> np.ndarray:
    return f0 + (1 - f0) * (1 - cosine) ** 5


def fresnel(eta: np.ndarray, k: np.ndarray, cosine: float) -> np.ndarray:
    """Unpolarised reflectance of a conductor: the mean of the two polarisations (complex Snell's law)."""
    index = eta + 1j * k
    inside = np.sqrt(index**2 - (1 - cosine**2))
    across = (cosine - inside) / (cosine + inside)
    along = (index**2 * cosine - inside) / (index**2 * cosine + inside)
    return (np.abs(across) ** 2 + np.abs(along) ** 2) / 2


@pytest.mark.parametrize("degrees", [0, 30, 60, 75])
def test_nearly_smooth_materials_reflect_by_fresnel(degrees: int, judge: Judge) -> None:
    """Albedo is that of a mirror if microfacets hardly differ, over a Lambertian base if there is one.

    A slope of 4e-4 about the normal changes the reflectance by less than 1e-4 at these angles.
    """
    color, cosine, smooth = np.array(COLOR), float(np.cos(np.radians(degrees))), 0.02
    eta, k = np.array(COPPER)
    for name, material, expected in (
        ("matte", Matte(COLOR), color),
        ("lambert-ggx metal", LambertGGX(COLOR, smooth, 1.0), schlick(color, cosine)),
        ("lambert-ggx dielectric", LambertGGX(COLOR, smooth), color + schlick(np.array(0.04), cosine)),
        ("principled metal", Glossy(COLOR, smooth, 1.0), schlick(color, cosine)),
        ("conductor", Conductor(*COPPER, smooth), fresnel(eta, k, cosine)),
    ):
        found, error = albedo(material, towards(degrees, 1 << 17))
        judge(f"{name} at {degrees} degrees", float((np.abs(found - expected) - 4 * error).max()), 2e-4)
