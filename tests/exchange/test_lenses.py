# SPDX-License-Identifier: Apache-2.0
"""Lenses against COLMAP's own code, and pictures of them made straight and small."""

import sys
import time
import tracemalloc
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from graycard import Camera, DatasetError, GraycardError
from graycard.exchange import _lens
from graycard.exchange._cameras import PosedPhotograph, make_shot
from graycard.exchange._develop import develop, develop_mask, develop_pixels, undistorted, with_width
from graycard.exchange._lens import BrownLens, FisheyeLens, Intrinsics, make_intrinsics
from posed_photographs import LENSES, SIZE

pycolmap = pytest.importorskip("pycolmap")
BENT = sorted(set(LENSES) - {"SIMPLE_PINHOLE", "PINHOLE"})


def intrinsics(model: str) -> Intrinsics:
    return make_intrinsics(model, SIZE, tuple(LENSES[model]), "a test")


def shot(model: str, width: int | None = None) -> PosedPhotograph:
    return with_width(make_shot(Path("x.png"), "x", intrinsics(model), np.eye(4), "a test"), width)


def theirs(model: str) -> Any:
    return pycolmap.Camera(model=model, width=SIZE[0], height=SIZE[1], params=LENSES[model])


def own_coordinates() -> np.ndarray:
    """A picture whose pixels hold their own places, shape ``(H, W, 3)``."""
    x, y = np.meshgrid(np.arange(SIZE[0]) + 0.5, np.arange(SIZE[1]) + 0.5)
    return np.dstack([x, y, np.ones_like(x)]).astype(np.float32)


@pytest.mark.parametrize("model", BENT)
def test_lenses_are_those_of_colmap(model: str):
    lens = intrinsics(model).lens
    assert lens is not None
    directions = np.random.default_rng(1).uniform(-0.45, 0.45, (200, 2))
    rays = np.column_stack([directions, np.ones(200)])
    np.testing.assert_allclose(lens.pixels(directions), theirs(model).img_from_cam(rays), atol=1e-9)
    np.testing.assert_allclose(lens.directions(lens.pixels(directions)), directions, atol=1e-6)
    assert lens.directions(np.zeros((0, 2))).shape == (0, 2)


@pytest.mark.parametrize("model", BENT)
def test_a_pixel_shows_one_direction_or_none(model: str):
    """Far outside of the photograph lenses fold, or look behind themselves; nothing there may be made up."""
    lens = intrinsics(model).lens
    assert lens is not None
    pixels = np.random.default_rng(4).uniform(-4, 5, (2000, 2)) * SIZE
    found = lens.directions(pixels)
    there = np.asarray(np.isfinite(found).all(axis=-1))
    assert np.isnan(found[~there]).all()
    assert np.abs(lens.pixels(found[there]) - pixels[there]).max() < 0.02
    inside = np.logical_and(pixels > 0, pixels < np.array(SIZE)).all(axis=-1)
    assert there[inside].all()


@pytest.mark.parametrize("model", [m for m in BENT if "FISHEYE" in m and "PRISM" not in m])
def test_a_fisheye_sees_up_to_a_right_angle(model: str):
    lens = intrinsics(model).lens
    assert isinstance(lens, FisheyeLens)
    angles = np.radians([0.0, 5, 60, 85, 89, 91, 100, 170])
    directions = np.column_stack([np.tan(angles[:5]), np.zeros(5)])
    k1, k2, k3, k4 = lens.coefficients
    bent = angles * (1 + k1 * angles**2 + k2 * angles**4 + k3 * angles**6 + k4 * angles**8)
    pixels = np.column_stack([lens.centre[0] + lens.focal[0] * bent, np.full(8, lens.centre[1])])
    found = lens.directions(pixels)
    np.testing.assert_allclose(found[:5], directions, rtol=1e-6, atol=1e-9)
    folds = np.diff(bent) <= 0  # beyond a fold radii come back, and the nearer angle shows them
    assert folds.any() or np.isnan(found[5:]).all()


def test_radii_beyond_half_pi_are_no_right_angle():
    """OpenCV takes them for one before it looks at the coefficients."""
    lens = make_intrinsics("OPENCV_FISHEYE", SIZE, (60, 60, 60, 40, 0.3, 0, 0, 0), "a test").lens
    assert lens is not None
    radius = 1.3 * (1 + 0.3 * 1.3**2)
    assert radius > np.pi / 2
    found = lens.directions(np.array([[60 + 60 * radius, 40.0]]))
    np.testing.assert_allclose(found, [[np.tan(1.3), 0]], rtol=1e-9)


