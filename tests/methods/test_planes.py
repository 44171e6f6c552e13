# SPDX-License-Identifier: Apache-2.0
"""Large planes among points and in views, on surfaces that are known."""

import numpy as np
import pytest
import torch

from graycard import Camera, look_at
from graycard.methods.surfels._ncc import SweptView, mean_ncc
from graycard.methods.surfels._paths import semi_global
from graycard.methods.surfels._planes import large_planes, plane_depth, with_planes
from graycard.methods.surfels._sweep import SweptDepth

SIZE = 40
FLOOR, WALL = np.array([0, 0, 1.0, 0]), np.array([1.0, 0, 0, 0.5])
"""z = 0, and x = -0.5."""


def points_on(plane: np.ndarray, count: int, random: np.random.Generator) -> np.ndarray:
    """Points within a metre of the origin's foot on a plane, row by row."""
    first = np.eye(3)[np.abs(plane[:3]).argmin()]
    across = np.cross(plane[:3], first)
    flat = np.sort(random.uniform(-1, 1, (count, 2)), axis=0)
    return flat[:, :1] * across + random.permuted(flat[:, 1:]) * first - plane[3] * plane[:3]


def test_planes_are_found_among_noise_and_strays_the_largest_first():
    random = np.random.default_rng(1)
    points = np.concatenate([points_on(WALL, 300, random), points_on(FLOOR, 700, random)])
    points += random.normal(0, 0.003, points.shape)
    strays = random.uniform(-1, 1, (200, 3))
    found = large_planes(np.concatenate([points, strays]), np.full(1200, 0.01), 0)
    assert len(found) >= 2
    for plane, true in zip(found[:2], (FLOOR, WALL), strict=True):
        np.testing.assert_allclose(plane * np.sign(plane[:3] @ true[:3]), true, atol=2e-3)
    np.testing.assert_array_equal(
        found, large_planes(np.concatenate([points, strays]), np.full(1200, 0.01), 0)
    )


def test_no_plane_is_found_where_there_is_none():
    random = np.random.default_rng(0)
    assert large_planes(random.uniform(-1, 1, (900, 3)), np.full(900, 1e-3), 0).shape == (0, 4)
    assert large_planes(np.zeros((0, 3)), np.zeros(0), 0).shape == (0, 4)
    assert large_planes(np.zeros((50, 3)), np.full(50, 1e-3), 0).shape == (
        1,
        4,
    )  # one place: any plane holds it


def test_a_plane_is_seen_at_its_depth_and_not_behind_the_camera():
    camera = Camera.from_fov(SIZE, SIZE, 60, look_at(np.array([1.0, 0, 1]), np.array([0, 0, 0.8])))
    depth, rays = plane_depth(camera, FLOOR), camera.rays()
    down = rays[..., 2] < 0
    assert np.array_equal(np.isfinite(depth), down)
    at = camera.position + rays[down] * (depth[down] / (rays[down] @ camera.forward))[:, None]
    np.testing.assert_allclose(at[:, 2], 0, atol=1e-12)
    np.testing.assert_allclose(depth, plane_depth(camera, -FLOOR))


def room(x: float) -> tuple[SweptView, np.ndarray]:
    """A view of a table z = 0.4 for y < 0 over a floor, both textured, and its true depth."""
    camera = Camera.from_fov(SIZE, SIZE, 40, look_at(np.array([x, -1.5, 1.6]), np.zeros(3)))
    rays = camera.rays()
    table, floor = ((height - camera.position[2]) / rays[..., 2] for height in (0.4, 0.0))
    on_table = (camera.position + table[..., None] * rays)[..., 1] < 0
    distance = np.where(on_table, table, floor)
    at = camera.position + distance[..., None] * rays
    waves = np.random.default_rng(0).normal(size=(24, 3)) * 30
    grey = 0.3 + 0.4 * on_table + 0.03 * np.sin(at @ waves.T + np.arange(24)).sum(axis=-1)
    return SweptView(camera, torch.from_numpy(grey.astype(np.float32)), 0.8, 4.0), distance * (
        rays @ camera.forward
    )


def test_planes_take_the_place_of_what_stereo_got_wrong():
    views, depths = zip(*(room(x) for x in (-0.3, -0.15, 0.0, 0.15, 0.3)), strict=True)
    random = np.random.default_rng(0)
    sure = random.random((len(views), SIZE, SIZE)) < 0.3
    swept = [
        SweptDepth(np.where(one, true, random.uniform(1, 4, true.shape)), one)
        for one, true in zip(sure, depths, strict=True)
    ]
    for found, true in zip(with_planes(views, swept, 0), depths, strict=True):
        assert found.sure.mean() > 0.9
        assert np.mean(np.abs(found.depth / true - 1)[found.sure] < 0.01) > 0.9


def test_where_no_plane_is_all_stays_as_it_was():
    views, depths = zip(*(room(x) for x in (-0.1, 0.1)), strict=True)
    nowhere = [SweptDepth(depth, np.zeros(depth.shape, bool)) for depth in depths]
    for found, given in zip(with_planes(views, nowhere, 0), nowhere, strict=True):
        assert found is given
    alone = [SweptDepth(depths[0], np.ones((SIZE, SIZE), bool))]
    assert with_planes(views[:1], alone, 0)[0] is alone[0]


@pytest.mark.parametrize("window", [3, 7])
def test_a_view_is_most_like_its_partner_at_its_true_depth(window: int):
    (view, depth), (partner, _) = room(0.0), room(0.2)
    inverse = np.stack([1 / depth, 1 / (depth + 0.2)])
    right, wrong = mean_ncc(view, [partner], inverse, window)
    seen = right != 0
    assert np.median(right[seen]) > 0.9
    assert np.median(wrong[seen]) < 0.75


def test_labels_change_where_it_is_easy():
    """Two labels; the left half asks for one and the right for the other, the middle for none."""
    cost = np.full((1, 9, 2), 1.0)
    cost[0, :3, 0] = cost[0, 6:, 1] = 0
    for easy in (3, 5):
        across = np.ones((1, 8))
        across[0, easy] = 0.1
        label = semi_global(cost, 0.6, 0.6, (np.ones((0, 9)), across)).argmin(axis=-1)[0]
        np.testing.assert_array_equal(label, np.arange(9) > easy)
