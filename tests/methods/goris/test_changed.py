# SPDX-License-Identifier: Apache-2.0
"""Changes by a removal in the training views: those not believed, and places that no view has seen."""

from pathlib import Path

import numpy as np
import torch

from glossy_rooms import Painter, removed_from, write_room
from glossy_sheets import (
    EXTENT,
    OBJECT,
    SETTINGS,
    GlossyWorld,
    glossy_world,
    shots_of_world,
    with_settings,
)
from graycard import Camera, Capture, View, methods
from graycard.methods.goris._remove import _drawn, _effects
from graycard.methods.removal._behind import views_behind
from graycard.methods.removal._target import widened
from graycard.methods.splat import scene_extent

HALF = 0.26
"""Half the side of a board, metres: its discs cover half of a pixel there."""
FLOOR_HALF = 1.23


def test_photographs_are_doubted_where_they_show_the_object_or_its_reflection(tmp_path: Path):
    """The latter only with the lighting-aware mask; to be doubted there is not to be unseen."""
    world = glossy_world()
    room, shots = write_room(world, tmp_path), shots_of_world(world)
    priors = methods.Priors(models={"inpainting": Painter(world)})
    extent = scene_extent(world.cameras)
    effects = _effects(world.parameters.all, shots, SETTINGS, extent)
    changed = {}
    for effect_mask in (True, False):
        settings = with_settings(iterations=4, effect_mask=effect_mask, grow=0.03)
        changed[effect_mask] = removed_from(world, room, priors, settings, shots=shots).changed
    for view, shot, effect in zip(room.train, shots, effects, strict=True):
        hidden = widened(shot.target.numpy() > 0.5, 0.03)
        with_it, without = (changed[effect_mask][view.name] for effect_mask in (True, False))
        np.testing.assert_array_equal(without.doubted, hidden)
        np.testing.assert_array_equal(with_it.doubted, hidden | widened(effect, 0.03))
        np.testing.assert_array_equal(with_it.unseen, without.unseen)
        assert (with_it.doubted & ~hidden).sum() > 10


def test_unseen_is_what_no_other_view_has_seen():
    """Against true rays to the floor and the boards, at a size at which a pixel spans little depth."""
    coarse = glossy_world()
    cameras = [Camera.from_fov(132, 108, 55, c.camera_to_world) for c in coarse.cameras]
    world = GlossyWorld(coarse.parameters, coarse.part, cameras)
    left = world.parameters.take(torch.from_numpy(world.part != OBJECT))
    masks = [shot.target.numpy() > 0.5 for shot in shots_of_world(world)]
    behind = views_behind(_dark(cameras), _drawn(left.all, SETTINGS, EXTENT), masks, grow=0.0)
    for number, (one, mask) in enumerate(zip(behind, masks, strict=True)):
        true = mask & ~_seen_by_others(number, cameras)
        assert 300 < true.sum() < 0.6 * mask.sum()
        assert (true & one.hole).sum() / (true | one.hole).sum() > 0.8


def _dark(cameras: list[Camera]) -> Capture:
    """A capture of black photographs that lies nowhere."""

    class Dark(Capture):
        def photograph(self, view: View) -> np.ndarray:
            return np.zeros((view.camera.height, view.camera.width, 3), np.float32)

    views = tuple(View(str(n), "train", camera) for n, camera in enumerate(cameras))
    return Dark("tabletop", "dark", views, 1.0, light_on_camera=False, target=3)


def _seen_by_others(number: int, cameras: list[Camera]) -> np.ndarray:
    """Return a mask, shape ``(H, W)``: pixels that, without the object, show surfaces that another view
    sees."""
    camera = cameras[number]
    floor, board, _ = _distances(camera.position, camera.rays())
    distance = np.minimum(floor, board)
    known = np.isfinite(distance)
    points = camera.position + distance[known][:, None] * camera.rays()[known]
    seen = np.zeros(len(points), bool)
    for other in cameras[:number] + cameras[number + 1 :]:
        pixels, z = other.project(points)
        inside = (z > 0) & (pixels >= 0).all(axis=1) & (pixels < (other.width, other.height)).all(axis=1)
        nearest = np.min(_distances(other.position, points - other.position), axis=0)
        seen |= inside & (nearest > 1 - 1e-3)
    found = np.zeros_like(known)
    found[known] = seen
    return found


def _distances(origin: np.ndarray, directions: np.ndarray) -> list[np.ndarray]:
    """To the floor, the board and the object, in lengths of the directions; +inf where they are missed."""
    with np.errstate(divide="ignore", invalid="ignore"):
        floor = -origin[2] / directions[..., 2]
        meets = np.abs((origin + floor[..., None] * directions)[..., :2]).max(axis=-1) < FLOOR_HALF
        found = [np.where((floor > 0) & meets, floor, np.inf)]
        for x, y in ((-0.3, 0.3), (0.3, -0.1)):
            reach = (y - origin[1]) / directions[..., 1]
            places = (origin + reach[..., None] * directions)[..., [0, 2]] - (x, 0.27)
            found.append(np.where((reach > 0) & (np.abs(places).max(axis=-1) < HALF), reach, np.inf))
    return found
