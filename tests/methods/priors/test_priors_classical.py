# SPDX-License-Identifier: Apache-2.0
"""Priors without weights, against surfaces and pictures that are known."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from graycard import (
    Camera,
    Capture,
    MethodError,
    Points,
    View,
    angles,
    look_at,
    methods,
    open_capture,
    srgb_decode,
)
from graycard.io import write_rgb
from graycard.methods._retinex import RetinexSettings, split
from graycard.methods.priors import Override, PriorSpec, make_priors
from graycard.methods.priors._filling import filled
from graycard.methods.priors._slopes import normals_of
from graycard.points import write_points

SIZE = 48
ASKS = tuple(methods.Ask(k) for k in ("depth", "normal", "base_color", "roughness", "metallic", "inpainting"))


def texture(points: np.ndarray) -> np.ndarray:
    """Waves in many directions, from a centimetre to a decimetre, around one half."""
    random = np.random.default_rng(0)
    waves, phases = random.normal(size=(24, 3)) * 30, random.uniform(0, 2 * np.pi, 24)
    return 0.5 + 0.06 * np.sin(points @ waves.T + phases).sum(axis=-1)


@pytest.fixture(scope="session")
def room(tmp_path_factory: pytest.TempPathFactory) -> tuple[Capture, dict[str, np.ndarray]]:
    """Photographs of the textured plane z = 0.2 x from five places, and the true depths."""
    folder = tmp_path_factory.mktemp("plane")
    normal, views, depths = np.array([-0.2, 0, 1]), [], {}
    for number, x in enumerate((-0.3, -0.15, 0.0, 0.15, 0.3)):
        pose = look_at(np.array([x, 0.05 * number, 1.5]), np.zeros(3), up=(0, 1, 0))
        view = View(f"train_{number:03d}", "train", Camera.from_fov(SIZE, SIZE, 40, pose))
        rays = view.camera.rays()
        distance = -(view.camera.position @ normal) / (rays @ normal)
        grey = srgb_decode(texture(view.camera.position + distance[..., None] * rays))
        write_rgb(folder / "photographs" / f"{view.name}.exr", np.repeat(grey[..., None], 3, axis=-1))
        views.append(view)
        depths[view.name] = distance * (rays @ view.camera.forward)
    corners = np.array([[0.3, 0.2, 0.06], [-0.3, 0.1, -0.06], [0.0, -0.2, 0.0]])
    write_points(folder / "points.ply", replace_points(corners))
    return Capture("tabletop", "plane", tuple(views), 1.0, False, root=folder), depths


def replace_points(positions: np.ndarray) -> Points:
    colours = np.full(positions.shape, 128, np.uint8)
    nothing = np.zeros(0, np.int64)
    return Points(positions, colours, nothing, nothing, np.zeros((0, 2)))


def told_of(capture: Capture) -> methods.Priors:
    return make_priors(PriorSpec("classical"), ASKS, capture, {})


def test_stereo_finds_a_textured_plane_and_its_normals(room):
    capture, depths = room
    view = capture.train[2]
    told = told_of(capture)
    photograph = capture.photograph(view)
    error = np.abs(told.depth(photograph, view) / depths[view.name] - 1)
    assert np.median(error) < 0.01
    plane = np.array([-0.2, 0, 1]) / np.linalg.norm([-0.2, 0, 1])
    normal = told.normal(photograph, view)
    assert np.median(angles(normal, np.broadcast_to(plane, normal.shape))) < 6


def test_stereo_is_asked_with_another_image(room):
    """Half the light in the view, as when an albedo is handed in, leaves the plane where it is."""
    capture, depths = room
    view = capture.train[2]
    error = np.abs(told_of(capture).depth(0.5 * capture.photograph(view), view) / depths[view.name] - 1)
    assert np.median(error) < 0.02


def test_a_view_that_no_other_looks_at_gets_an_even_depth(room):
    capture, _ = room
    alone = replace(capture, views=capture.views[:1])
    depth = told_of(alone).depth(capture.photograph(alone.views[0]), alone.views[0])
    assert np.ptp(depth) == 0
    assert 1 < depth[0, 0] < 2  # between the sparse points


def test_a_flash_tells_the_depth_of_even_paint_exactly(scene):
    """Light that falls with the square of the distance on a surface that faces it, seen by the camera."""
    capture, view = replace(scene.capture, light_on_camera=True), scene.view
    depth = np.broadcast_to(np.linspace(1, 4, view.camera.width), (view.camera.height, view.camera.width))
    image = np.repeat((0.7 / depth**2)[..., None], 3, axis=-1)
    found = told_of(capture).depth(image, view)
    assert np.ptp(np.log(found / depth)) < 1e-9
    assert told_of(capture).depth(0 * image, view).min() > 0  # a black photograph tells nothing


def test_materials_are_what_is_likeliest_and_albedo_is_by_retinex(scene):
    told, image = told_of(scene.capture), np.asarray(scene.photograph)
    assert (told.roughness(image, scene.view) == 0.5).all()
    assert (told.metallic(image, scene.view) == 0).all()
    expected = np.clip(split(image.astype(np.float64), RetinexSettings()), 0, 1)
    np.testing.assert_allclose(told.base_color(image, scene.view), expected, rtol=1e-12)


@pytest.mark.parametrize("channels", [1, 3])
def test_a_biharmonic_filling_goes_on_with_a_slope(channels: int, scene):
    told, view = told_of(scene.capture), scene.view
    y, x = np.mgrid[0 : view.camera.height, 0 : view.camera.width] / 20
    ramp = y + 2 * x
    image = ramp if channels == 1 else np.stack([ramp, 1 - ramp, 0 * ramp], axis=-1)
    hole = np.zeros(ramp.shape, bool)
    hole[8:15, 9:18] = True
    inside = hole if channels == 1 else hole[..., None]
    filled = told.inpainting(np.where(inside, 77.0, image), view, hole, of="depth")
    np.testing.assert_allclose(filled, image, atol=1e-6)
    assert np.array_equal(told.inpainting(image, view, ~(hole | True)), image)
    with pytest.raises(MethodError, match="expected a hole with something around it"):
        told.inpainting(image, view, hole | True)


@pytest.mark.parametrize("algorithm", ["biharmonic", "telea"])
def test_the_algorithm_that_a_spec_names_fills_in(algorithm: str, scene):
    spec = PriorSpec("classical", overrides={"inpainting": Override(algorithm=algorithm)})
    told, image = make_priors(spec, ASKS, scene.capture, {}), np.asarray(scene.photograph)
    hole = scene.known["object_id"] == scene.capture.target
    found = told.inpainting(image, scene.view, hole)
    assert np.array_equal(found, filled(image, hole, algorithm))
    assert np.array_equal(found[~hole], image[~hole])
    other = {"biharmonic": "telea", "telea": "biharmonic"}[algorithm]
    assert not np.allclose(found[hole], filled(image, hole, other)[hole])


def test_normals_of_a_depth_are_those_of_its_plane_everywhere():
    camera = Camera.from_fov(SIZE, SIZE, 50, look_at(np.array([0.3, -2, 1.5]), np.zeros(3)))
    rays = camera.rays()
    distance = -camera.position[2] / rays[..., 2]
    depth = np.where(distance > 0, distance, np.inf) * (rays @ camera.forward)
    depth = np.where(depth < 6, depth, np.inf)
    normals = normals_of(depth, camera)
    seen = np.isfinite(depth)
    assert seen.any()
    assert not seen.all()
    assert not normals[~seen].any()
    angle = angles(normals[seen], np.broadcast_to([0.0, 0, 1], (seen.sum(), 3)))
    assert np.median(angle) < 0.5
    assert angle.max() < 15  # the blur bends what is beside nothing
    single = np.full((SIZE, SIZE), np.inf)
    single[4, 5] = 2.0
    np.testing.assert_allclose(normals_of(single, camera)[4, 5], -rays[4, 5])


def test_without_sparse_points_any_room_will_do(tiny_scenes: dict[str, Path]):
    capture = open_capture(tiny_scenes["multilight"] / "capture")
    view = capture.train[0]
    depth = told_of(capture).depth(capture.photograph(view) * capture.exposure, view)
    assert np.isfinite(depth).all()
    assert (depth > 0.3).all()
    assert (depth < 40).all()
