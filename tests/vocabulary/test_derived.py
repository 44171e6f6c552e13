# SPDX-License-Identifier: Apache-2.0
"""True layers that follow from others."""

import doctest

import numpy as np
import pytest

from graycard import Camera, look_at
from graycard.layers import _derived, find_fault, with_derived, with_geometry

IDS = np.array([[1, 1, 1, 0]], np.uint32)
ROUGHNESS = np.array([[0.49, 0.5, 0.1, 0.1]], np.float32)
F0 = np.array([[[0, 0.04, 0], [1, 1, 1], [0, 0, 0], [1, 1, 1]]], np.float32)


def test_examples() -> None:
    assert doctest.testmod(_derived).attempted >= 2
    assert doctest.testmod(_derived).failed == 0


def test_glossy_is_what_has_a_narrow_lobe() -> None:
    found = with_derived({"object_id": IDS, "roughness": ROUGHNESS, "f0": F0})["glossy"]
    assert found.tolist() == [[1, 0, 0, 0]], "one channel is enough; at the threshold it is rough"
    assert find_fault("glossy", found, 1, 4) is None
    assert found.dtype == np.float32


@pytest.mark.parametrize("lacking", ["object_id", "roughness", "f0"])
def test_it_needs_all_three(lacking: str) -> None:
    layers = {"object_id": IDS, "roughness": ROUGHNESS, "f0": F0}
    assert "glossy" not in with_derived({k: v for k, v in layers.items() if k != lacking})


def test_what_does_not_fit_is_left_to_those_who_judge_it() -> None:
    assert "glossy" not in with_derived({"object_id": IDS, "roughness": ROUGHNESS[:, :2], "f0": F0})


def test_what_is_there_already_stays() -> None:
    layers = {"object_id": IDS, "roughness": ROUGHNESS, "f0": F0, "glossy": IDS * 0.0}
    assert not with_derived(layers)["glossy"].any()
    assert "diffuse" in with_derived({"direct.diffuse": F0, "indirect.diffuse": F0})


def test_position_and_distance_follow_from_depth() -> None:
    """A floor z = 0 that is seen from 2 m above it, and nothing beyond."""
    camera = Camera.from_fov(8, 6, 70, look_at(np.array([0.5, -3.0, 2.0]), np.zeros(3)))
    rays = camera.rays()
    distance = -2 / rays[..., 2]
    distance[:2] = np.inf
    depth = (distance * (rays @ camera.forward)).astype(np.float32)
    found = with_geometry({"depth": depth}, camera)
    np.testing.assert_allclose(found["distance"], distance, rtol=1e-6)
    np.testing.assert_allclose(found["position"][2:, :, 2], 0, atol=1e-6)
    np.testing.assert_allclose(
        camera.project(found["position"][5, 3].astype(float))[0], (3.5, 5.5), atol=1e-4
    )
    assert not found["position"][:2].any()
    assert {values.dtype for values in found.values()} == {np.dtype(np.float32)}


def test_geometry_that_is_there_stays_and_without_depth_there_is_none() -> None:
    camera = Camera.from_fov(4, 1, 70, look_at(np.array([0.0, -3.0, 2.0]), np.zeros(3)))
    assert with_geometry({"object_id": IDS}, camera).keys() == {"object_id"}
    found = with_geometry({"depth": ROUGHNESS, "distance": 7 * ROUGHNESS}, camera)
    assert np.array_equal(found["distance"], 7 * ROUGHNESS)
    assert found["position"].shape == (1, 4, 3)
