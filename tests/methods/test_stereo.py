# SPDX-License-Identifier: Apache-2.0
"""Dense depth from photographs, on surfaces that are known."""

from collections.abc import Callable

import numpy as np
import pytest
import torch

from graycard import Camera, MethodError, look_at
from graycard.methods.surfels._fill import dense_depths
from graycard.methods.surfels._ncc import SweptView
from graycard.methods.surfels._planes import with_planes
from graycard.methods.surfels._sweep import SweptDepth, sweep_depths
from graycard.methods.surfels._triangles import filled_depth

SIZE = 48


def texture(points: np.ndarray) -> np.ndarray:
    """Waves in many directions, from a centimetre to a decimetre, around one half."""
    random = np.random.default_rng(0)
    waves = random.normal(size=(24, 3)) * 30
    phases = random.uniform(0, 2 * np.pi, 24)
    return 0.5 + 0.06 * np.sin(points @ waves.T + phases).sum(axis=-1)


def tilted_plane(origin: np.ndarray, rays: np.ndarray) -> np.ndarray:
    """Distances to the plane z = 0.2 x."""
    normal = np.array([-0.2, 0, 1])
    return -(origin @ normal) / (rays @ normal)


def step(origin: np.ndarray, rays: np.ndarray) -> np.ndarray:
    """Distances to the plane z = 0 and a raised half of it, z = 0.4 for x > 0."""
    low, high = (-(origin[2] - z) / rays[..., 2] for z in (0.0, 0.4))
    on_high = (origin + high[..., None] * rays)[..., 0] > 0
    return np.where(on_high, high, low)


def views_of(surface: Callable[[np.ndarray, np.ndarray], np.ndarray], gain: float = 1.0) -> tuple[list, list]:
    """Five views from 1.5 m above, and their true depths."""
    views, depths = [], []
    for number, x in enumerate((-0.3, -0.15, 0.0, 0.15, 0.3)):
        camera = Camera.from_fov(
            SIZE, SIZE, 40, look_at(np.array([x, 0.05 * number, 1.5]), np.zeros(3), up=(0, 1, 0))
        )
        rays = camera.rays()
        distance = surface(camera.position, rays)
        grey = texture(camera.position + distance[..., None] * rays) * gain ** (number % 2)
        views.append(SweptView(camera, torch.from_numpy(grey.astype(np.float32)), 0.8, 2.5))
        depths.append(distance * (rays @ camera.forward))
    return views, depths


@pytest.mark.parametrize("gain", [1.0, 0.6])
def test_a_textured_plane_is_found_whatever_the_light(gain: float):
    views, depths = views_of(tilted_plane, gain)
    for found, true in zip(sweep_depths(views), depths, strict=True):
        assert found.sure.mean() > 0.8
        error = np.abs(found.depth / true - 1)[found.sure]
        assert np.median(error) < 0.005
        assert np.quantile(error, 0.95) < 0.03


def test_an_edge_of_depth_is_found():
    views, depths = views_of(step)
    found, true = sweep_depths(views)[2], depths[2]
    assert found.sure.mean() > 0.7
    assert np.mean(np.abs(found.depth / true - 1)[found.sure] < 0.03) > 0.85


def test_nobody_agrees_about_noise():
    random = torch.Generator().manual_seed(0)
    views, _ = views_of(tilted_plane)
    noise = [SweptView(v.camera, torch.rand(SIZE, SIZE, generator=random), 0.8, 2.5) for v in views]
    assert np.mean([found.sure.mean() for found in sweep_depths(noise)]) < 0.3


def test_views_that_look_elsewhere_say_nothing():
    views, _ = views_of(tilted_plane)
    below = Camera.from_fov(SIZE, SIZE, 40, look_at(np.array([0, 0, -1.5]), np.zeros(3), up=(0, 1, 0)))
    alone = [views[0], SweptView(below, views[1].grey, 0.8, 2.5)]
    for found in sweep_depths(alone):
        assert np.isnan(found.depth).all()
        assert found.sure.shape == found.depth.shape
        assert not found.sure.any()


def test_a_view_that_looks_elsewhere_does_not_harm_the_others():
    """One photograph of a capture may look where no other does."""
    views, depths = views_of(tilted_plane)
    below = Camera.from_fov(SIZE, SIZE, 40, look_at(np.array([0, 0, -1.5]), np.zeros(3), up=(0, 1, 0)))
    views = [*views, SweptView(below, views[1].grey, 0.8, 2.5)]
    swept = with_planes(views, sweep_depths(views), 0)
    for found, true in zip(swept[:-1], depths, strict=True):
        assert found.sure.mean() > 0.8
        assert np.median(np.abs(found.depth / true - 1)[found.sure]) < 0.01
    assert not swept[-1].sure.any()
    dense = dense_depths([view.camera for view in views], swept)
    assert all(np.isfinite(depth).all() for depth in dense)


def test_between_points_of_a_plane_lies_the_plane():
    """Its inverse depth is linear on the image; outside the triangles the nearest point counts."""
    x, y = np.meshgrid(np.arange(10) + 0.5, np.arange(8) + 0.5)
    true = 1 / (0.3 + 0.02 * x - 0.01 * y)
    corners = np.array([[0.5, 0.5], [9.5, 0.5], [0.5, 7.5], [9.5, 7.5]])
    depths = 1 / (0.3 + 0.02 * corners[:, 0] - 0.01 * corners[:, 1])
    np.testing.assert_allclose(filled_depth(corners, depths, (8, 10)), true)
    one = filled_depth(corners[:1], depths[:1], (8, 10))
    np.testing.assert_allclose(one, depths[0])
    line = filled_depth(corners[[0, 3]], depths[[0, 3]], (8, 10))
    assert set(np.unique(line)) <= set(depths[[0, 3]])


def test_nothing_stands_before_what_another_view_is_sure_of():
    """One view takes a part of the plane for something near, is not sure, and is overruled."""
    views, true = views_of(tilted_plane)
    cameras = [view.camera for view in views]
    sure = np.ones((SIZE, SIZE), bool)
    swept = [SweptDepth(depth, sure) for depth in true]
    near, doubt = true[2].copy(), sure.copy()
    near[20:30, 20:30], doubt[20:30, 20:30] = 0.9, False
    nearer, unsure = dense_depths(cameras, [*swept[:2], SweptDepth(near, doubt), *swept[3:]]), near < 1
    assert nearer[2][unsure].min() > 1.2
    np.testing.assert_allclose(nearer[2][35:, 35:], true[2][35:, 35:], rtol=0.02)
    np.testing.assert_allclose(nearer[0], true[0], rtol=0.02)


def test_where_stereo_is_not_sure_the_farther_guess_counts():
    views, true = views_of(tilted_plane)
    sure = np.ones((SIZE, SIZE), bool)
    sure[20:30, 20:30] = False
    far = np.where(sure, true[2], 9.0)
    found = dense_depths([views[2].camera], [SweptDepth(far, sure)])[0]
    assert found[22:28, 22:28].min() == 9
    near = np.where(sure, true[2], 0.5)
    found = dense_depths([views[2].camera], [SweptDepth(near, sure)])[0]
    np.testing.assert_allclose(found, true[2], rtol=0.02)


def test_photographs_of_nothing_in_common():
    views, true = views_of(tilted_plane)
    lost = [SweptDepth(depth, np.zeros((SIZE, SIZE), bool)) for depth in true]
    with pytest.raises(MethodError, match="none on which two agree. Set fill to 0"):
        dense_depths([view.camera for view in views], lost)
