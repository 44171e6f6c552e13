# SPDX-License-Identifier: Apache-2.0
"""Physics of a picture: surfaces, materials and lights in their places, and the variance of a render."""

from collections.abc import Callable

import numpy as np
import pytest

from graycard import Camera, RectangleLight, SphereLight, View, look_at
from graycard.synth import Ball, Glossy, Matte, Quad, RenderSettings, Scene, Texture, Thing
from graycard.synth._scene import surface_of

ALBEDO = np.array((0.5, 0.4, 0.3))
MakePlane = Callable[..., Scene]
Judge = Callable[[str, float, float], None]


def at_centres(scene: Scene, depth: int = 2) -> np.ndarray:
    """Radiance at the pixel centres; without noise where all lights are points."""
    from graycard.synth.layers._views import _image
    from graycard.synth.renderer._mitsuba import centre_sensor, load, load_scene

    camera = scene.views[0].camera
    path = load({"type": "path", "max_depth": depth})
    return _image(load_scene(scene, camera), centre_sensor(camera), path, spp=1)


def surfaces(scene: Scene) -> dict[str, np.ndarray]:
    from graycard.synth.layers._views import surface_layers
    from graycard.synth.renderer._mitsuba import load_scene

    camera = scene.views[0].camera
    return surface_layers(load_scene(scene, camera), scene, camera)


def points(scene: Scene, depth: np.ndarray) -> np.ndarray:
    camera = scene.views[0].camera
    rays = camera.rays()
    return camera.position + (depth / (rays @ camera.forward))[..., None] * rays


def floor_points(scene: Scene) -> np.ndarray:
    """Return the points at which the camera's rays meet z = 0, by hand."""
    camera = scene.views[0].camera
    rays = camera.rays()
    return camera.position - (camera.position[2] / rays[..., 2])[..., None] * rays


def test_depth_and_position_of_a_plane(variant: str, make_plane: MakePlane, judge: Judge) -> None:
    scene = make_plane()
    layers = surfaces(scene)
    off = np.abs(points(scene, layers["depth"]) - floor_points(scene)).max()
    judge("depth of a plane: largest error of the point, m", off, 4e-6)
    off = np.abs(layers["position"] - floor_points(scene)).max()
    judge("position of a plane: largest error, m", off, 4e-6)
    np.testing.assert_allclose(layers["normal"], np.broadcast_to((0, 0, 1.0), (20, 24, 3)), atol=1e-6)
    np.testing.assert_allclose(layers["base_color"], np.broadcast_to(ALBEDO, (20, 24, 3)), atol=1e-6)
    assert (layers["object_id"] == 1).all()
    assert layers["object_id"].dtype == np.uint32


def test_depth_and_normal_of_a_ball(variant: str, make_plane: MakePlane, judge: Judge) -> None:
    centre, radius = np.array((0.2, 0.1, 0.6)), 0.6
    scene = make_plane(ball=Ball((0.2, 0.1, 0.6), radius))
    layers = surfaces(scene)
    on_ball = layers["object_id"] == 2
    assert on_ball.sum() > 40
    p = points(scene, layers["depth"])[on_ball]
    judge(
        "ball: largest distance from its surface, m",
        np.abs(np.linalg.norm(p - centre, axis=-1) - radius).max(),
        2e-6,
    )
    judge(
        "ball: largest error of the normal",
        np.abs(layers["normal"][on_ball] - (p - centre) / radius).max(),
        4e-6,
    )


def test_background_has_no_surface(variant: str) -> None:
    camera = Camera.from_fov(8, 6, 60, look_at(np.zeros(3), np.array([1.0, 0, 0])))
    ball = Thing("ball", Ball((3, 0, 0), 0.4), Matte((0.5, 0.5, 0.5)))
    layers = surfaces(Scene((ball,), (), (View("train_000", "train", camera),)))
    empty = layers["object_id"] == 0
    assert 0 < empty.sum() < empty.size
    assert np.isposinf(layers["depth"][empty]).all()
    assert (layers["normal"][empty] == 0).all()
    assert (layers["base_color"][empty] == 0).all()
    assert np.isfinite(layers["depth"][~empty]).all()


