# SPDX-License-Identifier: Apache-2.0
"""The kernels of stereo against what they stand for, written with whole arrays."""

import numba
import numpy as np
import pytest
import torch
from scipy.interpolate import LinearNDInterpolator, NearestNDInterpolator
from torch.nn.functional import avg_pool2d, grid_sample

from graycard import Camera, look_at
from graycard.methods.surfels._ncc import NOISE, SweptView, mean_ncc
from graycard.methods.surfels._paths import semi_global
from graycard.methods.surfels._planes import with_planes
from graycard.methods.surfels._sweep import SweptDepth, sweep_depths
from graycard.methods.surfels._transfer import HIDES, count_hidden, depth_ratio
from graycard.methods.surfels._triangles import filled_depth

HEIGHT, WIDTH = 22, 31


def camera_at(x: float, y: float, width: int = WIDTH) -> Camera:
    """It looks at the origin from 1.5 m above; no two coefficients of its intrinsics are equal."""
    pose = look_at(np.array([x, y, 1.5]), np.array([0.02, 0, 0]), up=(0.1, 1, 0))
    K = np.array([[40.0, 0.3, width / 2 + 1], [0, 43, HEIGHT / 2 - 2], [0, 0, 1]])
    return Camera(width, HEIGHT, K, pose)


def view_at(x: float, y: float, width: int = WIDTH) -> SweptView:
    """A photograph of waves on the plane z = 0."""
    camera = camera_at(x, y, width)
    rays = camera.rays()
    points = camera.position - rays * (camera.position[2] / rays[..., 2])[..., None]
    waves = np.random.default_rng(0).normal(size=(24, 3)) * 20
    grey = 0.5 + 0.06 * np.sin(points @ waves.T + np.arange(24)).sum(axis=-1)
    return SweptView(camera, torch.from_numpy(grey.astype(np.float32)), 0.8, 2.5)


