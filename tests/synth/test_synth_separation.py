# SPDX-License-Identifier: Apache-2.0
"""The path tracer that splits light: against Mitsuba's own, against single lights, against itself."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from graycard import (
    Camera,
    EnvironmentLight,
    Light,
    PointLight,
    RectangleLight,
    SphereLight,
    SpotLight,
    View,
    look_at,
)
from graycard.benchmarks import load_suite, suite_names
from graycard.layers import find_fault
from graycard.synth import Ball, Glossy, LambertGGX, Matte, Quad, RenderSettings, Scene, Thing, use_renderer
from graycard.synth._scene import Material, surface_of

Judge = Callable[[str, float, float], None]

SETTINGS = RenderSettings(24, 20, samples=64, max_depth=5)
SEEDS = [1, 2, 3, 4]

PANEL = RectangleLight("panel", (-0.8, 0.3, 2.0), (0, 0.3, 0), (0.3, 0, 0), (5, 4, 3))
BULB = SphereLight("bulb", (0.9, 0.9, 0.5), 0.12, (8, 8, 9))
POINT = PointLight("point", (0.5, -0.8, 1.6), (2.0, 2.5, 3.0))
SPOT = SpotLight("spot", (-0.5, -0.9, 1.8), (0.3, 0.5, -1.0), (6, 6, 5), 12.0, 35.0)
SKY = EnvironmentLight("sky", "environment.exr")
LIGHTS: tuple[Light, ...] = (PANEL, POINT, BULB, SKY, SPOT)

MATERIALS: dict[str, Material] = {
    "matte": Matte((0.6, 0.5, 0.2)),
    "principled": Glossy((0.6, 0.5, 0.2), 0.35),
    "papers": LambertGGX((0.6, 0.5, 0.2), 0.35),
    "metal": LambertGGX((0.6, 0.5, 0.2), 0.35, 1.0),
}


pytestmark = pytest.mark.usefixtures("llvm")


def room(material: Material, lights: tuple[Light, ...] = LIGHTS) -> Scene:
    """A floor and a ball of the material under all kinds of lights; the bulb is in the picture."""
    floor = Thing("floor", Quad((0, 0, 0), (3, 0, 0), (0, 3, 0)), material)
    ball = Thing("ball", Ball((0.1, 0.1, 0.5), 0.5), material)
    surfaces = [surface_of(light) for light in LIGHTS if isinstance(light, RectangleLight | SphereLight)]
    lit = {light.name for light in lights}
    surfaces = [thing if thing.name in lit else replace(thing, light="") for thing in surfaces]
    pose = look_at(np.array([1.2, -2.4, 2.2]), np.array([0.2, 0.2, 0.4]))
    camera = Camera.from_fov(SETTINGS.width, SETTINGS.height, 55.0, pose)
    sky = np.linspace(0.05, 0.3, 8 * 16 * 3).reshape(8, 16, 3)
    return Scene((floor, ball, *surfaces), lights, (View("train_000", "train", camera),), sky)


def loaded(scene: Scene) -> tuple[Any, Camera]:
    from graycard.synth.renderer._mitsuba import load_scene

    camera = scene.views[0].camera
    return load_scene(scene, camera), camera


def separated(
    scene: Scene, settings: RenderSettings = SETTINGS, seeds: list[int] = SEEDS
) -> dict[str, np.ndarray]:
    from graycard.synth.layers._separation import named_layers, part_names, separated_images

    made, camera = loaded(scene)
    return named_layers(separated_images(made, camera, seeds, settings), part_names(made, scene))


def by_path(
    scene: Scene, settings: RenderSettings = SETTINGS, seeds: list[int] = SEEDS
) -> tuple[np.ndarray, np.ndarray]:
    """The radiance and its variance as Mitsuba's own integrator gives them, float32."""
    from graycard.synth.layers._separation import estimate
    from graycard.synth.layers._views import radiance_images

    layers = estimate("radiance", radiance_images(*loaded(scene), seeds, settings))
    return layers["radiance"], layers["radiance.var"]


