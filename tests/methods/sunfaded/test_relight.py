# SPDX-License-Identifier: Apache-2.0
"""Surfaces that were found, under lights that are known."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from graycard import (
    Camera,
    EnvironmentLight,
    GaussianLight,
    LocalLight,
    PointLight,
    RectangleLight,
    SphereLight,
    SphericalGaussian,
    SpotLight,
    look_at,
    methods,
    open_capture,
    open_truth,
    srgb_encode,
)
from graycard.io import silent
from graycard.methods.shading import light_at
from graycard.methods.splat import parameters_of, surfels_on_surface
from graycard.methods.sunfaded import SunFadedScene, SunFadedSettings
from graycard.methods.sunfaded._layers import Lighting
from graycard.methods.sunfaded._light import lamp_parameters
from graycard.methods.sunfaded._model import ALBEDO, AMBIENT

CAMERA = Camera.from_fov(24, 20, 50, look_at(np.array([0.2, -2.0, 1.0]), np.array([0.0, 0.0, 0.2])))
UP = np.array([[0.0, 0.0, 1.0]])
ORIGIN = np.zeros((1, 3))
WHITE = (np.pi, np.pi, np.pi)


def received(light: LocalLight, point: np.ndarray = ORIGIN, normal: np.ndarray = UP) -> np.ndarray:
    return light_at([light], point, normal, CAMERA)[0]


def test_a_point_light_falls_off_with_the_square_and_the_cosine():
    """3 W/sr at the height 2 m, 1.5 m aside: d² = 6.25 m², cosine 0.8."""
    light = PointLight("a", (1.5, 0.0, 2.0), (3.0, 6.0, 0.0))
    np.testing.assert_allclose(received(light), np.array([3, 6, 0]) * 0.8 / 6.25 / np.pi, rtol=1e-12)
    np.testing.assert_array_equal(received(light, normal=-UP), 0)


def test_a_spot_is_full_in_its_beam_and_dark_outside_its_cone():
    def at(angle: float) -> np.ndarray:
        """The axis is that many degrees away from the surface."""
        axis = (float(np.sin(np.radians(angle))), 0.0, -float(np.cos(np.radians(angle))))
        return received(SpotLight("a", (0.0, 0.0, 1.0), axis, WHITE, 10.0, 30.0))

    np.testing.assert_allclose(at(9.9), 1, rtol=1e-12)
    np.testing.assert_allclose(at(20), 0.5, rtol=1e-9)
    np.testing.assert_array_equal(at(30.1), 0)
    sharp = SpotLight("a", (0.0, 0.0, 1.0), (0.0, 0.0, -2.0), WHITE, 30.0, 30.0)
    np.testing.assert_allclose(received(sharp), 1)
    np.testing.assert_array_equal(received(sharp, np.array([[5.0, 0.0, 0.0]])), 0)


def test_lobes_shine_where_they_point():
    lobe = SphericalGaussian((0.0, 0.0, -1.0), 5.0, WHITE)
    np.testing.assert_allclose(received(GaussianLight("a", (0.0, 0.0, 2.0), (lobe,))), 0.25, rtol=1e-12)


def test_a_large_panel_is_an_even_sky():
    """Below the middle of a panel as wide as it is high: the form factor of the textbooks; and one side only.

    A square of the side 2h at the height h sends ``4 / pi a atan a`` with ``a = 1 / sqrt 2`` to a surface
    that faces it (Howell, configuration C-11, four corners).
    """
    panel = RectangleLight("a", (0.0, 0.0, 1.0), (0.0, 1.0, 0.0), (1.0, 0.0, 0.0), (2.0, 2.0, 2.0))
    assert np.cross(panel.half_u, panel.half_v)[2] < 0  # it shines down
    a = 1 / np.sqrt(2)
    np.testing.assert_allclose(received(panel), 2 * 4 / np.pi * a * np.arctan(a), rtol=5e-3)
    turned = replace(panel, half_u=panel.half_v, half_v=panel.half_u)
    np.testing.assert_array_equal(received(turned), 0)


def test_a_sphere_is_a_point_of_its_strength():
    sphere = SphereLight("a", (0.0, 0.0, 2.0), 0.1, (5.0, 5.0, 5.0))
    np.testing.assert_allclose(received(sphere), 5 * 0.01 / 4, rtol=1e-12)


def test_a_lamp_on_the_camera_goes_with_it_and_lights_add_up():
    """30 cm to the right of the lens, in camera axes, is where the camera's right is in the world."""
    on_camera = PointLight("a", (0.3, 0.0, 0.0), (1.0, 2.0, 3.0), "camera")
    turn, place = CAMERA.camera_to_world[:3, :3], CAMERA.position
    x, y, z = place + 0.3 * turn[:, 0]
    in_world = PointLight("b", (x, y, z), (1.0, 2.0, 3.0))
    points = np.array([[0.0, 0.0, 0.0], [0.5, 0.3, 0.0], [np.inf, 0.0, 0.0]])
    normals = np.repeat(UP, 3, axis=0)
    alone = light_at([on_camera], points, normals, CAMERA)
    np.testing.assert_allclose(alone, light_at([in_world], points, normals, CAMERA), rtol=1e-12)
    np.testing.assert_allclose(light_at([on_camera, in_world], points, normals, CAMERA), 2 * alone)
    np.testing.assert_array_equal(alone[2], 0)
    np.testing.assert_array_equal(light_at([], points, normals, CAMERA), 0)


