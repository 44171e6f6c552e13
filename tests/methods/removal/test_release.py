# SPDX-License-Identifier: Apache-2.0
"""Differences of the released code of GOR-IS: views that guide others, and holes."""

from itertools import combinations

import numpy as np

from graycard import Camera, View, look_at
from graycard.methods.removal import RemovalSettings, choice_of, hull_holes
from graycard.methods.removal._behind import Behind
from graycard.methods.removal._filled import Target
from graycard.methods.removal._hull import GROWN
from graycard.methods.removal._references import chosen_references


def above(x: float, y: float) -> Camera:
    return Camera.from_fov(40, 40, 60, look_at(np.array([x, y, 3.0]), np.array([0.0, 0.0, 0.0])))


def behind_of(camera: Camera, hole: np.ndarray) -> Behind:
    """A floor at z = 0."""
    rays = camera.rays()
    depth = -camera.position[2] / rays[..., 2] * (rays @ camera.forward)
    return Behind(View("v", "train", camera), hole, hole, np.zeros((40, 40, 3)), depth)


def filled(camera: Camera, value: float) -> Target:
    hole = np.zeros((40, 40), bool)
    hole[15:25, 15:25] = True
    behind = behind_of(camera, hole)
    return Target(behind, np.where(hole[..., None], value, 0.0).repeat(3, axis=-1), hole)


def test_views_that_agree_least_and_look_apart_tell_others():
    """The pair of four views differs in colour and direction; the direction alone says nothing."""
    cameras = [above(1.0, 0.0), above(-1.0, 0.1), above(0.9, 0.1), above(-1.0, -0.1)]
    views = {
        k: filled(camera, value)
        for k, (camera, value) in enumerate(zip(cameras, (0.2, 0.2, 0.2, 0.6), strict=True))
    }
    assert set(chosen_references(views, 2)) == {0, 3}
    assert set(chosen_references(views, 4)) == {0, 1, 2, 3}
    found = set(chosen_references(views, 3))
    assert 3 in found
    assert found in [set(group) for group in combinations(range(4), 3)]


def test_the_released_choice_is_asked_for():
    assert choice_of(RemovalSettings()) is None
    choice = choice_of(RemovalSettings(reference_choice="release"))
    assert choice is not None
    assert choice.candidates == 10


def test_holes_are_what_lies_in_the_grown_hull():
    """A cube on the floor, whose mask is larger or smaller than its hull's foot."""
    camera = above(0.0, 1e-3)
    cube = np.stack(np.meshgrid(*[np.linspace(-0.4, 0.4, 5)] * 3), axis=-1).reshape(-1, 3)
    mask = np.zeros((40, 40), bool)
    mask[18:22, 18:22] = True
    nothing = np.zeros_like(mask)
    before = behind_of(camera, nothing)
    (found,) = hull_holes([before], [mask], 0.0, cube)
    places = np.abs(camera.unproject(before.depth)).max(axis=-1)
    pixel = 6 * np.tan(np.radians(30)) / 40
    assert found.hole[places < GROWN * 0.4 - pixel].mean() > 0.95  # the filter rounds corners
    assert not found.hole[places > GROWN * 0.4 + pixel].any()
    assert found.doubt[found.hole].all()
    (same,) = hull_holes([before], [mask], 0.0, cube * (1, 1, 0))
    assert not same.hole.any(), "it spans no volume"
