# SPDX-License-Identifier: Apache-2.0
"""Symmetries: changes of a scene that change its picture in a known way or not at all; both back ends.

And the specification's gradients against finite differences, away from what decides.
"""

from dataclasses import fields, replace

import numpy as np
import pytest
import torch
from scipy.spatial.transform import Rotation

from graycard import Camera, look_at
from graycard.methods import splat
from random_surfels import random_surfels as any_surfels

BACKENDS: list[splat.Backend] = ["cpu", "reference"]
PLAIN = ("features", "alpha", "depth", "median_depth", "distortion")
"""Maps in which the orientation of the world does not appear."""


def camera_of(width: int = 35, height: int = 26, pose: np.ndarray | None = None) -> Camera:
    K = np.array([[30, 0, width / 2 + 0.3], [0, 33, height / 2 - 0.2], [0, 0, 1]])
    return Camera(width, height, K, np.eye(4) if pose is None else pose)


IN_FRONT = ((-1.0, -1.0, 1.5), (1.0, 1.0, 3.5))
"""Box in front of a camera at the origin."""


def random_surfels(count: int = 40, seed: int = 1000, channels: int = 3) -> splat.Surfels:
    return any_surfels(count, seed, channels, box=IN_FRONT, opacities=(0.02, 0.97), features=(-1.0, 1.0))


def draw(surfels: splat.Surfels, camera: Camera, backend: splat.Backend) -> splat.Maps:
    return splat.rasterize(surfels, camera, backend=backend)


def assert_close(got: torch.Tensor, want: torch.Tensor, backend: splat.Backend, name: str = "") -> None:
    """To rounding; on the engine but for one pixel, where rounding may decide otherwise."""
    off = (got - want).abs() > (1e-10 if backend == "reference" else 1e-5) * want.abs().clamp(min=1)
    assert (off if off.ndim == 2 else off.any(dim=2)).sum() <= (backend == "cpu"), name
    assert want.abs().max() > 0.01 or name == "distortion", name


@pytest.mark.parametrize("backend", BACKENDS)
def test_moving_the_world_and_the_camera_together(backend: splat.Backend):
    surfels, pose = random_surfels(), look_at(np.array([3.0, -2, 7]), np.array([1.0, 4, 0]))
    turn, shift = torch.from_numpy(pose[:3, :3].copy()), torch.from_numpy(pose[:3, 3].copy())
    turned = Rotation.from_matrix(turn.numpy()) * Rotation.from_quat(surfels.rotations, scalar_first=True)
    moved = replace(
        surfels,
        centres=surfels.centres @ turn.T + shift,
        rotations=torch.from_numpy(turned.as_quat(scalar_first=True)),
    )
    here, there = draw(surfels, camera_of(), backend), draw(moved, camera_of(pose=pose), backend)
    for name in PLAIN:
        assert_close(getattr(there, name), getattr(here, name), backend, name)
    assert_close(there.normal, here.normal @ turn.T, backend)


@pytest.mark.parametrize("backend", BACKENDS)
def test_a_mirror_flips_the_image(backend: splat.Backend):
    surfels, camera = random_surfels(), camera_of()
    mirror = torch.tensor([-1.0, 1, 1], dtype=torch.float64)
    mirrored = replace(
        surfels,
        centres=surfels.centres * mirror,
        rotations=surfels.rotations * torch.tensor([1.0, 1, -1, -1], dtype=torch.float64),  # S R S
    )
    K = camera.K.copy()
    K[0, 2] = camera.width - K[0, 2]
    here, there = draw(surfels, camera, backend), draw(mirrored, replace(camera, K=K), backend)
    for name in PLAIN:
        assert_close(getattr(there, name).flip(1), getattr(here, name), backend, name)
    assert_close(there.normal.flip(1) * mirror, here.normal, backend)


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("factor", [0.25, 8.0])
def test_the_worlds_size_shows_in_depths_only(backend: splat.Backend, factor: float):
    """The constants in metres: NEAR, from which we stay away, and the planes of the distortion.

    Those map depth to a constant minus kappa / z: the distortion goes with the inverse square of the size.
    """
    surfels = random_surfels()
    larger = replace(surfels, centres=factor * surfels.centres, scales=factor * surfels.scales)
    here, there = draw(surfels, camera_of(), backend), draw(larger, camera_of(), backend)
    for name in ("features", "alpha", "normal"):
        assert_close(getattr(there, name), getattr(here, name), backend, name)
    for name in ("depth", "median_depth"):
        assert_close(getattr(there, name) / factor, getattr(here, name), backend, name)
    assert_close(there.distortion * factor**2, here.distortion, backend, "distortion")


@pytest.mark.parametrize("backend", BACKENDS)
def test_a_quaternion_and_its_negative_are_one_rotation(backend: splat.Backend):
    surfels, camera = random_surfels(), camera_of()
    signs = torch.from_numpy(np.random.default_rng(1000).choice([-1.0, 1.0], (40, 1)))
    here = draw(surfels, camera, backend)
    there = draw(replace(surfels, rotations=signs * surfels.rotations), camera, backend)
    assert all(torch.equal(getattr(here, f.name), getattr(there, f.name)) for f in fields(here))


def permuted(surfels: splat.Surfels, order: torch.Tensor) -> splat.Surfels:
    return splat.Surfels(*(getattr(surfels, f.name)[order] for f in fields(surfels)))


