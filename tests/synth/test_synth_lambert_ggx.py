# SPDX-License-Identifier: Apache-2.0
"""The Lambert + GGX material: its formula, and that it is a material that physics allows."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import graycard as gc
from graycard.synth import Ball, LambertGGX, RenderSettings, Scene, Thing, use_renderer

BASE = (0.6, 0.3, 0.1)
COUNT = 20_000


@pytest.fixture
def llvm() -> None:
    """Arrays of directions at once; the tests of this file that ask for it need LLVM."""
    try:
        use_renderer(variant="llvm_ad_rgb")
    except gc.RenderError as reason:
        pytest.skip(str(reason))


def material(roughness: float, metallic: float, base: tuple[float, float, float] = BASE) -> dict[str, Any]:
    from graycard.synth._mitsuba import _bsdf

    return _bsdf(LambertGGX(base, roughness, metallic))


def directions(seed: int, count: int = COUNT) -> np.ndarray:
    rng = np.random.default_rng(seed)
    z, azimuth = rng.uniform(0.02, 1, count), rng.uniform(0, 2 * np.pi, count)
    across = np.sqrt(1 - z * z)
    return np.stack([across * np.cos(azimuth), across * np.sin(azimuth), z])


def evaluate(content: dict[str, Any], wi: np.ndarray, wo: np.ndarray, lobe: str = "All") -> np.ndarray:
    """The material without the cosine, shape ``(3, N)``."""
    import mitsuba as mi

    from graycard.synth._mitsuba import load

    si, ctx = interaction(wi), mi.BSDFContext()
    ctx.type_mask = getattr(mi.BSDFFlags, lobe)
    value = load(content).eval(ctx, si, mi.Vector3f(wo.astype(np.float32)))
    return np.array(value, dtype=np.float64) / wo[2]


def interaction(wi: np.ndarray) -> Any:
    import drjit as dr
    import mitsuba as mi

    si: Any = dr.zeros(mi.SurfaceInteraction3f, wi.shape[1])
    si.wi = mi.Vector3f(wi.astype(np.float32))
    return si


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
def test_its_value_is_the_formula(llvm: None, roughness: float, metallic: float) -> None:
    wi, wo = directions(1), directions(2)
    found = evaluate(material(roughness, metallic), wi, wo)
    np.testing.assert_allclose(found, formula(wi, wo, roughness, metallic), rtol=2e-4, atol=1e-6)


@pytest.mark.parametrize(("roughness", "metallic"), [(0.2, 0.0), (0.4, 1.0), (0.8, 0.5)])
def test_it_is_reciprocal(llvm: None, roughness: float, metallic: float) -> None:
    wi, wo = directions(3), directions(4)
    there, back = (evaluate(material(roughness, metallic), *w) for w in ((wi, wo), (wo, wi)))
    assert (np.abs(there - back) / np.maximum(there, 1e-3)).max() < 1e-5


@pytest.mark.parametrize(("roughness", "metallic"), [(0.3, 0.0), (0.6, 1.0), (0.5, 0.5)])
def test_lobes_add_up_and_the_diffuse_one_is_lambertian(
    llvm: None, roughness: float, metallic: float
) -> None:
    wi, wo, content = directions(5), directions(6), material(roughness, metallic)
    diffuse, glossy = (evaluate(content, wi, wo, lobe) for lobe in ("DiffuseReflection", "GlossyReflection"))
    np.testing.assert_allclose(diffuse + glossy, evaluate(content, wi, wo), rtol=1e-5)
    expected = np.broadcast_to((1 - metallic) * np.array(BASE)[:, None] / np.pi, diffuse.shape)
    np.testing.assert_allclose(diffuse, expected, rtol=1e-5)


@pytest.mark.parametrize("angle", [0.0, 40.0, 75.0])
@pytest.mark.parametrize(("roughness", "metallic"), [(0.3, 0.0), (0.5, 0.8)])
@pytest.mark.parametrize("lobe", ["All", "DiffuseReflection", "GlossyReflection"])
def test_samples_follow_the_density(
    llvm: None,
    angle: float,
    roughness: float,
    metallic: float,
    lobe: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    import mitsuba as mi

    from graycard.synth._lambert_ggx import register

    monkeypatch.chdir(tmp_path)  # a failing test of Mitsuba's leaves a file in the working folder
    ctx = mi.BSDFContext()
    ctx.type_mask = getattr(mi.BSDFFlags, lobe)
    wi = [float(np.sin(np.radians(angle))), 0.0, float(np.cos(np.radians(angle)))]
    sample, pdf = mi.chi2.BSDFAdapter(register(), material(roughness, metallic), wi=wi, ctx=ctx)
    domain, options = mi.chi2.SphericalDomain(), {"sample_count": 200_000, "res": 51, "ires": 16}
    test = mi.chi2.ChiSquareTest(domain, sample, pdf, sample_dim=3, **options)
    # the level of one test, so that all of this file raise a false alarm once in a thousand runs
    assert test.run(1e-3 / 18)


def reflected(content: dict[str, Any], wi: np.ndarray, seed: int = 1) -> np.ndarray:
    """One unbiased estimate of the directional albedo for each direction, shape ``(3, N)``."""
    import mitsuba as mi

    from graycard.synth._mitsuba import load

    sampler = load({"type": "independent"})
    sampler.seed(seed, wi.shape[1])
    args = interaction(wi), sampler.next_1d(), sampler.next_2d()
    return np.array(load(content).sample(mi.BSDFContext(), *args)[1], dtype=np.float64)


def mean_and_error(samples: np.ndarray) -> tuple[float, float]:
    red = samples[0]
    return float(red.mean()), float(red.std() / np.sqrt(red.size))


@pytest.mark.parametrize("roughness", [0.05, 0.3, 0.7, 1.0])
@pytest.mark.parametrize(
    ("metallic", "base", "angles"),
    [(1.0, 1.0, (0, 45, 75, 85)), (0.0, 0.55, (0, 45, 65)), (0.5, 0.8, (0, 45))],
)
def test_it_returns_no_more_light_than_it_gets(
    llvm: None, roughness: float, metallic: float, base: float, angles: tuple[int, ...]
) -> None:
    content = material(roughness, metallic, (base, base, base))
    for angle in np.radians(angles):
        wi = np.repeat([[np.sin(angle)], [0.0], [np.cos(angle)]], 1 << 16, axis=1)
        albedo, error = mean_and_error(reflected(content, wi))
        assert albedo <= 1 + 4 * error + 1e-4
        assert albedo > 0.25


def test_over_all_directions_it_gains_no_light_up_to_a_base_color_of_nine_tenths(llvm: None) -> None:
    rng = np.random.default_rng(0)
    cosine = np.sqrt(rng.random(1 << 18))  # as light from a uniform sky arrives
    wi = np.stack([np.sqrt(1 - cosine**2), np.zeros_like(cosine), cosine])
    for roughness in (0.1, 0.4, 1.0):
        albedo, error = mean_and_error(reflected(material(roughness, 0.0, (0.9, 0.9, 0.9)), wi))
        assert 0.9 < albedo <= 1 + 4 * error


@pytest.mark.parametrize("lobe", ["All", "DiffuseReflection", "GlossyReflection"])
def test_sampling_and_value_agree(llvm: None, lobe: str) -> None:
    """The albedo by sampling against that by quadrature of the value over the hemisphere."""
    import mitsuba as mi

    from graycard.synth._mitsuba import load

    content, angle = material(0.5, 0.3), np.radians(50)
    towards = np.array([np.sin(angle), 0.0, np.cos(angle)])
    ctx, sampler = mi.BSDFContext(), load({"type": "independent"})
    ctx.type_mask = getattr(mi.BSDFFlags, lobe)
    sampler.seed(3, 1 << 17)
    si = interaction(np.repeat(towards[:, None], 1 << 17, axis=1))
    samples = np.array(load(content).sample(ctx, si, sampler.next_1d(), sampler.next_2d())[1])
    found, error = mean_and_error(samples.astype(np.float64))
    u, v = (np.stack(np.meshgrid(*2 * [(np.arange(400) + 0.5) / 400])).reshape(2, -1))[[0, 1]]
    wo = np.stack([np.sqrt(u) * np.cos(2 * np.pi * v), np.sqrt(u) * np.sin(2 * np.pi * v), np.sqrt(1 - u)])
    wi = np.repeat(towards[:, None], u.size, axis=1)
    expected = np.pi * evaluate(content, wi, wo, lobe)[0].mean()
    assert found == pytest.approx(expected, abs=4 * error + 2e-4)


def test_nothing_comes_from_below(llvm: None) -> None:
    wi, wo = directions(7), directions(8)
    below = wo * np.array([1, 1, -1])[:, None]
    assert (evaluate(material(0.4, 0.2), wi, below) == 0).all()
    assert (evaluate(material(0.4, 0.2), wi * np.array([1, 1, -1])[:, None], wo) == 0).all()


def test_it_exposes_its_parameters(variant: str) -> None:
    import drjit as dr
    import mitsuba as mi

    from graycard.synth._mitsuba import load

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


def ball_under_white_sky(made: LambertGGX) -> Scene:
    camera = gc.Camera.from_fov(6, 6, 8, gc.look_at(np.array([0, -6.0, 0]), np.zeros(3)))
    ball = Thing("ball", Ball((0, 0, 0), 2.0), made)
    sky = gc.EnvironmentLight("sky", "environment.exr")
    return Scene((ball,), (sky,), (gc.View("train_000", "train", camera),), np.ones((8, 16, 3)))


def test_a_white_metal_vanishes_in_a_white_room(variant: str) -> None:
    """White furnace: a nearly smooth metal of base colour 1 loses no light between its microfacets."""
    from graycard.synth._mitsuba import load_scene
    from graycard.synth._views import radiance

    scene = ball_under_white_sky(LambertGGX((1.0, 1.0, 1.0), 0.1, 1.0))
    camera = scene.views[0].camera
    settings = RenderSettings(6, 6, samples=64, max_depth=3)
    mean, variance = radiance(load_scene(scene, camera), camera, [1, 2, 3, 4], settings)
    error = float(np.sqrt(variance[..., 0].mean() / mean[..., 0].size))
    assert error < 5e-3
    assert mean[..., 0].mean() == pytest.approx(1, abs=4 * error + 1e-3)