def floor(albedo: float, space: str = "linear") -> SunFadedScene:
    """Discs on the floor; their albedo in the space of the fit."""
    x, y = np.meshgrid(np.linspace(-3, 3, 40), np.linspace(-2, 4, 40))
    points = np.stack([x.ravel(), y.ravel(), np.zeros(x.size)], axis=1)
    discs = surfels_on_surface(points, np.repeat(UP, x.size, axis=0), np.ones_like(points), 1600, 0)
    shared = {**lamp_parameters(0), AMBIENT: torch.tensor([0.3, 0.2, 0.1])}
    parameters = parameters_of(discs, {ALBEDO: torch.full((len(discs), 3), albedo).logit()}, shared)
    settings = SunFadedSettings(space=space)  # pyright: ignore[reportArgumentType]
    return SunFadedScene(parameters, Lighting(settings, 2.0, 2.2))


LAMP = PointLight("flash", (0.3, -0.1, 0.0), (9.0, 8.0, 7.0), "camera")


@pytest.mark.parametrize("space", ["linear", "srgb"])
def test_a_relit_floor_is_albedo_times_known_light(space: str):
    """By hand at each pixel; the lights that were found are gone."""
    shown = 0.4 if space == "linear" else float(srgb_encode(np.array(0.4)))
    relit = floor(shown, space).relight((LAMP,))
    assert relit is not None
    assert isinstance(relit, methods.Decomposition)
    assert relit.lights() == (LAMP,)
    found = relit.render(CAMERA, sorted(relit.provides))
    lamp = CAMERA.camera_to_world[:3, :3] @ np.array(LAMP.position) + CAMERA.position
    rays = CAMERA.rays()
    points = CAMERA.position - rays * CAMERA.position[2] / rays[..., 2:]
    away = lamp - points
    distance = np.linalg.norm(away, axis=-1)
    falloff = away[..., 2] / distance / distance**2
    expected = 0.4 / np.pi * falloff[..., None] * np.array(LAMP.intensity)
    solid = (found["base_color"][..., 0] > 0.98 * 0.4) & (distance < 2.5)
    assert solid.sum() > 100
    np.testing.assert_allclose(found["radiance"][solid], expected[solid], rtol=0.05)
    np.testing.assert_allclose(found["shading"] * found["base_color"], found["radiance"], rtol=1e-5)
    assert found["radiance"].dtype == np.float32


def test_a_relit_picture_has_the_gauge_of_the_albedo():
    """Half the albedo gives half the picture, so that the score, which scales both, undoes it."""
    whole, half = floor(0.6).relight((LAMP,)), floor(0.3).relight((LAMP,))
    assert whole is not None
    assert half is not None
    full = whole.render(CAMERA, ["radiance"])["radiance"]
    np.testing.assert_allclose(half.render(CAMERA, ["radiance"])["radiance"], full / 2, rtol=1e-5)


def test_colour_and_absence_of_lights():
    scene = floor(0.5)
    red, dark = scene.relight((replace(LAMP, intensity=(18.0, 0.0, 0.0)),)), scene.relight(())
    plain = scene.relight((LAMP,))
    assert red is not None
    assert dark is not None
    assert plain is not None
    drawn = red.render(CAMERA, ["radiance"])["radiance"]
    np.testing.assert_allclose(
        drawn[..., 0], 2 * plain.render(CAMERA, ["radiance"])["radiance"][..., 0], rtol=1e-5
    )
    assert not drawn[..., 1:].any()
    assert not dark.render(CAMERA, ["radiance"])["radiance"].any()
    assert scene.lights() != plain.lights()


def test_surroundings_are_not_provided():
    assert floor(0.5).relight((LAMP, EnvironmentLight("sky", "/nowhere.exr"))) is None


def test_a_relit_scene_is_saved_and_loaded(tmp_path: Path):
    relit = floor(0.5).relight((LAMP,))
    assert isinstance(relit, methods.Relightable)
    assert isinstance(relit, SunFadedScene)
    relit.save(tmp_path / "saved")
    loaded = methods.load_method("sunfaded").load(tmp_path / "saved")
    assert loaded.lights() == (LAMP,)
    for layer, values in relit.render(CAMERA, sorted(relit.provides)).items():
        assert np.array_equal(values, loaded.render(CAMERA, [layer])[layer])


def test_true_surfaces_under_the_true_lights_are_the_tiny_scene(make_scene: Callable[..., Path]):
    """Its pictures hold the lamp's light without shadows, so relighting with its own lights gives them."""
    scene = make_scene(train=4, test=2)
    truth, method = open_truth(scene / "truth", check=False), methods.load_method("sunfaded-oracle")
    known = methods.Priors("oracle", {view.name: truth.layers(view) for view in truth.views})
    chosen = methods.settings_of(method, {"iterations": 1})
    found = method.fit(open_capture(scene / "capture", check=False), known, chosen, 0, silent)
    assert isinstance(found, methods.Relightable)
    relit = found.relight(truth.lights())
    assert relit is not None
    for view in truth.views:
        true, drawn = truth.layers(view), relit.render(view.camera, ["radiance"])["radiance"]
        seen = np.isfinite(true["depth"])
        np.testing.assert_allclose(drawn[seen], true["radiance"][seen], atol=5e-3)  # its noise is 1e-3