def test_surfels_at_unequal_depths_come_in_any_order():
    surfels, camera = random_surfels(300), camera_of()
    order = torch.from_numpy(np.random.default_rng(1000).permutation(300))
    here, there = draw(surfels, camera, "cpu"), draw(permuted(surfels, order), camera, "cpu")
    assert all(torch.equal(getattr(here, f.name), getattr(there, f.name)) for f in fields(here))


@pytest.mark.parametrize("backend", BACKENDS)
def test_equals_are_drawn_as_they_come(backend: splat.Backend):
    """In float32 too: depths that differ by less than it can hold."""
    one = random_surfels(1, 1001)
    facing = replace(
        one,
        centres=torch.tensor([[0.01, 0.02, 2.0]], dtype=torch.float64),
        rotations=torch.tensor([[1.0, 0, 0, 0]], dtype=torch.float64),
        opacities=torch.tensor([0.6], dtype=torch.float64),
    )
    twins, one_hot = permuted(facing, torch.zeros(5, dtype=torch.long)), torch.eye(5, dtype=torch.float64)
    weights = splat.rasterize(twins, camera_of(), one_hot, backend).features
    alpha = weights[:, :, 0]
    for k in range(1, 5):
        drawn = (1 - alpha) ** k > 1e-3
        np.testing.assert_allclose(weights[:, :, k][drawn], (alpha * (1 - alpha) ** k)[drawn], atol=1e-6)


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("only", [False, True])
def test_features_are_linear(backend: splat.Backend, only: bool):
    surfels, camera = random_surfels(channels=5), camera_of()
    r = torch.Generator().manual_seed(1000)
    a, b = (torch.rand(40, 5, dtype=torch.float64, generator=r) for _ in range(2))
    how = splat.rasterize_features if only else splat.rasterize
    both = how(surfels, camera, 2 * a - 3 * b, backend).features
    apart = 2 * how(surfels, camera, a, backend).features - 3 * how(surfels, camera, b, backend).features
    np.testing.assert_allclose(both, apart, atol=1e-12 if backend == "reference" else 3e-6)


@pytest.mark.parametrize("backend", BACKENDS)
def test_equal_offsets_move_the_camera(backend: splat.Backend):
    """A picture that is moved as a whole is that of another principal point."""
    surfels, camera = random_surfels(), camera_of()
    offsets = torch.tensor([[2.3, -1.7]] * 40, dtype=torch.float64)
    K = camera.K.copy()
    K[:2, 2] += [2.3, -1.7]
    moved = splat.rasterize(surfels, camera, backend=backend, offsets=offsets)
    other = draw(surfels, replace(camera, K=K), backend)
    for f in fields(moved):
        assert_close(getattr(moved, f.name), getattr(other, f.name), backend, f.name)


def turned_to(normal: list[float]) -> list[float]:
    return Rotation.align_vectors([normal], [[0, 0, 1]])[0].as_quat(scalar_first=True).tolist()


SMOOTH = {
    "grazing": ([0.05, 0.02, 2.0], turned_to([0.995, 0.03, -0.1]), [0.6, 0.9], 0.5),
    "crossing": ([0.1, 0.05, 0.6], turned_to([0.5, 0.6, -0.6]), [1.5, 1.1], 0.7),
    "needle": ([0.02, 0.03, 1.5], turned_to([0.1, 0.2, -1]), [2.0, 0.12], 0.6),
    "speck": ([0.06, 0.04, 3.0], turned_to([0.3, 0.1, -1]), [1e-4, 1e-4], 0.9),
}
"""Centre, rotation, scales and opacity."""


def smooth_scene(name: str) -> splat.Surfels:
    """Two or four surfels, nothing near a threshold at any of the 4 x 3 pixels."""
    if name == "plain":
        return random_surfels(4, 1003, channels=2)
    behind = ([-0.05, 0.1, 4.0], turned_to([0.2, 0.1, -1]), [2.0, 1.5], 0.4)
    columns = zip((*SMOOTH[name], [0.3, -0.7]), (*behind, [-0.2, 0.9]), strict=True)
    return splat.Surfels(*(torch.tensor(column, dtype=torch.float64) for column in columns))


@pytest.mark.parametrize("name", ["plain", *SMOOTH])
def test_finite_differences_confirm_the_specification(name: str):
    """Every map, by every tensor and by the offsets."""
    surfels = smooth_scene(name)
    K = np.array([[4, 0, 2.03], [0, 4.4, 1.46], [0, 0, 1]])
    camera = Camera(4, 3, K, np.eye(4))
    inputs = [getattr(surfels, f.name).requires_grad_() for f in fields(surfels)]
    offsets = torch.tensor([[0.11, -0.07]] * len(surfels), dtype=torch.float64, requires_grad=True)

    def all_maps(*values: torch.Tensor) -> tuple[torch.Tensor, ...]:
        maps = splat.rasterize(splat.Surfels(*values[:-1]), camera, backend="reference", offsets=values[-1])
        return tuple(getattr(maps, f.name) for f in fields(maps))

    def features_only(*values: torch.Tensor) -> tuple[torch.Tensor, ...]:
        maps = splat.rasterize_features(
            splat.Surfels(*values[:-1]), camera, backend="reference", offsets=values[-1]
        )
        return maps.features, maps.alpha

    assert all_maps(*inputs, offsets)[1].max() > 0.1, name
    for draw_some in (all_maps, features_only):
        assert torch.autograd.gradcheck(draw_some, (*inputs, offsets), eps=1e-7, atol=1e-5, rtol=1e-4)
