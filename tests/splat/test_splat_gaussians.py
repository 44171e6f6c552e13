# SPDX-License-Identifier: Apache-2.0
"""3D Gaussians: the specification against gsplat's own code, the engine against the specification."""

import time
from dataclasses import fields, replace
from typing import Any

import numba
import numpy as np
import pytest
import torch

from graycard import Camera, UnknownNameError, look_at
from graycard.methods.splat import GaussianMaps, Gaussians, Surfels, rasterize, rasterize_gaussians
from gsplat_3dgs import drawn_by_gsplat
from random_gaussians import random_gaussians
from random_surfels import random_surfels

pytest.importorskip("gsplat", reason="gsplat comes with the extras 'cuda' and 'test'")
SCENES = [
    (200, 0.1, (0.02, 1.0)), (40, 0.5, (0.5, 1.0)), (200, 0.002, (0.1, 1.0)), (1, 1.0, (1.0, 1.0)),
    (300, 0.2, (0.9, 1.0)),
]  # fmt: skip
"""Many, large, smaller than a pixel, one, and so opaque that pixels end."""
EYES = [(0.2, -2.5, 0.3), (0.5, 0.1, 0.2)]
"""Before the cloud, and within it: some are behind, near, or far outside of the image."""


def camera_of(eye: tuple[float, float, float] = EYES[0]) -> Camera:
    K = np.array([[46, 0, 27.3], [0, 42, 17.8], [0, 0, 1]])
    return Camera(50, 38, K, look_at(np.array(eye), np.array([0, 0, 0.1])))


@pytest.mark.parametrize("eye", EYES)
@pytest.mark.parametrize("antialiased", [False, True])
@pytest.mark.parametrize(("count", "scale", "opacities"), SCENES)
def test_the_specification_is_gsplats(
    count: int,
    scale: float,
    opacities: tuple[float, float],
    antialiased: bool,
    eye: tuple[float, float, float],
):
    gaussians, camera = random_gaussians(count, 1, scale, opacities), camera_of(eye)
    image, alpha, depth = drawn_by_gsplat(gaussians, camera, antialiased)
    mine = rasterize_gaussians(gaussians, camera, backend="reference", antialiased=antialiased)
    assert mine.alpha.max() > 0.05 or count == 1
    np.testing.assert_allclose(mine.features, image, atol=1e-9)
    np.testing.assert_allclose(mine.alpha, alpha, atol=1e-9)
    np.testing.assert_allclose(mine.depth, depth, atol=1e-7)


@pytest.mark.parametrize("eye", EYES)
@pytest.mark.parametrize("antialiased", [False, True])
@pytest.mark.parametrize(("count", "scale", "opacities"), SCENES)
def test_the_engine_is_the_specification(
    count: int,
    scale: float,
    opacities: tuple[float, float],
    antialiased: bool,
    eye: tuple[float, float, float],
):
    gaussians, camera = random_gaussians(count, 3, scale, opacities), camera_of(eye)
    truth = rasterize_gaussians(gaussians, camera, backend="reference", antialiased=antialiased)
    mine = rasterize_gaussians(gaussians, camera, antialiased=antialiased)
    for field in fields(GaussianMaps):
        apart = (getattr(mine, field.name) - getattr(truth, field.name)).abs()
        assert (apart > 1e-4).double().mean() <= 2e-3, field.name  # where rounding decides at 1/255 or 1e-4
    assert (mine.features - truth.features).abs().max() < 1e-2


def test_gradients_of_the_specification_are_gsplats():
    weights = torch.rand(38, 50, 4, dtype=torch.float64, generator=torch.Generator().manual_seed(5)) - 0.5
    truth, found = random_gaussians(40, 4, 0.2), []
    for ours in (True, False):
        leaves = [getattr(truth, f.name).clone().requires_grad_() for f in fields(truth)]
        gaussians = Gaussians(*leaves)
        if ours:
            maps = rasterize_gaussians(gaussians, camera_of(), backend="reference", antialiased=True)
            image, alpha = maps.features, maps.alpha
        else:
            image, alpha, _ = drawn_by_gsplat(gaussians, camera_of(), antialiased=True)
        (torch.cat([image, alpha[:, :, None]], dim=2) * weights).sum().backward()
        found.append([leaf.grad for leaf in leaves])
    for mine, theirs in zip(*found, strict=True):
        assert mine is not None
        assert theirs is not None
        assert theirs.norm() > 0
        assert (mine - theirs).norm() <= 1e-7 * theirs.norm()


