# SPDX-License-Identifier: Apache-2.0
"""Observations of a COLMAP model go with their pictures; rotations that are none are refused."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from graycard import DatasetError
from graycard.exchange._cameras import make_shot
from graycard.exchange._develop import with_width
from graycard.exchange._lens import make_intrinsics
from graycard.exchange.colmap._model import Model, ModelImage, ModelPoints, points_of, pose_of

SIZE = 120, 80
FISHEYE = make_intrinsics("OPENCV_FISHEYE", SIZE, (30.0, 30.0, 60.0, 40.0, 0.0, 0.0, 0.0, 0.0), "a test")
PINHOLE = make_intrinsics("PINHOLE", SIZE, (90, 90, 60, 40), "a test")


def test_what_lies_outside_of_the_new_picture_is_dropped_and_counted():
    """At the centre, in a corner that is cut off, and beyond a right angle."""
    keypoints = np.array([[60.0, 40.0], [1.0, 1.0], [118.0, 40.0]])
    image = ModelImage("a.png", 1, np.eye(4), keypoints, "a test")
    tracks = np.arange(3), np.ones(3, int), np.arange(3)
    points = ModelPoints(np.zeros((3, 3)), np.zeros((3, 3), np.uint8), *tracks)
    shot = with_width(make_shot(Path("a.png"), "a", FISHEYE, np.eye(4), "a test"), None)
    found, rows = points_of(Model({1: FISHEYE}, {1: image}, points), [shot], {1: "a"})
    assert found is not None
    assert found.point.tolist() == [0]
    np.testing.assert_allclose(found.pixel[0], shot.camera.K[:2, 2])
    assert len(found) == 3  # positions that training photographs gave are kept
    told = [(row.what, row.count, row.said) for row in rows]
    assert told[0] == ("points", 3, "kept, with 1 observation")
    said = "left out of the tracks: outside of the pictures once lenses are undone"
    assert ("observations", 2, said) in told


@given(st.lists(st.tuples(st.integers(0, 4), st.integers(1, 7), st.integers(0, 9)), max_size=60))
def test_each_observation_has_the_keypoint_of_its_image(tracks: list[tuple[int, int, int]]):
    """Images 1 to 5 are views, of which 2 is held out; 6 and 7 are not in the model."""
    rng = np.random.default_rng(0)
    images, shots = {}, []
    for number in range(1, 6):
        pixels = rng.uniform(0, SIZE, (10, 2))
        images[number] = ModelImage(f"{number}.png", 1, np.eye(4), pixels, "a test")
        made = make_shot(Path(f"{number}.png"), str(number), PINHOLE, np.eye(4), "a test")
        shots.append(replace(made, held_out=number == 2))
    point, image, keypoint = np.array(tracks, int).reshape(-1, 3).T
    points = ModelPoints(np.arange(15.0).reshape(5, 3), np.zeros((5, 3), np.uint8), point, image, keypoint)
    names = {number: str(number) for number in images}
    found, _ = points_of(Model({1: PINHOLE}, images, points), shots, names)
    assert found is not None
    wanted = sorted((p * 3.0, i - 1.0, *images[i].keypoints[k]) for p, i, k in tracks if i in (1, 3, 4, 5))
    rows = sorted(zip(found.positions[found.point, 0], found.view, *found.pixel.T, strict=True))
    np.testing.assert_allclose(np.reshape(rows, (-1, 4)), np.reshape(wanted, (-1, 4)), atol=1e-9)


@pytest.mark.parametrize("rounded", [[0.5, 0.5, 0.5, 0.5], [0.183, 0.365, 0.548, 0.730], [1.0004, 0, 0, 0]])
def test_quaternions_may_be_rounded(rounded: list[float]):
    assert np.linalg.det(pose_of(rounded, [0, 0, 0], "a test")[:3, :3]) == pytest.approx(1)


@pytest.mark.parametrize("wrong", [[0.5, 0.5, 0.5, 0.53], [1, 0, 0, 0.07], [2, 0, 0, 0], [0.9, 0, 0, 0]])
def test_quaternions_with_a_wrong_number_are_refused(wrong: list[float]):
    """A wrong digit makes it longer or shorter, and turns the view by degrees."""
    with pytest.raises(DatasetError, match="expected a unit quaternion"):
        pose_of(wrong, [0, 0, 0], "a test")
