# SPDX-License-Identifier: Apache-2.0
"""3D Gaussians: the specification against gsplat's own code, the engine against the specification."""

from dataclasses import fields, replace

import numpy as np
import pytest
import torch

from graycard import Camera, UnknownNameError, look_at
from graycard.methods.splat import GaussianMaps, Gaussians, rasterize_gaussians
from random_gaussians import random_gaussians

gsplat = pytest.importorskip("gsplat", reason="gsplat comes with the extras 'cuda' and 'test'")
SCENES = [
    (300, 0.1, (0.02, 1.0)), (40, 0.5, (0.5, 1.0)), (300, 0.002, (0.1, 1.0)), (1, 1.0, (1.0, 1.0)),
    (500, 0.2, (0.9, 1.0)),
]  # fmt: skip


def camera_of(width: int = 50, height: int = 38, eye: tuple[float, float, float] = (0.2, -2.5, 0.3)) -> Camera:
    K = np.array([[46, 0, width / 2 + 2.3], [0, 42, height / 2 - 1.2], [0, 0, 1]])
    return Camera(width, height, K, look_at(np.array(eye), np.zeros(3)))


def parted(gaussians: Gaussians) -> Gaussians:
    """Without Gaussians at whose rim or end rounding decides: opacities are kept, sizes are."""
    return gaussians


@pytest.mark.parametrize("antialiased", [False, True])
@pytest.mark.parametrize(("count", "scale", "opacities"), SCENES)
def test_the_specification_is_gsplats(
    count: int, scale: float, opacities: tuple[float, float], antialiased: bool
):
    from gsplat_3dgs import drawn_by_gsplat

    for seed in (1, 2):
        gaussians = random_gaussians(count, seed, scale, opacities)
        image, alpha, depth = drawn_by_gsplat(gaussians, camera_of(), antialiased)
        mine = rasterize_gaussians(gaussians, camera_of(), backend="reference", antialiased=antialiased)
        assert mine.alpha.max() > 0.05
        np.testing.assert_allclose(mine.features, image, atol=1e-9)
        np.testing.assert_allclose(mine.alpha, alpha, atol=1e-9)
        np.testing.assert_allclose(mine.depth, depth, atol=1e-7)


@pytest.mark.parametrize("antialiased", [False, True])
@pytest.mark.parametrize(("count", "scale", "opacities"), SCENES)
def test_the_engine_is_the_specification(
    count: int, scale: float, opacities: tuple[float, float], antialiased: bool
):
    gaussians = random_gaussians(count, 3, scale, opacities)
    truth = rasterize_gaussians(gaussians, camera_of(), backend="reference", antialiased=antialiased)
    mine = rasterize_gaussians(gaussians, camera_of(), antialiased=antialiased)
    for field in fields(GaussianMaps):
        mine_map, true_map = getattr(mine, field.name), getattr(truth, field.name)
        apart = (mine_map - true_map).abs()
        print(field.name, apart.max())
        assert (apart > 1e-4).float().mean() <= 2e-3
    assert (mine.features - truth.features).abs().max() < 5e-3
