# SPDX-License-Identifier: Apache-2.0
"""Captures in any unit: structure from motion does not know what is a metre."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from graycard import Camera, Capture, MethodError, methods, open_truth, srgb_encode
from graycard.io import silent
from graycard.methods.surfels import enlarged
from graycard.points import read_points, write_points
from sparse_points import with_points


@pytest.fixture
def scene(make_scene: Callable[..., Path]) -> Path:
    return make_scene(train=5, test=2)


def scaled(camera: Camera, factor: float) -> Camera:
    pose = camera.camera_to_world.copy()
    pose[:3, 3] *= factor
    return Camera(camera.width, camera.height, camera.K, pose)


def in_units(scene: Path, factor: float) -> Capture:
    """Return the capture with all lengths multiplied by a factor."""
    capture, path = with_points(scene), scene / "capture" / "points.ply"
    points = read_points(path)
    write_points(path, replace(points, positions=points.positions * factor))
    views = tuple(replace(view, camera=scaled(view.camera, factor)) for view in capture.views)
    return replace(capture, views=views)


def drawn(name: str, scene: Path, factor: float, fill: float) -> list[np.ndarray]:
    """Return held-out views as a fit in these units shows them, encoded; depth is in metres again."""
    method, capture = methods.load_method(name), in_units(scene, factor)
    settings = methods.settings_of(method, {"iterations": 80, "surfels": 400, "degree": 1, "fill": fill})
    found = method.fit(capture, methods.Priors("none", {}), settings, 0, silent)
    layers = [found.render(view.camera, ["radiance", "depth"]) for view in capture.test]
    return [
        image
        for view in layers
        for image in (srgb_encode(view["radiance"] * capture.exposure), view["depth"] / factor)
    ]


@pytest.mark.parametrize(("name", "fill"), [("2dgs", 0.0), ("2dgs", 0.75), ("appearance", 0.0)])
def test_small_units_cost_nothing(name: str, fill: float, scene: Path) -> None:
    """Units of 32 and 64 metres give one scene; as a picture, it is as near to the truth as in metres."""
    truth = open_truth(scene / "truth", check=False)
    test = [view for view in truth.views if view.split == "test"]
    true = [srgb_encode(truth.layers(view)["radiance"] * truth.exposure) for view in test]
    metres, small, smaller = (drawn(name, scene, factor, fill) for factor in (1, 1 / 32, 1 / 64))
    for one, other in zip(small, smaller, strict=True):
        np.testing.assert_allclose(one, other, atol=1e-4, rtol=1e-4)
    errors = [
        np.mean([np.square(a - b).mean() for a, b in zip(true, found[::2], strict=True)])
        for found in (metres, small)
    ]
    assert -10 * np.log10(errors[1] / errors[0]) > -0.7


def test_units_of_a_metre_are_left_as_they_are(scene: Path) -> None:
    for factor in (1.0, 30.0, 1000.0):
        capture = in_units(scene, factor)
        assert enlarged(capture) == (capture, 1.0)
        assert enlarged(capture)[0] is capture


def test_what_is_enlarged_is_one_capture(scene: Path) -> None:
    capture = in_units(scene, 1 / 32)
    larger, factor = enlarged(capture)
    assert factor == 16
    np.testing.assert_array_equal(larger.points().positions, 16 * capture.points().positions)
    for view, other in zip(capture.views, larger.views, strict=True):
        np.testing.assert_array_equal(other.camera.position, 16 * view.camera.position)
        np.testing.assert_array_equal(other.camera.K, view.camera.K)
    view = larger.train[0]
    np.testing.assert_array_equal(larger.photograph(view), capture.photograph(view))
    assert enlarged(larger)[1] == 1


def test_cameras_within_the_nearest_depth_are_refused(scene: Path) -> None:
    method = methods.load_method("2dgs")
    settings = methods.settings_of(method, {"iterations": 2})
    with pytest.raises(MethodError, match="Scale cameras and points before you import them"):
        method.fit(in_units(scene, 1e-3), methods.Priors("none", {}), settings, 0, silent)
