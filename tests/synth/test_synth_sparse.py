# SPDX-License-Identifier: Apache-2.0
"""Sparse points of a floor under cameras: where they lie, how far off, and who sees them."""

from dataclasses import replace

import numpy as np
import pytest

from graycard import Camera, Points, look_at
from graycard.synth import CaptureSettings
from graycard.synth.dataset._sparse import MIN_VIEWS, Sighting, sparse_points, triangulate

SIZE, FOV = 96, 50
EXACT = CaptureSettings(point_noise=0, outliers=0)
NOISY = CaptureSettings(outliers=0)


def floor_view(index: int, lit: float = np.inf, wall: float = np.inf) -> Sighting:
    """A chequered floor, z = 0, lit where x < ``lit``, hidden from above where x > ``wall``."""
    angle = index * 0.25
    eye = np.array([3 * np.sin(angle), -3 * np.cos(angle), 2.5])
    camera = Camera.from_fov(SIZE, SIZE, FOV, look_at(eye, np.zeros(3)))
    rays = camera.rays()
    position = eye - eye[2] / rays[..., 2:] * rays
    chequer = (np.floor(3 * position[..., 0]) + np.floor(3 * position[..., 1])) % 2
    shown = np.where(position[..., 0] < lit, 0.3 + 0.5 * chequer, 0.01)[..., None] * np.array([1, 0.8, 0.6])
    hidden = position[..., 0] > wall
    position = np.where(hidden[..., None], eye + 0.5 * (position - eye), position)
    normal = np.broadcast_to([0.0, 0.0, 1.0], position.shape)
    return Sighting(index, camera, shown, position, normal, np.ones((SIZE, SIZE), np.uint32))


@pytest.fixture(scope="module")
def views() -> list[Sighting]:
    return [floor_view(i) for i in range(5)]


@pytest.fixture(scope="module")
def cameras(views: list[Sighting]) -> dict[int, Camera]:
    return {v.index: v.camera for v in views}


def test_without_noise_points_lie_on_the_floor(views: list[Sighting], cameras: dict[int, Camera]) -> None:
    points = sparse_points(views, EXACT, 1000)
    assert len(points) > 50
    assert np.abs(points.positions[:, 2]).max() < 1e-9
    assert points.views.min() >= MIN_VIEWS
    for index, camera in cameras.items():
        here = points.view == index
        pixel, depth = camera.project(points.positions[points.point[here]])
        assert np.abs(pixel - points.pixel[here]).max() < 1e-6
        assert (depth > 0).all()
        assert ((pixel >= 0) & (pixel < SIZE)).all()


def covariance(points: Points, cameras: dict[int, Camera], noise: float) -> np.ndarray:
    """Return covariances of triangulated positions, ``(N, 3, 3)``, m², for a noise in pixels: ``σ² (Σ
    JᵀJ)⁻¹`` to first order.

    The slope J of the projection is found by central differences.
    """
    information = np.zeros((len(points), 3, 3))
    for index, camera in cameras.items():
        here = points.view == index
        places = points.positions[points.point[here]]
        apart = [camera.project(places + d)[0] - camera.project(places - d)[0] for d in 1e-4 * np.eye(3)]
        slope = np.stack(apart, axis=-1) / 2e-4
        np.add.at(information, points.point[here], np.einsum("mij,mik->mjk", slope, slope))
    return noise**2 * np.linalg.inv(information)


def test_noise_is_that_of_the_propagated_covariance(
    views: list[Sighting], cameras: dict[int, Camera]
) -> None:
    """Mahalanobis distance² of three numbers is chi-squared with mean 3 and variance 6."""
    exact = sparse_points(views, EXACT, 1000)
    squares = []
    for seed in range(1000, 1010):
        found = sparse_points(views, NOISY, seed)
        off = found.positions - exact.positions
        inverse = np.linalg.inv(covariance(exact, cameras, NOISY.point_noise))
        squares.append(np.einsum("ni,nij,nj->n", off, inverse, off))
    z = (np.mean(squares) - 3) / np.sqrt(6 / np.size(squares))
    assert abs(z) < 4, f"mean square {np.mean(squares):.3f} of {np.size(squares)}, z = {z:.1f}, bar 4"


