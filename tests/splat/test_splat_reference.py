# SPDX-License-Identifier: Apache-2.0
"""The specification itself, against closed forms, the paper's own equations and finite differences."""

from dataclasses import fields, replace
from functools import partial

import numpy as np
import pytest
import torch
from scipy.spatial.transform import Rotation

from graycard import Camera, look_at
from graycard.methods import splat
from graycard.methods.splat._geometry import box_centres, see
from graycard.methods.splat.reference._rasterize import rasterize_reference
from random_surfels import random_surfels as any_surfels


def camera_of(width: int = 9, height: int = 7, focal: float = 8.0, pose: np.ndarray | None = None) -> Camera:
    K = np.array([[focal, 0, width / 2], [0, focal, height / 2], [0, 0, 1]])
    return Camera(width, height, K, np.eye(4) if pose is None else pose)


def surfels_of(
    centres: list[list[float]],
    opacities: list[float],
    scale: float = 0.1,
    rotation: tuple[float, float, float, float] = (1, 0, 0, 0),
) -> splat.Surfels:
    count = len(centres)
    double = torch.float64
    return splat.Surfels(
        torch.tensor(centres, dtype=double).reshape(count, 3),
        torch.tensor([rotation] * count, dtype=double).reshape(count, 4),
        torch.full((count, 2), scale, dtype=double),
        torch.tensor(opacities, dtype=double),
        torch.arange(1, 2 * count + 1, dtype=double).reshape(count, 2),
    )


IN_FRONT = ((-1.0, -1.0, 1.5), (1.0, 1.0, 3.0))
"""Box in front of a camera at the origin."""
random_surfels = partial(any_surfels, scale=0.2, box=IN_FRONT, opacities=(0.2, 0.97), features=(-1.0, 1.0))


def test_a_disc_that_faces_the_camera_is_a_gaussian():
    camera = camera_of(33, 33, focal=40)
    maps = rasterize_reference(surfels_of([[0, 0, 2]], [0.9], scale=0.2), camera)
    x = np.arange(33) - 16.0
    square = (x**2 + x[:, None] ** 2) / (40 / 2 * 0.2) ** 2
    alpha = 0.9 * np.exp(-0.5 * square)
    alpha[alpha < 1 / 255] = 0
    np.testing.assert_allclose(maps.alpha, alpha, atol=1e-14)
    np.testing.assert_allclose(maps.features, alpha[..., None] * [1, 2], atol=1e-13)
    np.testing.assert_allclose(maps.normal, alpha[..., None] * [0, 0, -1], atol=1e-14)
    np.testing.assert_allclose(maps.depth, np.where(alpha > 0, 2, 0), atol=1e-14)
    np.testing.assert_allclose(maps.median_depth, np.where(alpha > 0, 2, 0), atol=1e-14)
    assert maps.distortion.abs().max() < 1e-28


def test_a_tiny_disc_is_the_low_pass():
    camera = camera_of(9, 9)
    alpha = rasterize_reference(surfels_of([[0, 0, 2]], [0.8], scale=1e-5), camera).alpha
    np.testing.assert_allclose(alpha[4, 3:6], 0.8 * np.exp([-1, 0, -1]), rtol=1e-12)
    np.testing.assert_allclose(alpha[3, 3], 0.8 * np.exp(-2), rtol=1e-12)


def test_layers_add_up_as_they_should():
    surfels = surfels_of([[0, 0, 4], [0, 0, 2]], [0.7, 0.4], scale=100)
    maps = rasterize_reference(surfels, camera_of(1, 1))
    near, far = 0.4, 0.6 * 0.7
    m = splat.ndc_depth(torch.tensor([2.0, 4.0], dtype=torch.float64))
    assert maps.alpha.item() == pytest.approx(near + far, rel=1e-12)
    np.testing.assert_allclose(maps.features[0, 0], [3 * near + 1 * far, 4 * near + 2 * far], rtol=1e-12)
    assert maps.depth.item() == pytest.approx((2 * near + 4 * far) / (near + far), rel=1e-12)
    assert maps.median_depth.item() == pytest.approx(4)
    assert maps.distortion.item() == pytest.approx(near * far * float(m[1] - m[0]) ** 2, rel=1e-10)
    nearer = replace(surfels, opacities=torch.tensor([0.7, 0.6], dtype=torch.float64))
    assert rasterize_reference(nearer, camera_of(1, 1)).median_depth.item() == pytest.approx(2)


def test_ndc_depth_spans_its_planes():
    np.testing.assert_allclose(splat.ndc_depth(torch.tensor([0.2, 100.0])), [0, 1], atol=1e-6)


def test_alpha_is_clamped_and_cut():
    at = {o: rasterize_reference(surfels_of([[0, 0, 2]], [o], 100), camera_of(1, 1)).alpha.item()
          for o in (1.0, 0.995, 1.001 / 255, 0.999 / 255)}  # fmt: skip
    assert at[1.0] == at[0.995] == 0.99
    assert at[1.001 / 255] == pytest.approx(1.001 / 255, rel=1e-6)
    assert at[0.999 / 255] == 0