@pytest.mark.parametrize("where", [(0.3, -0.4, 0.7), (-0.6, 0.5, 0.2), (0.1, 0.9, 1.1)])
def test_a_bright_dot_lands_where_the_camera_projects_it(
    scalar: str, judge: Judge, where: tuple[float, float, float]
) -> None:
    """A camera whose pixel centres were at whole numbers would be off by half a pixel."""
    from graycard.synth.layers._views import radiance_images
    from graycard.synth.renderer._mitsuba import load_scene

    pose = look_at(np.array([1.2, -2.0, 2.5]), np.array([0.1, 0.2, 0.3]))
    camera = Camera.from_fov(96, 64, 60, pose)
    light = SphereLight("dot", where, 0.07, (1, 1, 1))
    scene = Scene((surface_of(light),), (light,), (View("train_000", "train", camera),))
    settings = RenderSettings(96, 64, samples=256, max_depth=1)
    images = radiance_images(load_scene(scene, camera), camera, [1, 2, 3, 4], settings)
    image = images.mean(axis=0)[..., 0]
    x, y = np.meshgrid(np.arange(96) + 0.5, np.arange(64) + 0.5)
    found = np.array([(x * image).sum(), (y * image).sum()]) / image.sum()
    expected, z = camera.project(np.array(where))
    judge("dot: distance from where it is projected, pixels", float(np.linalg.norm(found - expected)), 0.05)
    assert surfaces(scene)["depth"].min() == pytest.approx(z - 0.07, abs=0.02)


def test_a_rectangle_light_shines_along_u_cross_v(scalar: str, make_plane: MakePlane) -> None:
    down = RectangleLight("panel", (0, 0, 2), (0, 0.3, 0), (0.3, 0, 0), (5, 5, 5))
    up = RectangleLight("panel", (0, 0, 2), (0.3, 0, 0), (0, 0.3, 0), (5, 5, 5))
    lit, dark = (at_centres(with_surface(make_plane((light,)), light)) for light in (down, up))
    assert dark.max() == 0
    assert lit.mean() > 0.01


def with_surface(scene: Scene, light: RectangleLight | SphereLight) -> Scene:
    return Scene((*scene.things, surface_of(light)), scene.lights, scene.views, scene.sky)


@pytest.mark.parametrize("metallic", [0.0, 1.0])
def test_base_color_of_a_principled_material_is_its_parameter(variant: str, metallic: float) -> None:
    camera = Camera.from_fov(8, 8, 30, look_at(np.array([0, -4.0, 0]), np.zeros(3)))
    ball = Thing("ball", Ball((0, 0, 0), 2.0), Glossy((0.6, 0.3, 0.1), 0.3, metallic))
    layers = surfaces(Scene((ball,), (), (View("train_000", "train", camera),)))
    np.testing.assert_allclose(layers["base_color"], np.broadcast_to((0.6, 0.3, 0.1), (8, 8, 3)), atol=1e-6)


def test_a_texture_stands_upright_and_repeats(variant: str) -> None:
    """A board that faces the camera shows row 0 at its top and column 0 at its left, twice."""
    pixels = np.zeros((2, 2, 3))
    pixels[0, 0], pixels[0, 1], pixels[1, 0], pixels[1, 1] = (0.1,) * 3, (0.2,) * 3, (0.3,) * 3, (0.4,) * 3
    board = Quad((0, 0, 0), (1, 0, 0), (0, 0, 1))
    thing = Thing("board", board, Matte(Texture(pixels, (2, 1), smooth=False)))
    # a field of view of exactly the board: 4 x 2 pixels, one a cell
    pose = look_at(np.array([0, -4.0, 0]), np.zeros(3))
    camera = Camera.from_fov(4, 4, 2 * np.degrees(np.arctan(0.25)), pose)
    layers = surfaces(Scene((thing,), (), (View("train_000", "train", camera),)))
    np.testing.assert_allclose(layers["base_color"][0, :, 0], (0.1, 0.2, 0.1, 0.2), atol=1e-6)
    np.testing.assert_allclose(layers["base_color"][3, :, 0], (0.3, 0.4, 0.3, 0.4), atol=1e-6)