def test_depth_error_grows_as_distance_squared_over_baseline() -> None:
    def sigma(distance: float, baseline: float) -> float:
        poses = [look_at(np.array([x, -distance, 0.0]), np.array([x, 0.0, 0.0])) for x in (0, baseline)]
        pair = {i: Camera.from_fov(SIZE, SIZE, FOV, pose) for i, pose in enumerate(poses)}
        pixel = np.array([camera.project(np.zeros(3))[0] for camera in pair.values()])
        colors = np.zeros((1, 3), np.uint8)
        one = Points(np.zeros((1, 3)), colors, np.array([0, 0]), np.array([0, 1]), pixel)
        focal = pair[0].K[0, 0]
        depth = np.sqrt(covariance(one, pair, 0.5)[0, 1, 1])
        assert depth == pytest.approx(np.sqrt(2) * 0.5 * distance**2 / (focal * baseline), rel=2e-2)
        return float(depth)

    assert sigma(4, 0.1) / sigma(2, 0.1) == pytest.approx(4, rel=1e-2)


def test_triangulation_finds_the_way_back(views: list[Sighting], cameras: dict[int, Camera]) -> None:
    exact = sparse_points(views, EXACT, 1000)
    away = replace(exact, positions=exact.positions + 0.05)
    assert np.abs(triangulate(away, cameras) - exact.positions).max() < 1e-9


def test_outliers_are_few_and_agree_with_their_pixels(
    views: list[Sighting], cameras: dict[int, Camera]
) -> None:
    right = sparse_points(views, NOISY, 1000)
    some = sparse_points(views, replace(NOISY, outliers=0.2), 1000)
    moved = (right.positions != some.positions).any(axis=-1)
    assert 0.02 < moved.mean() < 0.35
    assert np.linalg.norm(some.positions - right.positions, axis=-1)[moved].max() > 0.3
    assert some.views.min() >= 2
    for index, camera in cameras.items():
        here = some.view == index
        pixel = camera.project(some.positions[some.point[here]])[0]
        assert np.abs(pixel - some.pixel[here]).max() < 6 * NOISY.point_noise


def test_dark_places_give_no_points() -> None:
    points = sparse_points([floor_view(i, lit=0.0) for i in range(5)], EXACT, 1000)
    assert len(points) > 20
    assert points.positions[:, 0].max() < 0.1


def test_a_place_that_something_hides_is_not_seen(views: list[Sighting]) -> None:
    points = sparse_points([*views[:4], floor_view(4, wall=0.0)], EXACT, 1000)
    behind = points.positions[points.point[points.view == 4], 0]
    assert len(behind) > 5
    assert behind.max() < 0.1
    assert points.positions[:, 0].max() > 0.5


def test_equal_seeds_give_equal_points_and_others_do_not(views: list[Sighting]) -> None:
    first, again, other = (sparse_points(views, NOISY, seed) for seed in (1000, 1000, 1001))
    assert (first.positions == again.positions).all()
    assert (first.positions != other.positions).all()


def test_no_more_points_than_wanted(views: list[Sighting]) -> None:
    assert len(sparse_points(views, replace(NOISY, points=7), 1000)) == 7
    assert len(sparse_points(views, replace(NOISY, points=0), 1000)) == 0


def test_a_black_or_narrow_scene_gives_none(views: list[Sighting]) -> None:
    assert len(sparse_points([floor_view(i, lit=-np.inf) for i in range(4)], NOISY, 1000)) == 0
    assert len(sparse_points(views[:2], NOISY, 1000)) == 0


@pytest.mark.parametrize(("name", "value"), [("points", -1), ("point_noise", np.inf), ("outliers", 1.0)])
def test_settings_out_of_range_are_refused(name: str, value: float) -> None:
    with pytest.raises(ValueError, match=f"expected {name} to be"):
        CaptureSettings(**{name: value})  # pyright: ignore[reportArgumentType]