def box_mean(images: torch.Tensor, window: int) -> torch.Tensor:
    """Mean over a square window; at the border over what there is."""
    return avg_pool2d(images, window, 1, window // 2, count_include_pad=False)


def correlation(view: SweptView, partner: SweptView, inverse: np.ndarray, window: int) -> torch.Tensor:
    """Normalised cross-correlation of windows, in float64, by points in the world."""
    rays = view.camera.rays() / (view.camera.rays() @ view.camera.forward)[..., None]
    pixels, z = partner.camera.project(view.camera.position + rays / inverse[..., None])
    size = np.array([partner.camera.width, partner.camera.height])
    seen = torch.from_numpy((z > 0) & (pixels > 0).all(axis=-1) & (pixels < size).all(axis=-1))
    images = partner.grey.double().expand(len(inverse), 1, -1, -1)
    grid = torch.from_numpy(2 * pixels / size - 1)
    warped = grid_sample(images, grid, align_corners=False, padding_mode="border")
    mine = view.grey.double()[None, None]
    mean, other = box_mean(mine, window), box_mean(warped, window)
    covariance = box_mean(mine * warped, window) - mean * other
    variances = box_mean(mine * mine, window) - mean**2, box_mean(warped * warped, window) - other**2
    alike = covariance / ((variances[0] * variances[1]).clamp(min=0).sqrt() + NOISE)
    return torch.where(seen, alike[:, 0], 0.0)


@pytest.mark.parametrize(("window", "count"), [(5, 1), (7, 2), (3, 3), (7, 4)])
def test_likeness_is_the_mean_correlation_of_the_better_half(window: int, count: int):
    view = view_at(0, 0)
    partners = [view_at(0.2, 0), view_at(-0.3, 0.1, 27), view_at(0.1, 0.4), view_at(0.05, -0.3)][:count]
    planes = np.array([0.5, 0.65, 1.1])[:, None, None]
    slanted = planes * np.linspace(0.8, 1.2, WIDTH) * np.ones((HEIGHT, 1))
    for inverse in (planes, slanted):
        each = torch.stack([correlation(view, one, inverse, window) for one in partners])
        expected = each.topk((count + 1) // 2, dim=0).values.mean(dim=0)
        found = mean_ncc(view, partners, inverse, window)
        assert found.dtype == np.float32
        np.testing.assert_allclose(found, expected, atol=1e-3)


def test_what_a_partner_does_not_see_is_not_like_it():
    """Nearer than the pinhole of one that stands before the view, and beside its image."""
    view, ahead = view_at(0, 0), view_at(0, 0)
    pose = view.camera.camera_to_world.copy()
    pose[:3, 3] += 0.5 * view.camera.forward
    ahead = SweptView(Camera(WIDTH, HEIGHT, view.camera.K, pose), view.grey, 0.8, 2.5)
    behind, before = mean_ncc(view, [ahead], np.array([1 / 0.4, 1 / 1.5])[:, None, None], 5)
    assert not behind.any()
    assert (before == 0)[0].all()  # the first row of the view is not in the image of the nearer one
    assert (before != 0)[HEIGHT // 2, 5:-5].all()


def path_costs(lines: np.ndarray, step: np.ndarray, jump: np.ndarray) -> np.ndarray:
    """The least cost of a path that ends at each pixel and label, along the first axis."""
    paths = np.empty_like(lines)
    paths[0] = lines[0]
    for here in range(1, len(lines)):
        before = paths[here - 1]
        least = before.min(axis=-1, keepdims=True)
        beside = np.pad(before, ((0, 0), (1, 1)), constant_values=np.inf)
        stepped = np.minimum(beside[:, :-2], beside[:, 2:]) + step[here - 1]
        paths[here] = lines[here] + np.minimum(np.minimum(before, stepped), least + jump[here - 1]) - least
    return paths


@pytest.mark.parametrize("labels", [1, 2, 9])
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("eased", [False, True])
def test_paths_from_four_sides_cost_to_the_bit_what_the_recurrence_says(
    labels: int, dtype: type, eased: bool
):
    random = np.random.default_rng(labels)
    cost = random.random((7, 5, labels)).astype(dtype)
    ease = random.uniform(0.1, 1, (6, 5)), random.uniform(0.1, 1, (7, 4))
    expected = np.zeros_like(cost)
    for axis, factor in enumerate(ease if eased else (np.ones((6, 5)), np.ones((7, 4)))):
        lines, weights = np.moveaxis(cost, axis, 0), np.moveaxis(factor, axis, 0)[..., None]
        for way in (1, -1):
            paths = path_costs(lines[::way], 0.1 * weights[::way], 0.3 * weights[::way])
            expected += np.moveaxis(paths[::way], 0, axis)
    np.testing.assert_array_equal(semi_global(cost, 0.1, 0.3, ease if eased else None), expected)


def test_ratio_of_depths_is_that_of_points_in_the_world():
    here, other = camera_at(0, 0), camera_at(0.5, -0.2, 27)
    random = np.random.default_rng(0)
    depth, there = random.uniform(0.3, 3, (HEIGHT, WIDTH)), random.uniform(1, 2, (HEIGHT, 27))
    depth[:3], there[5] = np.nan, np.nan
    rays = here.rays() / (here.rays() @ here.forward)[..., None]
    pixels, z = other.project(here.position + rays * depth[..., None])
    expected = np.full(depth.shape, np.nan)
    for row, column in np.ndindex(depth.shape):
        x, y = pixels[row, column]
        if z[row, column] > 0 and 0 <= x < 27 and 0 <= y < HEIGHT:
            expected[row, column] = z[row, column] / there[int(y), int(x)]
    assert 0.1 < np.isfinite(expected).mean() < 0.9
    both = depth_ratio(here, np.stack([np.ones_like(depth), depth]), other, there)
    np.testing.assert_allclose(depth_ratio(here, depth, other, there), expected, rtol=1e-12)
    np.testing.assert_array_equal(both[1], depth_ratio(here, depth, other, there))


def test_what_hides_is_counted_as_ratios_say():
    """To the bit, also where the other view is not sure or sees nothing."""
    here, other = camera_at(0, 0), camera_at(0.5, -0.2, 27)
    random = np.random.default_rng(0)
    depth, there = random.uniform(0.3, 3, (2, HEIGHT, WIDTH)), random.uniform(1, 2, (HEIGHT, 27))
    depth[0, :3], there[5] = np.nan, np.nan
    for kind in (np.float64, np.float32):
        sure, counts = random.random(there.shape) > 0.3, np.full(depth.shape, 7, np.int32)
        told = there.astype(kind)
        hides = depth_ratio(here, depth, other, np.where(sure, told, np.nan)) < 1 - HIDES
        count_hidden(here, depth, other, told, sure, counts)
        np.testing.assert_array_equal(counts - 7, hides)
        assert 0.05 < hides.mean() < 0.9


def test_points_behind_the_other_view_have_no_ratio():
    here = camera_at(0, 0)
    away = Camera(WIDTH, HEIGHT, here.K, look_at(here.position, here.position - here.forward, (0, 1, 0)))
    assert np.isnan(depth_ratio(here, np.ones((HEIGHT, WIDTH)), away, np.ones((HEIGHT, WIDTH)))).all()


@pytest.mark.parametrize("on_pixels", [True, False])
def test_inverse_depth_is_linear_within_triangles_and_that_of_the_nearest_outside(on_pixels: bool):
    random = np.random.default_rng(3)
    if on_pixels:
        row, column = np.nonzero(random.random((HEIGHT, WIDTH)) < 0.5)
        pixels = np.stack([column, row], axis=1) + 0.5
    else:
        pixels = random.uniform(3, 20, (40, 2))
    depths = random.uniform(1, 3, len(pixels))
    x, y = np.meshgrid(np.arange(WIDTH) + 0.5, np.arange(HEIGHT) + 0.5)
    linear = LinearNDInterpolator(pixels, 1 / depths)(x, y)
    nearest = NearestNDInterpolator(pixels, 1 / depths)(x, y)
    expected = 1 / np.where(np.isfinite(linear), linear, nearest)
    np.testing.assert_allclose(filled_depth(pixels, depths, (HEIGHT, WIDTH)), expected, rtol=1e-9)


def stereo() -> list[SweptDepth]:
    views = [view_at(x, 0.1 * x) for x in (-0.3, -0.1, 0.1, 0.3)]
    return with_planes(views, sweep_depths(views), 0)


def test_any_number_of_threads_gives_the_same_bits():
    before, found = numba.get_num_threads(), []
    try:
        for threads in (1, before):
            numba.set_num_threads(threads)
            found.append(stereo())
    finally:
        numba.set_num_threads(before)
    for one, many in zip(*found, strict=True):
        np.testing.assert_array_equal(one.depth, many.depth)
        np.testing.assert_array_equal(one.sure, many.sure)
    assert np.mean([one.sure.mean() for one in found[0]]) > 0.5
