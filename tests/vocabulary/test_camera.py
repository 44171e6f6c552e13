# SPDX-License-Identifier: Apache-2.0
import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from graycard import Camera, look_at
from graycard.io import dumps, from_builtins

numbers = st.floats(-5, 5)


def make_camera(origin: tuple[float, float, float] = (0, -3, 0)) -> Camera:
    return Camera.from_fov(40, 20, 90, look_at(np.array(origin), np.zeros(3)))


def test_axes_are_those_of_opencv():
    """A camera that looks along +y with z up: +x is right, +z is up, so image y goes down with z."""
    camera = make_camera()
    pixels, depth = camera.project(np.array([[0, 0, 0], [1, 0, 0], [0, 0, 1]]))
    assert depth == pytest.approx([3, 3, 3])
    focal = 20.0  # 90 degrees over 40 pixels
    assert pixels == pytest.approx(np.array([[20, 10], [20 + focal / 3, 10], [20, 10 - focal / 3]]))


def test_a_point_behind_the_camera_has_negative_depth():
    assert make_camera().project(np.array([0, -4, 0]))[1] == pytest.approx(-1)


@given(numbers, numbers, st.floats(0.5, 5))
def test_rays_go_through_the_pixel_centres(x: float, y: float, z: float):
    camera = Camera.from_fov(5, 4, 70, look_at(np.array([x, y, z]), np.array([6, 6, 0])))
    pixels, depth = camera.project(camera.position + 2.5 * camera.rays())
    j, i = np.meshgrid(np.arange(5) + 0.5, np.arange(4) + 0.5)
    assert np.allclose(pixels, np.stack([j, i], -1), atol=1e-9)
    assert np.allclose(depth, 2.5 * camera.rays() @ camera.forward)
    assert np.allclose(camera.unproject(depth), camera.position + 2.5 * camera.rays())


@given(numbers, numbers, st.floats(0.5, 5))
def test_world_to_camera_is_the_inverse(x: float, y: float, z: float):
    camera = make_camera((x, y - 10, z))
    assert np.allclose(camera.world_to_camera @ camera.camera_to_world, np.eye(4), atol=1e-12)


def test_json_round_trip_is_exact_and_equal():
    camera = make_camera((0.1, -3, 1 / 3))
    back = from_builtins(Camera, json.loads(dumps(camera)))
    assert back == camera
    assert hash(back) == hash(camera)
    assert back != make_camera((0.1, -3, 1 / 3 + 1e-15))


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"width": 0}, "expected a positive image size in whole pixels, got 0x20"),
        ({"width": 20.5}, "expected a positive image size in whole pixels, got 20.5x20"),
        ({"K": np.eye(2)}, r"expected K to be finite and \(3, 3\)"),
        ({"K": np.diag([1.0, -1.0, 1.0])}, "fx, fy > 0"),
        ({"camera_to_world": np.full((4, 4), np.nan)}, "expected camera_to_world to be finite"),
        ({"camera_to_world": np.diag([1.0, 1.0, -1.0, 1.0])}, "right-handed"),
        ({"camera_to_world": 2 * np.eye(4)}, "expected camera_to_world to be a rotation"),
    ],
)
def test_bad_cameras(changes: dict[str, object], message: str):
    good = make_camera()
    given = {"width": 40, "height": 20, "K": good.K, "camera_to_world": good.camera_to_world} | changes
    with pytest.raises(ValueError, match=message):
        Camera(**given)  # pyright: ignore


def test_looking_along_up_is_an_error():
    with pytest.raises(ValueError, match="expected a view direction that is not along"):
        look_at(np.zeros(3), np.array([0, 0, 2]))


def test_arrays_cannot_be_changed():
    with pytest.raises(ValueError, match="read-only"):
        make_camera().K[0, 0] = 1