def total_of(layers: dict[str, np.ndarray], *stems: str) -> np.ndarray:
    return sum((layers[k].astype(np.float64) for k in layers if k.startswith(stems)), np.zeros(()))


PART_STEMS = ("emitted", "direct.", "indirect.")


@pytest.mark.parametrize("material", MATERIALS.values(), ids=MATERIALS.keys())
def test_parts_add_up_and_none_is_negative(material: Material) -> None:
    layers = separated(room(material))
    assert len(layers) == 4 + 1 + 4 * len(LIGHTS)
    whole = layers["radiance"].astype(np.float64)
    assert (np.abs(total_of(layers, *PART_STEMS) - whole) / np.maximum(whole, 1e-3)).max() < 5e-7
    for name, values in layers.items():
        assert find_fault(name, values, SETTINGS.height, SETTINGS.width) is None
        assert values.dtype == np.float32
        assert values.min() >= -1e-6 * whole.max()


@pytest.mark.parametrize(
    ("name", "depth"), [("matte", 5), ("principled", 5), ("papers", 1), ("papers", 2), ("metal", 9)]
)
def test_the_same_seeds_give_the_picture_of_mitsubas_path(name: str, depth: int) -> None:
    """The same estimator fed the same random numbers: equal but where rounding sends a path elsewhere."""
    scene, settings = room(MATERIALS[name]), replace(SETTINGS, max_depth=depth)
    expected, variance = by_path(scene, settings)
    found = separated(scene, settings)
    off = np.abs(found["radiance"] - expected) / np.maximum(expected, 1e-3)
    assert np.quantile(off, 0.95) < 1e-5
    assert found["radiance"].mean() == pytest.approx(expected.mean(), rel=1e-3)
    np.testing.assert_allclose(found["radiance.var"].mean(), variance.mean(), rtol=0.05, atol=1e-12)


def test_other_seeds_agree_with_mitsubas_path_within_the_noise() -> None:
    scene, settings = room(MATERIALS["papers"]), replace(SETTINGS, samples=576)
    expected, variance = by_path(scene, settings, [5, 6, 7, 8])
    found = separated(scene, settings)
    error = np.sqrt((variance + found["radiance.var"]).mean() / expected.size)
    # the three channels of a pixel share their paths, so the mean of all varies up to sqrt(3) times more
    assert abs(found["radiance"].mean() - expected.mean()) < 4 * np.sqrt(3) * error
    assert error < 2e-3 * expected.mean()


def test_direct_parts_and_emission_are_a_path_of_two_segments() -> None:
    scene = room(MATERIALS["principled"])
    layers = separated(scene)
    expected, _ = by_path(scene, replace(SETTINGS, max_depth=2))
    off = np.abs(total_of(layers, "emitted", "direct.") - expected) / np.maximum(expected, 1e-3)
    assert np.quantile(off, 0.95) < 1e-5
    emitted, _ = by_path(scene, replace(SETTINGS, max_depth=1))
    np.testing.assert_allclose(layers["emitted"], emitted, rtol=1e-5)
    assert 0 < (layers["emitted"] > 0).mean() < 0.5


RENDERS = 36
"""Independent renders of an estimate: enough that 4 sigma of Student's t is a false alarm in 3000."""


def reflected(scene: Scene, first_seed: int, samples: int = 64) -> dict[str, np.ndarray]:
    """Means over the picture of the parts of each light by independent renders, ``<part>.<light>``."""
    from graycard.synth.layers._separation import FIRST_PART, part_names, separated_images

    made, camera = loaded(scene)
    settings = replace(SETTINGS, samples=RENDERS * samples)
    seeds = list(range(first_seed, first_seed + RENDERS))
    images = separated_images(made, camera, seeds, settings)[:, FIRST_PART:].mean(axis=(2, 3, 4))
    return dict(zip(part_names(made, scene)[1:], images.T, strict=True))