def test_normals_face_the_camera_where_interpolation_or_the_side_does_not(scalar: str) -> None:
    from graycard.synth.layers._views import _facing

    camera = Camera.from_fov(3, 1, 1.0, look_at(np.array([0, -4.0, 0]), np.zeros(3)))
    toward, away = np.array([0.6, -0.8, 0]), np.array([0.8, 0.6, 0])
    shading = np.stack([toward, away, -toward])[None]
    geometric = np.stack([toward, np.array([0.995, -0.0998749, 0]), -toward])[None]
    expected = np.stack([toward, geometric[0, 1], toward])[None]
    np.testing.assert_allclose(_facing(shading, geometric, camera), expected, atol=1e-6)


def test_ids_do_not_depend_on_what_else_is_loaded(variant: str, make_plane: MakePlane) -> None:
    from graycard.synth.renderer._mitsuba import load_scene

    scene = make_plane(ball=Ball((0.2, 0.1, 0.6), 0.6))
    first = surfaces(scene)["object_id"]
    kept = [load_scene(scene, scene.views[0].camera) for _ in range(3)]
    assert np.array_equal(surfaces(scene)["object_id"], first)
    assert len(kept) == 3


def test_a_camera_that_mitsuba_cannot_have_is_refused(scalar: str) -> None:
    from graycard.synth.renderer._mitsuba import centre_sensor

    K = np.array([[20.0, 0, 3], [0, 20, 5], [0, 0, 1]])
    with pytest.raises(ValueError, match="expected square pixels and a centred principal point"):
        centre_sensor(Camera(10, 10, K, np.eye(4)))


def test_the_variance_is_that_of_the_mean(scalar: str, make_plane: MakePlane) -> None:
    """Predicted from four sub-buffers against found from repeated renders: ratio 1 within its own error."""
    from graycard.synth.layers._separation import estimate
    from graycard.synth.layers._views import radiance_images
    from graycard.synth.renderer._mitsuba import load_scene

    light = RectangleLight("panel", (0.4, -0.3, 1.2), (0, 0.4, 0), (0.4, 0, 0), (5, 5, 5))
    scene = with_surface(make_plane((light,), ball=Ball((0.2, 0.1, 0.5), 0.5)), light)
    camera = scene.views[0].camera
    loaded = load_scene(scene, camera)
    settings = RenderSettings(24, 20, samples=16, max_depth=4)
    repeats = 32
    runs = [
        estimate("radiance", radiance_images(loaded, camera, [1000 * k + i for i in range(4)], settings))
        for k in range(1, repeats + 1)
    ]
    means, predicted = (
        np.stack([run[name] for run in runs]).astype(np.float64) for name in ("radiance", "radiance.var")
    )
    empirical = means.var(axis=0, ddof=1)
    # both estimate one number: the average over 480 pixels x 3 leaves an error of about 2 %
    assert predicted.mean() / empirical.mean() == pytest.approx(1, abs=0.06)


def test_sub_buffers_have_seeds_of_their_own() -> None:
    from graycard.synth.layers._views import sub_buffer_seeds

    seeds = [s for scene in range(3) for view in range(5) for s in sub_buffer_seeds(scene, view)]
    assert len(set(seeds)) == len(seeds) == 60
    assert sub_buffer_seeds(1, 2) == sub_buffer_seeds(1, 2)
