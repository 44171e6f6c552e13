# SPDX-License-Identifier: Apache-2.0
"""The light of spherical Gaussians against its closed form, through our own scenes and conventions."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from graycard import Camera, GaussianLight, PointLight, SphericalGaussian, world_position
from graycard.synth import Ball, RenderSettings, Scene

ALBEDO = np.array((0.5, 0.4, 0.3))
MakePlane = Callable[..., Scene]

DOWN = SphericalGaussian((0.0, 0.0, -1.0), 6.0, (7.0, 6.0, 5.0))
ASIDE = SphericalGaussian((0.6, 0.0, -0.8), 25.0, (0.5, 2.0, 8.0))
ALL_ROUND = SphericalGaussian((0.0, 1.0, 0.0), 0.0, (0.3, 0.2, 0.1))
WORLD = GaussianLight("lamp", (0.4, -0.3, 1.7), (DOWN, ASIDE, ALL_ROUND))
MOUNTED = GaussianLight(
    "lamp", (0.5, -0.2, 0.1), (SphericalGaussian((0.0, 0.6, 0.8), 4.0, (7.0, 6.0, 5.0)),), "camera"
)


def rendered(scene: Scene) -> np.ndarray:
    from graycard.synth.layers._views import _image
    from graycard.synth.renderer._mitsuba import centre_sensor, load, load_scene

    camera = scene.views[0].camera
    path = load({"type": "path", "max_depth": 2})
    return _image(load_scene(scene, camera), centre_sensor(camera), path, spp=1)


def by_hand(scene: Scene, light: GaussianLight) -> np.ndarray:
    """Radiance a / pi I(w) cos / d² of the floor in float64."""
    camera = scene.views[0].camera
    rays = camera.rays()
    floor = camera.position - (camera.position[2] / rays[..., 2])[..., None] * rays
    to_light = world_position(light, camera) - floor
    distance = np.linalg.norm(to_light, axis=-1, keepdims=True)
    away = -to_light / distance
    away = away @ camera.camera_to_world[:3, :3] if light.frame == "camera" else away
    return ALBEDO / np.pi * light.intensity_towards(away) * to_light[..., 2:] / distance**3


@pytest.mark.parametrize("light", [WORLD, MOUNTED], ids=["world", "camera"])
def test_over_a_plane(variant: str, make_plane: MakePlane, light: GaussianLight) -> None:
    """To a few 1e-6: a float32 ray meets the floor 1e-7 of its length aside, and a sharp lobe sees that."""
    scene = make_plane((light,))
    found, expected = rendered(scene), by_hand(scene, light)
    np.testing.assert_allclose(found, expected, rtol=5e-6)
    assert np.sqrt(np.mean((found / expected - 1) ** 2)) < 1e-6


def test_at_points_that_float32_holds_exactly(variant: str) -> None:
    """I(w) / d² to 1e-6 where nothing but the emitter rounds."""
    import mitsuba as mi

    emitter = emitter_of(GaussianLight("a", (0.5, -0.25, 1.75), (DOWN, ASIDE, ALL_ROUND)))
    light = GaussianLight("a", (0.5, -0.25, 1.75), (DOWN, float32_axis(ASIDE), ALL_ROUND))
    for point in np.random.default_rng(0).uniform(-2, 2, (60, 3)).astype(np.float32).tolist():
        away = np.array(point) - light.position
        distance = np.linalg.norm(away)
        it = mi.Interaction3f()
        it.p = mi.Point3f(point)
        ds, sent = emitter.sample_direction(it, mi.Point2f(0.5), True)
        expected = light.intensity_towards(away / distance) / distance**2
        np.testing.assert_allclose(np.array(sent).ravel(), expected, rtol=1e-6)
        np.testing.assert_allclose(np.array(ds.d).ravel(), -away / distance, atol=2e-7)
        np.testing.assert_allclose(np.array(ds.dist), distance, rtol=2e-7)


def float32_axis(lobe: SphericalGaussian) -> SphericalGaussian:
    x, y, z = np.array(lobe.axis, np.float32).astype(float).tolist()
    return SphericalGaussian((x, y, z), lobe.sharpness, lobe.amplitude)


def emitter_of(light: GaussianLight, weight: float = 1.0) -> Any:
    from graycard.synth.renderer._gaussian_light import gaussian_emitter
    from graycard.synth.renderer._mitsuba import load

    camera = Camera.from_fov(4, 4, 50, np.eye(4))
    return load(gaussian_emitter(light, camera, {"sampling_weight": weight}))


@pytest.mark.parametrize("sharpness", [0.0, 0.5, 8.0, 60.0])
def test_its_flux(sharpness: float) -> None:
    """The integral of ``a exp(s (w . m - 1))`` over the sphere is ``2 pi a / s (1 - exp(-2 s))``."""
    lobe = SphericalGaussian((0.0, 0.6, 0.8), sharpness, (3.0, 2.0, 1.0))
    z, weights = np.polynomial.legendre.leggauss(160)
    azimuth = 2 * np.pi * np.arange(160) / 160
    across = np.sqrt(1 - z * z)[:, None]
    parts = across * np.cos(azimuth), across * np.sin(azimuth), z[:, None] + 0 * azimuth
    value = GaussianLight("a", (0, 0, 0), (lobe,)).intensity_towards(np.stack(parts, axis=-1))
    flux = (value.mean(axis=1) * weights[:, None]).sum(axis=0) * 2 * np.pi
    share = 2 if sharpness == 0 else -np.expm1(-2 * sharpness) / sharpness
    np.testing.assert_allclose(flux, 2 * np.pi * share * np.array(lobe.amplitude), rtol=1e-12)


def test_the_flux_that_arrives_in_a_closed_room_is_all_of_it(scalar: str) -> None:
    """Irradiance over the inside of a sphere around the light, by the emitter itself."""
    import mitsuba as mi

    emitter = emitter_of(GaussianLight("a", (0.2, 0.1, 0.3), (ASIDE,)))
    z, weights = np.polynomial.legendre.leggauss(32)
    total = np.zeros(3)
    for cosine, weight in zip(z, weights, strict=True):
        for azimuth in 2 * np.pi * np.arange(64) / 64:
            across = 2.0 * np.sqrt(1 - cosine**2)
            it = mi.Interaction3f()
            it.p = mi.Point3f(
                float(0.2 + across * np.cos(azimuth)),
                float(0.1 + across * np.sin(azimuth)),
                float(0.3 + 2 * cosine),
            )
            ds, irradiance = emitter.sample_direction(it, [0.5, 0.5], True)
            assert ds.delta
            total += np.array(irradiance) * 4.0 * weight * 2 * np.pi / 64
    expected = 2 * np.pi * np.array(ASIDE.amplitude) / 25.0
    np.testing.assert_allclose(total, expected, rtol=1e-4)


def test_no_ray_meets_it(variant: str) -> None:
    import drjit as dr
    import mitsuba as mi

    emitter = emitter_of(WORLD, 3.0)
    si = dr.zeros(mi.SurfaceInteraction3f)
    assert emitter.sampling_weight() == 3.0
    assert not np.array(emitter.eval(si)).any()
    ds, sent = emitter.sample_direction(si, mi.Point2f(0.5), True)
    assert not np.array(emitter.pdf_direction(si, ds)).any()
    np.testing.assert_array_equal(np.array(emitter.eval_direction(si, ds)), np.array(sent))
    assert emitter.flags() == mi.EmitterFlags.DeltaPosition
    assert emitter.bbox().contains(mi.ScalarPoint3f(0.4, -0.3, 1.7))
    assert "3 lobes" in str(emitter)


def test_its_visibility_is_exact_and_its_part_is_its_own(llvm: str, make_plane: MakePlane) -> None:
    """A ball shades the floor: visibility is 0 or 1, and the direct part is the closed form times it."""
    from graycard.synth.layers._direct_light import direct_light
    from graycard.synth.layers._separation import light_names, separated_images
    from graycard.synth.layers._views import surface_layers
    from graycard.synth.renderer._mitsuba import load_scene
    from graycard.synth.renderer._wavefront import centre_rays

    scene = make_plane((WORLD, PointLight("other", (-1, 1, 2), (1, 1, 1))), Ball((0.3, 0, 0.8), 0.25))
    camera, settings = scene.views[0].camera, RenderSettings(24, 20, 2, 1, 16, 2)
    loaded = load_scene(scene, camera)
    assert sorted(light_names(loaded, scene)) == ["lamp", "other"]
    lamp = light_names(loaded, scene).index("lamp")
    visible = direct_light(loaded, camera, [1], 4).visibility()[lamp]
    assert set(np.unique(visible)) == {0.0, 1.0}
    images = separated_images(loaded, camera, [1], settings, centre_rays)[0]
    direct = images[2 + 4 * lamp]
    floor = surface_layers(loaded, scene, camera)["object_id"] == 1
    expected = by_hand(scene, WORLD) * visible[..., None]
    assert 0.02 < (visible[floor] == 0).mean() < 0.5
    np.testing.assert_allclose(direct[floor] > 0, expected[floor] > 0)
    whole = expected[floor].sum()
    assert direct[floor].sum() == pytest.approx(whole, rel=0.05)  # the light is chosen at random


def test_a_sampling_weight_changes_no_mean(llvm: str, make_plane: MakePlane) -> None:
    scene = make_plane((WORLD,))
    weighted = replace(scene, light_weights={"lamp": 5.0})
    np.testing.assert_array_equal(rendered(weighted), rendered(scene))
