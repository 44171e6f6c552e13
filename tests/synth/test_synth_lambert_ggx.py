# SPDX-License-Identifier: Apache-2.0
"""The Lambert + GGX material: its formula, its lobes, its densities and its parameters."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from graycard.synth import LambertGGX
from surface_interaction import directions, interaction

BASE = (0.6, 0.3, 0.1)
COUNT = 20_000


def material(roughness: float, metallic: float, base: tuple[float, float, float] = BASE) -> dict[str, Any]:
    from graycard.synth.renderer._mitsuba import _bsdf

    return _bsdf(LambertGGX(base, roughness, metallic))


def evaluate(content: dict[str, Any], wi: np.ndarray, wo: np.ndarray, lobe: str = "All") -> np.ndarray:
    """The material without the cosine, shape ``(3, N)``."""
    import mitsuba as mi

    from graycard.synth.renderer._mitsuba import load

    si, ctx = interaction(wi), mi.BSDFContext()
    ctx.type_mask = getattr(mi.BSDFFlags, lobe)
    value = load(content).eval(ctx, si, mi.Vector3f(wo.astype(np.float32)))
    return np.array(value, dtype=np.float64) / wo[2]


def formula(wi: np.ndarray, wo: np.ndarray, roughness: float, metallic: float) -> np.ndarray:
    """The material by hand, in float64."""
    base = np.array(BASE)[:, None]
    alpha2 = roughness**4
    h = (wi + wo) / np.linalg.norm(wi + wo, axis=0)
    d = alpha2 / (np.pi * (h[2] ** 2 * (alpha2 - 1) + 1) ** 2)

    def shadowing(w: np.ndarray) -> np.ndarray:
        return 2 / (1 + np.sqrt(1 + alpha2 * (1 - w[2] ** 2) / w[2] ** 2))

    f0 = 0.04 * (1 - metallic) + metallic * base
    fresnel = f0 + (1 - f0) * (1 - (wi * h).sum(0)) ** 5
    glossy = d * shadowing(wi) * shadowing(wo) * fresnel / (4 * wi[2] * wo[2])
    return (1 - metallic) * base / np.pi + glossy


@pytest.mark.parametrize(("roughness", "metallic"), [(0.3, 0.0), (0.3, 1.0), (0.7, 0.4), (1.0, 0.0)])
def test_its_value_is_the_formula(llvm: str, roughness: float, metallic: float) -> None:
    wi, wo = directions(1), directions(2)
    found = evaluate(material(roughness, metallic), wi, wo)
    np.testing.assert_allclose(found, formula(wi, wo, roughness, metallic), rtol=2e-4, atol=1e-6)


@pytest.mark.parametrize(("roughness", "metallic"), [(0.3, 0.0), (0.6, 1.0), (0.5, 0.5)])
def test_lobes_add_up_and_the_diffuse_one_is_lambertian(llvm: str, roughness: float, metallic: float) -> None:
    wi, wo, content = directions(5), directions(6), material(roughness, metallic)
    diffuse, glossy = (evaluate(content, wi, wo, lobe) for lobe in ("DiffuseReflection", "GlossyReflection"))
    np.testing.assert_allclose(diffuse + glossy, evaluate(content, wi, wo), rtol=1e-5)
    expected = np.broadcast_to((1 - metallic) * np.array(BASE)[:, None] / np.pi, diffuse.shape)
    np.testing.assert_allclose(diffuse, expected, rtol=1e-5)


@pytest.mark.parametrize("angle", [0.0, 40.0, 75.0])
@pytest.mark.parametrize(("roughness", "metallic"), [(0.3, 0.0), (0.5, 0.8)])
@pytest.mark.parametrize("lobe", ["All", "DiffuseReflection", "GlossyReflection"])
def test_samples_follow_the_density(
    llvm: str,
    angle: float,
    roughness: float,
    metallic: float,
    lobe: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    import mitsuba as mi

    from graycard.synth.renderer._lambert_ggx import register

    monkeypatch.chdir(tmp_path)  # a failing test of Mitsuba's leaves a file in the working folder
    ctx = mi.BSDFContext()
    ctx.type_mask = getattr(mi.BSDFFlags, lobe)
    wi = [float(np.sin(np.radians(angle))), 0.0, float(np.cos(np.radians(angle)))]
    sample, pdf = mi.chi2.BSDFAdapter(register(), material(roughness, metallic), wi=wi, ctx=ctx)
    domain, options = mi.chi2.SphericalDomain(), {"sample_count": 200_000, "res": 51, "ires": 16}
    test = mi.chi2.ChiSquareTest(domain, sample, pdf, sample_dim=3, **options)
    # the level of one test, so that all of this file raise a false alarm once in a thousand runs
    assert test.run(1e-3 / 18)


def test_nothing_comes_from_below(llvm: str) -> None:
    wi, wo = directions(7), directions(8)
    below = wo * np.array([1, 1, -1])[:, None]
    assert (evaluate(material(0.4, 0.2), wi, below) == 0).all()
    assert (evaluate(material(0.4, 0.2), wi * np.array([1, 1, -1])[:, None], wo) == 0).all()


def test_it_exposes_its_parameters(variant: str) -> None:
    import drjit as dr
    import mitsuba as mi

    from graycard.synth.renderer._mitsuba import load

    made = load(material(0.3, 0.25))
    si: Any = dr.zeros(mi.SurfaceInteraction3f)
    assert np.allclose(np.ravel(made.eval_attribute("base_color", si)), BASE)
    assert np.allclose(np.ravel(made.eval_attribute_3("base_color", si)), BASE)
    assert np.allclose(np.ravel(made.eval_attribute_1("roughness", si)), 0.3)
    assert np.allclose(np.ravel(made.eval_attribute_1("metallic", si)), 0.25)
    assert np.allclose(np.ravel(made.eval_diffuse_reflectance(si)), BASE)
    assert made.has_attribute("metallic")
    assert not made.has_attribute("alpha")
    assert {"base_color.value", "roughness.value", "metallic.value"} <= set(mi.traverse(made).keys())
    assert "LambertGGX" in str(made)