def judge_equal(judge: Judge, what: str, found: np.ndarray, expected: np.ndarray, scale: float) -> None:
    """Judge that means of independent estimates are equal within 4 sigma, with a sigma that tells."""
    error = np.sqrt(found.var(ddof=1) / len(found) + expected.var(ddof=1) / len(expected))
    judge(f"{what}: standard errors", abs(found.mean() - expected.mean()) / error, 4)
    judge(f"{what}: standard error relative to all light", error / scale, 5e-3)


def test_the_parts_of_a_light_are_the_picture_under_it_alone(judge: Judge) -> None:
    parts = reflected(room(MATERIALS["papers"]), 1)
    for number, light in enumerate(LIGHTS, start=1):
        alone = reflected(room(MATERIALS["papers"], (light,)), 1000 * number)
        total = sum(float(values.mean()) for values in alone.values())
        for part in parts_of_a_light():
            name = f"{part}.{light.name}"
            judge_equal(judge, name, parts[name], alone[name], total)


def parts_of_a_light() -> tuple[str, ...]:
    from graycard.synth.layers._separation import PARTS

    return PARTS


def test_lobes_of_materials_that_have_but_one() -> None:
    matte, metal = separated(room(MATERIALS["matte"])), separated(room(MATERIALS["metal"]))
    whole = matte["radiance"].max()
    assert total_of(matte, "direct.specular", "indirect.specular").max() < 1e-6 * whole
    assert total_of(metal, "direct.diffuse", "indirect.diffuse").max() == 0
    # without a specular reflectance the principled material is its diffuse lobe alone
    dull = separated(room(Glossy((0.6, 0.5, 0.2), 0.6, 0.0, specular=0.0)))
    assert total_of(dull, "direct.specular", "indirect.specular").mean() < 2e-3 * dull["radiance"].mean()


def test_the_diffuse_lobe_of_the_papers_material_is_a_matte_one(judge: Judge) -> None:
    """Direct light: the diffuse parts of a dielectric are those of a matte surface of its base colour."""
    glossy, matte = reflected(room(MATERIALS["papers"]), 1), reflected(room(MATERIALS["matte"]), 1000)
    for light in LIGHTS:
        name = f"direct.diffuse.{light.name}"
        judge_equal(judge, name, glossy[name], matte[name], float(matte[name].mean()))


def test_lights_keep_their_names() -> None:
    """Only what a light reaches is booked under it."""
    from graycard.synth.layers._separation import light_names

    scene = room(MATERIALS["matte"])
    made, _ = loaded(scene)
    assert sorted(light_names(made, scene)) == sorted(light.name for light in LIGHTS)
    dark = room(MATERIALS["matte"], (replace(PANEL, radiance=(0.0, 0.0, 0.0)), POINT))
    layers = separated(dark)
    assert total_of(layers, *(f"{part}.panel" for part in parts_of_a_light())).max() == 0
    assert total_of(layers, *(f"{part}.point" for part in parts_of_a_light())).mean() > 0.01


def test_the_same_seeds_give_the_same_bits_with_any_number_of_threads() -> None:
    scene = room(MATERIALS["papers"])
    use_renderer(threads=1, variant="llvm_ad_rgb")
    one = separated(scene)
    use_renderer(threads=2, variant="llvm_ad_rgb")
    two = separated(scene)
    assert all(np.array_equal(one[name], two[name]) for name in one)
    other = separated(scene, seeds=[5, 6, 7, 8])
    assert not np.array_equal(one["radiance"], other["radiance"])