def test_maps_are_found_in_bands(monkeypatch: pytest.MonkeyPatch):
    lens = intrinsics("THIN_PRISM_FISHEYE").lens
    assert lens is not None
    K, width, height = np.array([[300.0, 0, 250], [0, 300, 190], [0, 0, 1]]), 500, 400
    monkeypatch.setattr(_lens, "_BAND", 3000)
    tracemalloc.start()
    columns, rows = lens.maps(K, width, height)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert columns.dtype == rows.dtype == np.float32
    assert peak < 1.5 * (columns.nbytes + rows.nbytes)
    x, y = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
    flat = np.column_stack([(x.ravel() - 250) / 300, (y.ravel() - 190) / 300])
    expected = lens.pixels(flat).reshape(height, width, 2) - 0.5
    np.testing.assert_allclose(np.dstack([columns, rows]), expected, atol=1e-4)


def test_threads_share_a_map(monkeypatch: pytest.MonkeyPatch):
    made, whole = [], BrownLens.maps

    def slow(lens: BrownLens, K: np.ndarray, width: int, height: int) -> tuple[np.ndarray, np.ndarray]:
        made.append(lens)
        time.sleep(0.05)
        return whole(lens, K, width, height)

    monkeypatch.setattr(BrownLens, "maps", slow)
    photographs = [make_shot(Path(f"{i}.png"), f"{i}", _odd_lens(), np.eye(4), "a test") for i in range(8)]
    straight = [with_width(photograph, None) for photograph in photographs]
    with ThreadPoolExecutor(4) as pool:
        list(pool.map(lambda s: develop(own_coordinates(), s), straight))
    assert len(made) == 1


def _odd_lens() -> Intrinsics:
    """Return a lens that no other test has, and so no map of it is kept."""
    return make_intrinsics("OPENCV", SIZE, (91.25, 92, 61, 39, -0.2, 0.1, 0.002, -0.004), "a test")


@pytest.mark.parametrize("model", BENT)
def test_an_undistorted_picture_shows_what_its_pinhole_sees(model: str):
    """Each pixel holds the place in the photograph that it was taken from; COLMAP's code says which it is."""
    straight = shot(model)
    found = develop(own_coordinates(), straight)
    camera = straight.camera
    assert found.shape == (camera.height, camera.width, 3)
    rays = camera.rays().reshape(-1, 3)
    expected = np.asarray(theirs(model).img_from_cam(rays / rays[:, 2:])).reshape(found.shape[0], -1, 2)
    assert np.abs(found[..., :2] - expected).max() < 0.05  # up to the border: nothing is made up


@pytest.mark.parametrize(
    ("model", "numbers"),
    [
        ("SIMPLE_RADIAL", [60, 29.3, 25.1, -0.1]),
        ("SIMPLE_RADIAL_FISHEYE", [60, 29.3, 25.1, 0.05]),
        ("RADIAL_FISHEYE", [60, 29.3, 25.1, 0.05, -0.01]),
        ("THIN_PRISM_FISHEYE", [60, 63, 29.3, 25.1, 0.02, 0.01, 0.001, -0.001, 0.001, 0, 0.002, -0.001]),
        ("OPENCV", [60, 63, 40.3, 12.1, 0.1, 0, 0, 0]),
        ("OPENCV", [60, 60, 32, 24, 1e-6, 0, 0, 0]),
    ],
)
def test_small_pictures_off_centre_are_right_up_to_their_border(model: str, numbers: list[float]):
    size = 64, 48
    made = make_intrinsics(model, size, tuple(map(float, numbers)), "a test")
    straight = with_width(make_shot(Path("x.png"), "x", made, np.eye(4), "a test"), None)
    x, y = np.meshgrid(np.arange(64) + 0.5, np.arange(48) + 0.5)
    found = develop(np.dstack([x, y, x]).astype(np.float32), straight)
    rays = straight.camera.rays().reshape(-1, 3)
    camera = pycolmap.Camera(model=model, width=64, height=48, params=numbers)
    expected = np.asarray(camera.img_from_cam(rays / rays[:, 2:])).reshape(*found.shape[:2], 2)
    assert np.abs(found[..., :2] - expected).max() < 0.05
    assert found.shape[0] * found.shape[1] > 0.85 * 64 * 48 * (0.9 if model == "OPENCV" else 1)


