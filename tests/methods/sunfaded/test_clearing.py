# SPDX-License-Identifier: Apache-2.0
"""No surfel stays right before a camera, where it alone would see it."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import torch

from graycard import Camera, look_at, methods, open_truth
from graycard.io import silent
from graycard.methods.splat import CENTRES
from graycard.methods.sunfaded import SunFadedScene, SunFadedSettings
from graycard.methods.sunfaded._clearing import FEWEST, WINDOW, Clearing, clearing_of, scaled_depth
from graycard.methods.sunfaded._guess import GeometryGuess
from graycard.methods.surfels import SweptDepth
from sparse_points import with_points


def test_it_is_what_hangs_in_the_picture_and_before_the_free_depth():
    camera = Camera.from_fov(40, 30, 60.0, look_at(np.zeros(3), np.array([0.0, 4.0, 0.0])))
    free = torch.full((30, 40), 1.0)
    free[:, 20:] = 2.0  # to the right it sees farther
    rays = camera.rays()[[15, 15, 15, 15], [5, 35, 5, 35]]
    places = rays / (rays @ camera.forward)[:, None] * np.array([0.9, 1.9, 1.1, 2.1])[:, None]
    places = np.concatenate(
        [places, [[0.0, -0.5, 0.0], [5.0, 0.5, 0.0]]]
    )  # behind it, and beside the picture
    gone = Clearing([camera], [free])({CENTRES: torch.from_numpy(places).float()})
    assert gone.tolist() == [True, True, False, False, False, False]


def test_one_camera_is_enough():
    eyes = (np.zeros(3), np.array([0.0, 8.0, 0.0]))
    cameras = [Camera.from_fov(9, 9, 60.0, look_at(eye, np.array([0.0, 4.0, 0.0]))) for eye in eyes]
    places = torch.tensor([[0.0, 0.5, 0.0], [0.0, 4.0, 0.0], [0.0, 7.5, 0.0]])
    gone = Clearing(cameras, [torch.ones(9, 9)] * 2)({CENTRES: places})
    assert gone.tolist() == [True, False, True]


def test_a_depth_of_any_scale_is_put_into_metres_whatever_a_few_points_say():
    random = np.random.default_rng(0)
    true = np.exp(random.uniform(0, 1.5, (20, 30)))
    row, column = random.integers(0, 20, 60), random.integers(0, 30, 60)
    depths = true[row, column]
    depths[:20] *= 3  # a third is wrong
    pixels = np.stack([column, row], axis=1) + 0.5
    found = scaled_depth(0.2 * true, pixels, depths)
    assert found == pytest.approx(true)


def test_too_few_points_tell_no_scale():
    few = FEWEST - 1
    assert scaled_depth(np.ones((5, 5)), np.full((few, 2), 2.5), np.ones(few)) is None
    nowhere = np.full((5, 5), np.inf)
    assert scaled_depth(nowhere, np.full((50, 2), 2.5), np.ones(50)) is None


def test_by_a_prior_it_is_free_up_to_a_share_of_the_true_depth(make_scene: Callable[..., Path]):
    scene = make_scene(train=3, test=1)
    capture, truth = with_points(scene), open_truth(scene / "truth", check=False)
    depths = [truth.layers(truth.view(view.name))["depth"] for view in capture.train]
    told = [GeometryGuess(torch.from_numpy(0.3 * depth).float()) for depth in depths]
    for depth, free in zip(depths, clearing_of(capture, told, 0.7).free, strict=True):
        seen = np.isfinite(depth)
        assert (free.numpy()[seen] <= 0.71 * depth[seen]).all()
        near = np.abs(depth - np.median(depth[seen])) < 0.05 * np.median(depth[seen])
        assert near.sum() > WINDOW**2
        assert np.median(free.numpy()[near] / depth[near]) > 0.5


def test_where_the_prior_knows_nothing_surfels_may_be_anywhere(make_scene: Callable[..., Path]):
    capture = with_points(make_scene(train=3, test=1))
    camera = capture.train[0].camera
    split, edge = camera.width // 2, WINDOW // 2
    depth = torch.ones(camera.height, camera.width)
    depth[:, :split] = torch.inf
    for free in clearing_of(capture, [GeometryGuess(depth)] * 3, 0.5).free:
        assert (free[:, : split - edge] == 0).all()
        assert (free[:, split - edge :] > 0).all()


def test_without_a_prior_the_nearest_point_says_how_far_it_is_free(make_scene: Callable[..., Path]):
    capture = with_points(make_scene(train=3, test=1))
    points = capture.points()
    found = clearing_of(capture, [GeometryGuess()] * 3, 0.5)
    for view, free in zip(capture.train, found.free, strict=True):
        number = [other.name for other in capture.views].index(view.name)
        _, depth = view.camera.project(points.positions[points.point[points.view == number]])
        assert free.numpy() == pytest.approx(0.5 * depth.min())


@pytest.mark.parametrize("told", [None, 2.0])
def test_what_stereo_is_sure_of_counts_first(make_scene: Callable[..., Path], told: float | None):
    capture = with_points(make_scene(train=3, test=1))
    camera = capture.train[0].camera
    size, half, edge = (camera.height, camera.width), camera.width // 2, WINDOW // 2
    sure = np.zeros(size, bool)
    sure[:, half:] = True
    guess = GeometryGuess(None if told is None else torch.full(size, told))
    without = clearing_of(capture, [guess] * 3, 0.5)
    near = float(min(free.min() for free in without.free))
    swept = [SweptDepth(np.where(sure, 4 * near, np.nan), sure)] * 3
    found = clearing_of(capture, [guess] * 3, 0.5, swept)
    for before, free in zip(without.free, found.free, strict=True):
        assert torch.equal(free[:, : half - edge], before[:, : half - edge])
        assert free[:, half + edge :].numpy() == pytest.approx(2 * near)


def test_a_fit_takes_them_away(make_scene: Callable[..., Path]):
    """With a share of 1, by which what is as near as the nearest point goes."""
    capture = with_points(make_scene(train=4, test=1))
    near = clearing_of(capture, [GeometryGuess()] * 4, 1.0)

    def left(clearing: float) -> int:
        settings = SunFadedSettings(iterations=80, surfels=400, fill=0.0, clearing=clearing)
        found = methods.load_method("sunfaded").fit(capture, methods.Priors(), settings, 0, silent)
        assert isinstance(found, SunFadedScene)
        return int(near(found.parameters.surfels).sum())

    assert left(0.0) > 3 * left(1.0)