def test_nothing_is_drawn_behind_what_is_as_good_as_opaque():
    surfels = surfels_of([[0, 0, 2 + i] for i in range(5)], [0.99, 0.98, 0.6, 0.9, 0.9], scale=1000)
    one_hot = torch.eye(5, dtype=torch.float64)
    weights = rasterize_reference(surfels, camera_of(1, 1), one_hot).features[0, 0]
    np.testing.assert_allclose(weights, [0.99, 0.0098, 1.2e-4, 0, 0], rtol=1e-4)


@pytest.mark.parametrize("z", [-2.0, 0.0, 0.009])
def test_behind_the_camera_is_nothing(z: float):
    maps = rasterize_reference(surfels_of([[0, 0, z]], [0.9]), camera_of())
    assert all(getattr(maps, f.name).abs().max() == 0 for f in fields(maps))


@pytest.mark.parametrize("channels", [0, 1, 5])
def test_no_surfels_are_an_empty_picture(channels: int):
    maps = rasterize_reference(surfels_of([], []), camera_of(), torch.zeros(0, channels, dtype=torch.float64))
    assert maps.features.shape == (7, 9, channels)
    assert maps.normal.shape == (7, 9, 3)
    assert all(bool((getattr(maps, f.name) == 0).all()) for f in fields(maps))


def test_edge_on_is_a_speck_with_the_depth_of_its_centre():
    quarter = (np.sqrt(0.5), 0.0, np.sqrt(0.5), 0.0)
    surfels = surfels_of([[0, 0, 2]], [0.8], 0.3, quarter)
    surfels.rotations.requires_grad_()
    maps = rasterize_reference(surfels, camera_of(9, 9))
    np.testing.assert_allclose(maps.alpha[4, 4].item(), 0.8, rtol=1e-6)
    np.testing.assert_allclose(maps.depth[4, 4].item(), 2)
    (maps.alpha.sum() + maps.normal.sum() + maps.depth.sum()).backward()
    assert surfels.rotations.grad is not None
    assert bool(torch.isfinite(surfels.rotations.grad).all())


def paper_alpha(surfels: splat.Surfels, camera: Camera) -> np.ndarray:
    """Equations 8 to 10 of Huang et al. 2024, by homogeneous planes, for one surfel; no low-pass."""
    w, x, y, z = surfels.rotations[0].numpy()
    turn = Rotation.from_quat([x, y, z, w]).as_matrix()
    local = np.stack([*(turn[:, :2] * surfels.scales[0].numpy()).T, surfels.centres[0].numpy()], axis=1)
    pose = camera.world_to_camera
    local = pose[:3, :3] @ local + np.outer(pose[:3, 3], [0, 0, 1])
    m1, m2, m3 = camera.K @ local
    column, row = np.meshgrid(np.arange(camera.width) + 0.5, np.arange(camera.height) + 0.5)
    zeta = np.cross(column[..., None] * m3 - m1, row[..., None] * m3 - m2)
    return surfels.opacities[0].item() * np.exp(-0.5 * ((zeta[..., :2] / zeta[..., 2:]) ** 2).sum(-1))


@pytest.mark.parametrize("seed", range(5))
def test_the_papers_equations_say_the_same(seed: int):
    pose = look_at(np.array([0.3, -3.0, 1.0]), np.array([0.0, 0, 2]))
    camera = camera_of(24, 18, 30.0, pose)
    surfels = replace(random_surfels(1, seed, scale=0.5), centres=torch.tensor([[0.1, 0.2, 1.9]]).double())
    ours, paper = rasterize_reference(surfels, camera).alpha.numpy(), paper_alpha(surfels, camera)
    larger = ours > paper * (1 + 1e-9)  # where the low-pass is
    assert larger.mean() < 0.15
    np.testing.assert_allclose(ours[~larger], np.where(paper < 1 / 255, 0, paper)[~larger], atol=1e-12)


def test_the_low_pass_sits_in_the_middle_of_the_projected_disc():
    surfels, camera = random_surfels(6, 4, scale=0.4), camera_of(40, 30, 30.0)
    seen = see(surfels, camera)
    angle = torch.linspace(0, 2 * torch.pi, 20_001, dtype=torch.float64)
    circle = torch.stack([angle.cos(), angle.sin()], dim=1)
    rim = torch.einsum("pa,na,nak->npk", circle, seen.scales, seen.axes) + seen.centres[:, None]
    projected, _ = camera.project(rim.numpy())
    middle = (projected.min(axis=1) + projected.max(axis=1)) / 2
    np.testing.assert_allclose(box_centres(seen, camera), middle, atol=1e-6)
    centre, _ = camera.project(seen.centres.numpy())
    assert np.abs(middle - centre).max() > 0.05