@pytest.mark.parametrize("most", [24 * 144 * 3, 24 * 144 * 7 + 5, 1])
def test_a_picture_of_too_many_paths_is_traced_in_bands(monkeypatch: pytest.MonkeyPatch, most: int) -> None:
    """The first rows are as before; the others have other seeds, the same strata, and so the same noise."""
    from graycard.synth.renderer import _mitsuba, _wavefront

    scene, settings = room(MATERIALS["papers"]), replace(SETTINGS, samples=576)
    whole = separated(scene, settings)
    monkeypatch.setattr(_wavefront, "MOST_PATHS", most)
    rows = max(1, most // (24 * 144))
    _, camera = loaded(scene)
    found = _wavefront.bands(_mitsuba.sensor(camera, 144))
    assert [band.pixels // 24 for band in found] == [min(rows, 20 - first) for first in range(0, 20, rows)]
    assert [band.first for band in found] == [24 * first for first in range(0, 20, rows)]
    banded = separated(scene, settings)
    assert np.array_equal(banded["radiance"][:rows], whole["radiance"][:rows])
    assert not np.array_equal(banded["radiance"][rows:], whole["radiance"][rows:])
    typical = [np.median(found["radiance.var"]) for found in (banded, whole)]
    assert typical[0] == pytest.approx(typical[1], rel=0.3)
    error = np.sqrt(2 * whole["radiance.var"].mean() / whole["radiance"].size)
    assert abs(whole["radiance"].mean() - banded["radiance"].mean()) < 4 * np.sqrt(3) * error
    parts = [v for name, v in banded.items() if name.startswith(("direct", "indirect", "emitted"))]
    assert np.allclose(np.sum(parts, axis=0), banded["radiance"], rtol=1e-4, atol=1e-5)
    again = separated(scene, settings)
    assert all(np.array_equal(banded[name], again[name]) for name in banded)


def test_bands_meet_in_the_right_rows(monkeypatch: pytest.MonkeyPatch) -> None:
    """An albedo of a matte scene is known exactly at each pixel, whatever the seed."""
    from graycard.synth.layers._albedo import directional_albedo
    from graycard.synth.renderer import _wavefront

    made, camera = loaded(room(MATERIALS["matte"]))
    whole = directional_albedo(made, camera, 1)["albedo"]
    monkeypatch.setattr(_wavefront, "MOST_PATHS", 24 * 256 * 3)
    banded = directional_albedo(made, camera, 1)["albedo"]
    assert len(np.unique(whole.reshape(-1, 3), axis=0)) > 1
    assert np.allclose(whole, banded, atol=1e-6)


def test_pictures_of_all_suites_of_at_most_256_pixels_are_in_one_band() -> None:
    """They are those that were published."""
    suites = [load_suite(name) for name in suite_names()]
    settings = {suite.render_of(scene) for suite in suites for scene in suite.scenes}
    small = [one for one in settings if max(one.width, one.height) <= 256]
    assert len(small) > 5
    assert not any(one.in_bands for one in small)
    assert any(one.in_bands for one in settings)


def test_a_lambertian_surface_shows_albedo_times_shading() -> None:
    """The identity L = albedo S, with the same random numbers."""
    from graycard.synth.layers._separation import separated_images
    from graycard.synth.layers._views import surface_layers
    from graycard.synth.renderer._scattering import white_first
    from graycard.synth.renderer._wavefront import centre_rays

    scene = room(MATERIALS["matte"])
    made, camera = loaded(scene)
    images = separated_images(made, camera, SEEDS, SETTINGS, centre_rays)
    reflected = (images[:, 0] - images[:, 1]).mean(axis=0)
    color = surface_layers(made, scene, camera)["base_color"]
    white = separated_images(made, camera, SEEDS, SETTINGS, centre_rays, white_first)
    shading = (white[:, 0] - white[:, 1]).mean(axis=0)
    assert np.abs(reflected - color * shading).max() < 1e-6 * max(1.0, reflected.max())
    assert reflected.mean() > 0.05


def test_shading_is_what_white_surfaces_show() -> None:
    """Direct light from samples on each light and bounced light, against one path tracer for both."""
    from graycard.synth.layers._irradiance import light_layers
    from graycard.synth.layers._separation import separated_images
    from graycard.synth.renderer._scattering import white_first
    from graycard.synth.renderer._wavefront import centre_rays

    scene = room(MATERIALS["papers"])
    made, camera = loaded(scene)
    white = separated_images(made, camera, SEEDS, SETTINGS, centre_rays, white_first)
    expected = white[:, 0] - white[:, 1]
    found = light_layers(made, scene, camera, [9, 10, 11, 12], SETTINGS)
    noise = expected.var(axis=0, ddof=1) / len(SEEDS) + found["shading.var"]
    error = found["shading"] - expected.mean(axis=0)
    assert abs(error.mean()) < 4 * np.sqrt(noise.sum()) / noise.size
    assert (found["shading.var"] > 0).mean() > 0.3


def test_shading_of_a_floor_is_the_closed_form(judge: Judge) -> None:
    """A point light over a plane: S = I cos / (pi d²), whatever the floor is made of."""
    from graycard.synth.layers._irradiance import light_layers
    from graycard.synth.layers._views import surface_layers

    floor = Thing("floor", Quad((0, 0, 0), (9, 0, 0), (0, 9, 0)), LambertGGX((0.2, 0.3, 0.4), 0.3, 0.7))
    camera = room(MATERIALS["matte"]).views[0].camera
    scene = Scene((floor,), (POINT,), (View("train_000", "train", camera),))
    made, _ = loaded(scene)
    light = light_layers(made, scene, camera, SEEDS, replace(SETTINGS, max_depth=2, samples=4))
    surface = surface_layers(made, scene, camera)
    seen = surface["object_id"] > 0
    assert seen.mean() > 0.8
    # from float32 in what Mitsuba was given, else its rounding is most of the error
    to_light = np.array(POINT.position, dtype=np.float32).astype(np.float64) - surface["position"][seen]
    irradiance = (to_light[:, 2] / np.linalg.norm(to_light, axis=-1) ** 3)[:, None] * np.array(
        POINT.intensity
    )
    error = np.abs(light["shading"][seen] * np.pi / irradiance - 1)
    judge("shading under a point light: largest relative error", error.max(), 1e-6)
    assert light["shading.var"].max() == 0


@pytest.mark.parametrize(("roughness", "metallic"), [(0.15, 0.0), (0.5, 0.4), (0.9, 0.0)])
def test_the_diffuse_lobe_of_the_principled_material_is_mitsubas(roughness: float, metallic: float) -> None:
    """Against Mitsuba's value of a material whose specular lobe is dark, for a share of ``1 - metallic``."""
    import drjit as dr
    import mitsuba as mi

    from graycard.synth.renderer._mitsuba import _bsdf, load
    from graycard.synth.renderer._scattering import _diffuse_values

    rng = np.random.default_rng(3)
    wi, wo = rng.normal(size=(2, 3, 4000))
    wi, wo = (np.abs(w) / np.linalg.norm(w, axis=0) for w in (wi, wo))
    si: Any = dr.zeros(mi.SurfaceInteraction3f, 4000)
    si.wi = mi.Vector3f(wi.astype(np.float32))
    out = mi.Vector3f(wo.astype(np.float32))
    color = (0.6, 0.5, 0.2)
    dull = load(_bsdf(Glossy(color, roughness, 0.0, specular=0.0)))
    expected = (1 - metallic) * np.array(dull.eval(mi.BSDFContext(), si, out))
    made = load(_bsdf(Glossy(color, roughness, metallic)))
    pointer = mi.BSDFPtr(made)
    found = np.array(_diffuse_values(pointer, si, (out,), mi.Bool(True))[0])
    np.testing.assert_allclose(found, expected, rtol=2e-3, atol=1e-5)
    assert found.min() > 0