@pytest.mark.parametrize("model", ["OPENCV", "SIMPLE_RADIAL", "OPENCV_FISHEYE"])
def test_as_much_of_the_photograph_is_kept_as_colmaps_undistorter_keeps(model: str):
    other = pycolmap.undistort_camera(pycolmap.UndistortCameraOptions(), theirs(model))
    camera = shot(model).camera
    assert camera.width * camera.height > 0.9 * other.width * other.height
    np.testing.assert_allclose([camera.K[0, 0], camera.K[1, 1]], [other.focal_length_x, other.focal_length_y])


def test_keypoints_go_with_their_picture():
    small = shot("OPENCV", 50)
    directions = np.random.default_rng(2).uniform(-0.3, 0.3, (50, 2))
    rays = np.column_stack([directions, np.ones(50)])
    expected = small.camera.project(rays)[0]
    found = develop_pixels(np.asarray(theirs("OPENCV").img_from_cam(rays)), small)
    np.testing.assert_allclose(found, expected, atol=1e-6)
    straight = shot("PINHOLE", 50)
    found = develop_pixels(np.asarray(theirs("PINHOLE").img_from_cam(rays)), straight)
    np.testing.assert_allclose(found, straight.camera.project(rays)[0], atol=1e-9)


def test_a_width_averages_areas_in_linear_light():
    image = np.random.default_rng(3).random((80, 120, 3)).astype(np.float32)
    small = shot("PINHOLE", 40)
    assert (small.camera.width, small.camera.height) == (40, 27)
    half = shot("SIMPLE_PINHOLE", 60)
    np.testing.assert_allclose(develop(image, half), image.reshape(40, 2, 60, 2, 3).mean((1, 3)), rtol=1e-5)
    np.testing.assert_allclose(develop(image, small).mean((0, 1)), image.mean((0, 1)), rtol=1e-3)
    assert shot("PINHOLE", 500).camera.width == 120  # nothing is made larger


def test_masks_follow_their_photograph():
    left = np.zeros((80, 120), bool)
    left[:, :60] = True
    assert develop_mask(left, shot("PINHOLE")) is left
    found = develop_mask(left, shot("SIMPLE_RADIAL", 60))
    assert found[:, :28].all()
    assert not found[:, 32:].any()


@pytest.mark.parametrize(
    ("model", "zeros"),
    [("SIMPLE_RADIAL", 1), ("RADIAL", 2), ("OPENCV", 4), ("FULL_OPENCV", 8), ("DIVISION", 1)],
)
def test_a_lens_that_bends_nothing_is_a_pinhole(model: str, zeros: int):
    focal = [40.0] if model in ("SIMPLE_RADIAL", "RADIAL") else [40.0, 40.0]
    found = make_intrinsics(model, (32, 24), (*focal, 16, 12, *[0.0] * zeros), "a test")
    assert found.lens is None
    assert (found.focal, found.centre) == ((40, 40), (16, 12))
    assert make_intrinsics("FISHEYE", (32, 24), (40, 40, 16, 12), "a test").lens is not None


@pytest.mark.parametrize(
    ("model", "numbers", "message"),
    [
        ("EQUIRECTANGULAR", [32, 24], "expected a camera of model .* got EQUIRECTANGULAR"),
        ("OPENCV", [40, 40, 16, 12], "expected 8 parameters of OPENCV in a test, got 4"),
        ("PINHOLE", [40, -40, 16, 12], "expected a size, fx, fy > 0"),
        ("PINHOLE", [40, 40, float("nan"), 12], "expected a size, fx, fy > 0 and finite numbers"),
    ],
)
def test_cameras_that_are_none(model: str, numbers: list[float], message: str):
    with pytest.raises(DatasetError, match=message):
        make_intrinsics(model, (32, 24), tuple(numbers), "a test")


def test_a_lens_that_folds_at_its_centre():
    lens = make_intrinsics("SIMPLE_RADIAL", (32, 24), (40, 16, 12, -9000), "a test").lens
    assert lens is not None
    camera = Camera(32, 24, np.array([[40, 0, 16], [0, 40, 12], [0, 0, 1.0]]), np.eye(4))
    with pytest.raises(DatasetError, match="expected a lens that shows a rectangle"):
        undistorted(lens, camera)


def test_pycolmap_is_asked_for_by_name(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setitem(sys.modules, "pycolmap", None)
    with pytest.raises(
        GraycardError, match=r"of model FOV, got none\. Run `pip install 'graycard\[cameras\]'`"
    ):
        make_intrinsics("FOV", SIZE, tuple(LENSES["FOV"]), "a test")
    assert make_intrinsics("OPENCV", SIZE, tuple(LENSES["OPENCV"]), "a test").lens is not None