def test_a_disc_through_the_cameras_plane_stays_finite():
    surfels = surfels_of([[0, 0, 0.5]], [0.9], 3.0, (np.cos(0.6), np.sin(0.6), 0.0, 0.0))
    maps = rasterize_reference(surfels, camera_of())
    assert all(bool(torch.isfinite(getattr(maps, f.name)).all()) for f in fields(maps))
    assert maps.alpha.max() > 0.1
    assert maps.depth[maps.alpha > 0].min() >= 0.01


def test_turning_the_world_turns_only_the_normals():
    surfels, pose = random_surfels(12, 1), look_at(np.array([1.0, -2, 3]), np.array([0.0, 0, 0]))
    turn = torch.from_numpy(pose[:3, :3].copy())
    turned = Rotation.from_matrix(turn.numpy()) * Rotation.from_quat(surfels.rotations, scalar_first=True)
    moved = replace(
        surfels,
        centres=surfels.centres @ turn.T + torch.from_numpy(pose[:3, 3].copy()),
        rotations=torch.from_numpy(turned.as_quat(scalar_first=True)),
    )
    here = rasterize_reference(surfels, camera_of())
    there = rasterize_reference(moved, camera_of(pose=pose))
    for name in ("features", "alpha", "depth", "median_depth", "distortion"):
        np.testing.assert_allclose(getattr(there, name), getattr(here, name), atol=1e-10, err_msg=name)
    np.testing.assert_allclose(there.normal, here.normal @ turn.T, atol=1e-10)


def test_features_are_linear_and_can_be_replaced():
    surfels, camera = random_surfels(10, 2), camera_of()
    one = rasterize_reference(surfels, camera, torch.ones(10, 1, dtype=torch.float64))
    np.testing.assert_allclose(one.features[..., 0], one.alpha, atol=1e-14)
    both = torch.cat([surfels.features, 2 * surfels.features], dim=1)
    maps = rasterize_reference(surfels, camera, both)
    np.testing.assert_allclose(maps.features[..., 3:], 2 * maps.features[..., :3], atol=1e-13)


def test_offsets_move_the_picture_as_another_principal_point_does():
    surfels, camera, by = random_surfels(12, 3, scale=0.3), camera_of(20, 15, 15.0), np.array([1.7, -2.3])
    K = camera.K.copy()
    K[:2, 2] += by
    offsets = torch.from_numpy(by).expand(12, 2)
    ours = rasterize_reference(surfels, camera, offsets=offsets)
    truth = rasterize_reference(surfels, replace(camera, K=K))
    for field in fields(truth):
        np.testing.assert_allclose(getattr(ours, field.name), getattr(truth, field.name), atol=1e-11)


def test_features_alone_are_those_of_all_maps():
    surfels, offsets = random_surfels(10, 2), torch.linspace(-1, 1, 20, dtype=torch.float64).reshape(10, 2)
    few = splat.rasterize_features(surfels, camera_of(), backend="reference", offsets=offsets)
    maps = splat.rasterize(surfels, camera_of(), backend="reference", offsets=offsets)
    assert [f.name for f in fields(few)] == ["features", "alpha"]
    assert torch.equal(few.features, maps.features)
    assert torch.equal(few.alpha, maps.alpha)


@pytest.mark.parametrize("bad", [torch.zeros(9, 2).double(), torch.zeros(10).double(), torch.zeros(10, 2)])
@pytest.mark.parametrize("backend", ["reference", "cpu"])
def test_offsets_that_do_not_fit_are_refused(bad: torch.Tensor, backend: splat.Backend):
    for draw in (splat.rasterize, splat.rasterize_features):
        with pytest.raises(ValueError, match=r"offsets of shape \(10, 2\) in torch.float64, got"):
            draw(random_surfels(10, 0), camera_of(), offsets=bad, backend=backend)


@pytest.mark.parametrize("bad", [torch.zeros(9, 2).double(), torch.zeros(10).double(), torch.zeros(10, 2)])
def test_features_that_do_not_fit_are_refused(bad: torch.Tensor):
    with pytest.raises(ValueError, match=r"features of shape \(10, C\) in torch.float64, got"):
        rasterize_reference(random_surfels(10, 0), camera_of(), bad)


@pytest.mark.parametrize("seed", [0, 1])
def test_finite_differences_confirm_every_gradient(seed: int):
    """Away from thresholds, which seeds 0 and 1 are: each output against each input."""
    surfels = random_surfels(3, seed, channels=2, scale=0.4)
    leaves = [*(getattr(surfels, f.name) for f in fields(surfels)), torch.zeros(3, 2, dtype=torch.float64)]
    inputs = tuple(leaf.requires_grad_() for leaf in leaves)

    def draw(*values: torch.Tensor) -> tuple[torch.Tensor, ...]:
        maps = rasterize_reference(splat.Surfels(*values[:-1]), camera_of(4, 3, 4.0), offsets=values[-1])
        return tuple(getattr(maps, f.name) for f in fields(maps))

    assert torch.autograd.gradcheck(draw, inputs, eps=1e-7, atol=1e-5, rtol=1e-4)
