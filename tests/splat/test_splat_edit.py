# SPDX-License-Identifier: Apache-2.0
"""Surfels are told by pictures, moved, and put beside others."""

from dataclasses import fields, replace

import numpy as np
import pytest
import torch
from scipy.spatial.transform import Rotation

from graycard import Camera, look_at
from graycard.methods import splat
from random_surfels import random_surfels

CAMERAS = [
    Camera.from_fov(31, 26, 60, look_at(np.array(eye), np.zeros(3)))
    for eye in ((0.0, -3.0, 1.0), (2.5, 1.0, 1.5))
]


def surfels_of(count: int = 30, seed: int = 1000) -> splat.Surfels:
    found = random_surfels(count, seed, channels=0)
    names = [field.name for field in fields(found)]
    return splat.Surfels(*(getattr(found, name).float() for name in names))


def test_gathering_is_drawing_the_other_way_round():
    """One surfel at a time drawn in white, times the image, summed."""
    surfels, image = surfels_of(), torch.rand(26, 31, 2, generator=torch.Generator().manual_seed(1))
    got = splat.gather(surfels, CAMERAS[0], image)
    assert got.shape == (30, 2)
    drawn = splat.rasterize_features(surfels, CAMERAS[0], features=torch.eye(30)).features
    torch.testing.assert_close(got, torch.einsum("hwn,hwc->nc", drawn, image), rtol=1e-4, atol=1e-4)


def test_gathering_works_where_gradients_are_off():
    with torch.no_grad():
        assert splat.gather(surfels_of(), CAMERAS[0], torch.ones(26, 31, 1)).max() > 0


def discs(*places: tuple[float, float, float]) -> splat.Surfels:
    """Discs that face up."""
    up = np.tile([0.0, 0.0, 1.0], (len(places), 1))
    found = splat.surfels_from_points(np.array(places), up, np.full_like(up, 0.5), opacity=0.99)
    return replace(found, scales=torch.full((len(places), 2), 0.2))


def test_a_surfel_is_inside_where_masks_see_it():
    """Three discs: one lies in the mask, one beside it, and one below the first, hidden from above."""
    surfels = discs((0.5, 0, 0.5), (-0.5, 0, 0.5), (0.5, 0.0, 0.3))
    above = Camera.from_fov(32, 32, 60, look_at(np.array([0.0, 1e-3, 3.0]), np.array([0.0, 0, 0.0])))
    seen = above.project(surfels.centres[0].numpy())[0][0] > 16
    mask = np.zeros((32, 32), bool)
    mask[:, 16:] = seen
    mask[:, :16] = not seen
    inside = splat.share_inside(surfels, [above], [mask])
    assert inside[0] > 0.95
    assert inside[1] < 0.05
    assert splat.share_inside(surfels, [above], [~mask])[0] < 0.05
    away = Camera.from_fov(32, 32, 60, look_at(np.array([0.0, 1e-3, 3.0]), np.array([0.0, 0, 6.0])))
    assert not splat.share_inside(surfels, [away], [np.ones((32, 32), bool)]).any(), "no view sees any"


def test_masks_that_do_not_fit_are_refused():
    with pytest.raises(ValueError, match="expected one mask a camera, got 1 of 2"):
        splat.share_inside(surfels_of(), CAMERAS, [np.ones((26, 31), bool)])
    with pytest.raises(ValueError, match=r"expected a mask of shape \(26, 31\), got \(31, 26\)"):
        splat.share_inside(surfels_of(), CAMERAS[:1], [np.ones((31, 26), bool)])


def motion_of() -> np.ndarray:
    motion = np.eye(4)
    motion[:3, :3] = Rotation.from_rotvec([0.3, -0.8, 1.1]).as_matrix()
    motion[:3, 3] = 0.5, -2.0, 0.7
    return motion


def test_moved_with_the_camera_the_picture_stays():
    """Also of quaternions that are no unit ones; vectors of the world turn and do not shift."""
    surfels, motion = surfels_of(60), motion_of()
    vectors = torch.rand(60, 3, generator=torch.Generator().manual_seed(2))
    parameters = dict(splat.parameters_of(surfels, {"colour": vectors, "vector": vectors}).surfels)
    parameters["rotations"] = 3 * parameters["rotations"]
    moved = splat.moved_surfels(parameters, motion, ["vector"])
    here = splat.rasterize_features(splat.surfels_of(parameters, parameters["colour"]), CAMERAS[0])
    there = replace(CAMERAS[0], camera_to_world=motion @ CAMERAS[0].camera_to_world)
    drawn = splat.rasterize_features(splat.surfels_of(moved, moved["colour"]), there)
    torch.testing.assert_close(drawn.features, here.features, rtol=1e-3, atol=1e-3)
    turn = torch.from_numpy(motion[:3, :3]).float()
    torch.testing.assert_close(moved["vector"], vectors @ turn.T)


def test_a_motion_that_is_not_rigid_is_refused():
    parameters = splat.parameters_of(surfels_of()).surfels
    for wrong in (2 * np.eye(4), np.diag([-1.0, 1, 1, 1])):
        with pytest.raises(ValueError, match="expected a rotation in the motion"):
            splat.moved_surfels(parameters, wrong)


def test_joined_scenes_keep_what_is_no_surfels_of_the_first():
    light, other = torch.ones(2), torch.zeros(2)
    one = splat.parameters_of(surfels_of(5), {"colour": torch.ones(5, 3)}, {"light": light})
    two = splat.parameters_of(surfels_of(7, 1001), {"colour": torch.zeros(7, 3)}, {"light": other})
    both = splat.joined_surfels(one, two.surfels)
    assert len(both) == 12
    assert both.shared["light"] is light
    torch.testing.assert_close(both.surfels["colour"].sum(dim=1), torch.tensor([3.0] * 5 + [0.0] * 7))
    with pytest.raises(ValueError, match="expected surfels with .*'colour'"):
        splat.joined_surfels(one, splat.parameters_of(surfels_of(7)).surfels)
