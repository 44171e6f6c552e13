# SPDX-License-Identifier: Apache-2.0
"""The specification against gsplat 1.5's own PyTorch code for 2D Gaussian Splatting, which others wrote."""

from dataclasses import fields, replace

import numpy as np
import pytest
import torch

from graycard import Camera, look_at
from graycard.benchmarks.speed import _gsplat as peer
from graycard.methods import splat
from graycard.methods.splat._geometry import box_centres, disc_to_image, see
from random_surfels import random_surfels as any_surfels

pytest.importorskip("gsplat", reason="gsplat comes with the extra 'gpu'")

WIDER = 4
"""Times gsplat's boxes of 3.33 standard deviations, which cut off a part of discs that are near."""


def camera_of(width: int = 40, height: int = 30) -> Camera:
    K = np.array([[36, 0, width / 2 + 0.3], [0, 33, height / 2 - 0.2], [0, 0, 1]])
    return Camera(width, height, K, look_at(np.array([0.2, -2.5, 0.3]), np.zeros(3)))


def random_surfels(count: int, seed: int, scale: float = 0.15, opacity: float = 0.6) -> splat.Surfels:
    """In front of the camera, and too thin together to end a pixel."""
    return any_surfels(count, seed, 4, scale, opacities=(0.02, opacity), features=(-1.0, 1.0))


def drawn_by_gsplat(
    surfels: splat.Surfels, camera: Camera, wider: int = WIDER
) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
    """Features, alpha and normals in the world."""
    projected = peer.project(surfels, camera)
    detached = {f.name: getattr(projected, f.name).detach() for f in fields(projected)}
    detached["radii"] = detached["radii"] * wider
    pairs = peer.pairs_of(peer.Projected(**detached), surfels.opacities.detach(), camera)
    features, alpha, normals = peer.accumulate(projected, pairs, surfels.opacities, surfels.features, camera)
    return features, alpha, normals @ normals.new_tensor(camera.camera_to_world[:3, :3]).T


def assert_same(surfels: splat.Surfels, atol: float = 1e-11) -> None:
    features, alpha, normals = drawn_by_gsplat(surfels, camera_of())
    truth = splat.rasterize(surfels, camera_of(), backend="reference")
    assert truth.alpha.max() > 0.1
    np.testing.assert_allclose(alpha, truth.alpha, atol=atol)
    np.testing.assert_allclose(features, truth.features, atol=atol)
    np.testing.assert_allclose(normals, truth.normal, atol=atol)


def test_the_projection_is_gsplats():
    surfels, camera = random_surfels(50, 1000), camera_of()
    theirs, seen = peer.project(surfels, camera), see(surfels, camera)
    np.testing.assert_allclose(theirs.means2d[0], box_centres(seen, camera), atol=1e-10)
    np.testing.assert_allclose(theirs.ray_transforms[0], disc_to_image(seen, camera).mT, atol=1e-12)
    np.testing.assert_allclose(theirs.normals[0], seen.normals, atol=1e-12)
    np.testing.assert_allclose(theirs.depths[0], seen.centres[:, 2], atol=1e-12)


@pytest.mark.parametrize(("count", "scale"), [(40, 0.15), (1, 0.5), (15, 0.4), (60, 0.01), (30, 1e-5)])
def test_images_are_gsplats(count: int, scale: float):
    assert_same(random_surfels(count, 1001, scale))


def test_no_surfels_are_an_empty_picture_there_too():
    features, alpha, _ = drawn_by_gsplat(random_surfels(0, 1000), camera_of())
    assert features.shape == (30, 40, 4)
    assert alpha.abs().max() == 0


def test_gradients_are_gsplats():
    truth = random_surfels(25, 1002)
    weights = torch.rand(30, 40, 8, dtype=torch.float64, generator=torch.Generator().manual_seed(1000)) - 0.5
    found = []
    for ours in (True, False):
        surfels = splat.Surfels(*(getattr(truth, f.name).clone().requires_grad_() for f in fields(truth)))
        maps = splat.rasterize(surfels, camera_of(), backend="reference")
        images = (maps.features, maps.alpha, maps.normal) if ours else drawn_by_gsplat(surfels, camera_of())
        features, alpha, normals = images
        (torch.cat([features, alpha[:, :, None], normals], dim=2) * weights).sum().backward()
        found.append([getattr(surfels, f.name).grad for f in fields(surfels)])
    for mine, theirs in zip(*found, strict=True):
        assert theirs.norm() > 0
        assert (mine - theirs).norm() <= 1e-9 * theirs.norm()


def test_gsplats_boxes_cut_little():
    """Why its lists need wider boxes: a rim of alpha 1/255 and a bit is missing."""
    surfels = random_surfels(40, 1000)
    _, alpha, _ = drawn_by_gsplat(surfels, camera_of(), wider=1)
    truth = splat.rasterize(surfels, camera_of(), backend="reference").alpha
    missing = truth - alpha
    assert 0 < missing.max() < 0.01
    assert (missing > 1e-9).sum() < 40


def test_what_is_opaque_ends_otherwise():
    """gsplat cuts alpha at 0.999, not 0.99, and leaves out the surfel that would bring 1e-4."""
    camera = replace(camera_of(), camera_to_world=look_at(np.array([0, -2.5, 0]), np.zeros(3)))
    wall = replace(
        random_surfels(2, 1000),
        centres=torch.zeros(2, 3, dtype=torch.float64),
        rotations=torch.tensor([[0.5**0.5, 0.5**0.5, 0, 0]] * 2, dtype=torch.float64),
        scales=torch.full((2, 2), 1e3, dtype=torch.float64),
        opacities=torch.ones(2, dtype=torch.float64),
    )
    np.testing.assert_allclose(drawn_by_gsplat(wall, camera)[1], 0.999, atol=1e-5)
    truth = splat.rasterize(wall, camera, backend="reference").alpha
    np.testing.assert_allclose(truth, 1 - 0.01**2, atol=1e-6)


def test_the_lists_come_pixel_after_pixel_nearest_first():
    surfels, camera = random_surfels(40, 1003, scale=0.4), camera_of()
    projected = peer.project(surfels, camera)
    pairs = peer.pairs_of(projected, surfels.opacities, camera)
    step = pairs.pixels.diff()
    nearer = projected.depths[0][pairs.surfels].diff() > 0
    assert (step >= 0).all()
    assert nearer[step == 0].all()
    assert len(torch.unique(pairs.surfels * 1200 + pairs.pixels)) == len(pairs.pixels)


def test_lists_are_made_in_pieces(monkeypatch: pytest.MonkeyPatch):
    surfels, camera = random_surfels(40, 1000), camera_of()
    projected = peer.project(surfels, camera)
    whole = peer.pairs_of(projected, surfels.opacities, camera)
    monkeypatch.setattr(peer, "CANDIDATES", 100)
    pieces = peer.pairs_of(projected, surfels.opacities, camera)
    assert torch.equal(whole.surfels, pieces.surfels)
    assert torch.equal(whole.pixels, pieces.pixels)