def test_a_ball_before_the_camera_is_a_disc_of_known_width():
    """Standard deviation f s / z, and 0.3 squared pixels: alpha at the centre's pixel and one beside."""
    K = np.array([[40.0, 0, 8.5], [0, 40.0, 8.5], [0, 0, 1]])
    camera = Camera(17, 17, K, np.eye(4))
    ball = Gaussians(*map(torch.tensor, ([[0.0, 0, 2]], [[1.0, 0, 0, 0]], [[0.1] * 3], [0.8], [[1.0]])))
    maps = rasterize_gaussians(ball, camera)
    variance = (40 * 0.1 / 2) ** 2 + 0.3
    assert maps.alpha[8, 8].item() == pytest.approx(0.8, rel=1e-6)
    assert maps.alpha[8, 9].item() == pytest.approx(0.8 * np.exp(-0.5 / variance), rel=1e-5)
    assert maps.depth[8, 8].item() == pytest.approx(2.0)
    thin = rasterize_gaussians(ball, camera, antialiased=True)
    assert thin.alpha[8, 8].item() == pytest.approx(0.8 * 4 / variance, rel=1e-5)


@pytest.mark.parametrize("channels", [pytest.param(1, marks=pytest.mark.slow), 5])
def test_the_number_of_channels_is_free(channels: int):
    gaussians = random_gaussians(60, 6, channels=channels)
    truth = rasterize_gaussians(gaussians, camera_of(), backend="reference").features
    mine = rasterize_gaussians(gaussians, camera_of()).features
    assert mine.shape == truth.shape == (38, 50, channels)
    assert ((mine - truth).abs() > 1e-4).double().mean() <= 2e-3


def test_what_is_behind_or_too_thin_is_not_drawn():
    gaussians = random_gaussians(30, 7)
    behind = replace(gaussians, centres=gaussians.centres - torch.tensor([0.0, 10, 0], dtype=torch.float64))
    faint = replace(gaussians, opacities=gaussians.opacities * 0 + 0.0039)
    for none in (behind, faint, random_gaussians(0, 7)):
        for backend in ("cpu", "reference"):
            maps = rasterize_gaussians(none, camera_of(), backend=backend)
            assert maps.alpha.abs().max() == 0
            assert maps.depth.abs().max() == 0


def test_the_engine_repeats_itself():
    gaussians = random_gaussians(300, 8)
    first, again = (rasterize_gaussians(gaussians, camera_of()) for _ in range(2))
    assert torch.equal(first.features, again.features)
    assert torch.equal(first.median_depth, again.median_depth)


def test_what_cannot_be_drawn_is_refused():
    gaussians = random_gaussians(3, 9)
    with pytest.raises(ValueError, match=r"expected scales of shape \(3, 3\), got \(3, 2\)"):
        replace(gaussians, scales=gaussians.scales[:, :2])
    with pytest.raises(ValueError, match=r"expected scales to be positive, got .* at Gaussian 0"):
        replace(gaussians, scales=gaussians.scales * 0)
    with pytest.raises(ValueError, match=r"expected scales of shape \(3, 2\)"):
        Surfels(*(getattr(gaussians, f.name) for f in fields(gaussians)))
    with pytest.raises(ValueError, match="expected Gaussians without gradients on the back end cpu"):
        rasterize_gaussians(replace(gaussians, centres=gaussians.centres.requires_grad_()), camera_of())
    with pytest.raises(ValueError, match="expected features of shape"):
        rasterize_gaussians(random_gaussians(3, 9), camera_of(), features=torch.ones(2, 3))
    discs: Any = random_surfels(3)
    unknown: Any = "cuda"
    with pytest.raises(ValueError, match="expected Gaussians, got Surfels"):
        rasterize_gaussians(discs, camera_of())
    with pytest.raises(UnknownNameError, match="back end"):
        rasterize_gaussians(gaussians, camera_of(), backend=unknown)


def test_ellipsoids_cost_less_than_twice_as_many_discs():
    """Least processor time of calls in turn, one thread: other programs on the machine matter little."""
    gaussians = random_gaussians(10_000, 10, 0.03, (0.1, 1.0))
    tensors = [getattr(gaussians, f.name).float() for f in fields(gaussians)]
    solids = Gaussians(*tensors)  # pyright: ignore[reportCallIssue]
    tensors[2] = tensors[2][:, :2]
    discs = Surfels(*tensors)  # pyright: ignore[reportCallIssue]
    camera = Camera.from_fov(256, 256, 50, look_at(np.array([0, -3.5, 0.5]), np.zeros(3)))
    draw = {"solids": lambda: rasterize_gaussians(solids, camera), "discs": lambda: rasterize(discs, camera)}
    threads, least = numba.get_num_threads(), dict.fromkeys(draw, np.inf)
    numba.set_num_threads(1)
    try:
        for _ in range(8):
            for name, call in draw.items():
                begun = time.process_time()
                call()
                least[name] = min(least[name], time.process_time() - begun)
    finally:
        numba.set_num_threads(threads)
    assert least["solids"] < 2 * least["discs"]
