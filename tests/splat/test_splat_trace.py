# SPDX-License-Identifier: Apache-2.0
"""The tracer: the engine and its specification against a third opinion, and both against each other."""

from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from types import SimpleNamespace
from typing import Any

import numba
import numpy as np
import psutil
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

import graycard as gc
from graycard.methods import splat
from graycard.methods.splat import _bvh_kernels, _trace_cpu
from graycard.methods.splat import _simd as simd
from graycard.methods.splat import _trace_masks as masks
from random_surfels import random_surfels

BACKENDS: tuple[splat.Backend, ...] = ("cpu", "reference")
PARTS = ("centres", "scales", "opacities", "features", "rotations")
FLIP = 4e-3
"""What a surfel whose alpha is 1/255 but for rounding may change in one ray."""


def facing(depths: list[float], opacity: float = 0.5, scale: float = 0.5) -> splat.Surfels:
    """Discs across the z axis at these z, whose features are their place in the list."""
    count = len(depths)
    centres = torch.zeros(count, 3, dtype=torch.float64)
    centres[:, 2] = torch.tensor(depths)
    turns = torch.zeros(count, 4, dtype=torch.float64)
    turns[:, 0] = 1
    full = torch.ones(count, 2, dtype=torch.float64)
    places = torch.arange(count, dtype=torch.float64)[:, None]
    return splat.Surfels(centres, turns, full * scale, full[:, 0] * opacity, places)


def in_a_row(count: int) -> splat.Surfels:
    """Faint discs one behind the other along z, in no order."""
    order = np.random.default_rng(3).permutation(count)
    surfels = facing([1 + 0.003 * int(place) for place in order], 0.008, 3.0)
    return replace(surfels, features=torch.rand(count, 3, generator=generator(4), dtype=torch.float64))


def doubled(surfels: splat.Surfels) -> splat.Surfels:
    """Every disc twice in the same place: all distances are ties."""
    twice = splat.Surfels(*(torch.cat([getattr(surfels, f.name)] * 2) for f in fields(surfels)))
    return replace(twice, features=random_surfels(len(twice), 5).features)


def along_axes(count: int) -> splat.Surfels:
    """Discs whose normals are the axes of the world: boxes without volume, rays parallel to planes."""
    surfels = random_surfels(count, 6)
    half = 0.5**0.5
    turns = torch.tensor([[1, 0, 0, 0], [half, half, 0, 0], [half, 0, half, 0]], dtype=torch.float64)
    return replace(surfels, rotations=turns[torch.arange(count) % 3])


SURFELS: dict[str, Callable[[], splat.Surfels]] = {
    "one": lambda: random_surfels(1, 1, scale=0.8),
    "sparse": lambda: random_surfels(7, 1, scale=0.5),
    "dense": lambda: random_surfels(300, 2),
    "small": lambda: random_surfels(700, 3, scale=0.05),
    "large": lambda: random_surfels(40, 5, scale=1.0),
    "doubled": lambda: doubled(random_surfels(60, 4)),
    "axes": lambda: along_axes(90),
    "none": lambda: random_surfels(0),
    "opaque": lambda: replace(random_surfels(200, 8, scale=0.4), opacities=torch.ones(200).double()),
    "faint": lambda: replace(
        random_surfels(80, 11, scale=0.5), opacities=torch.linspace(0.9, 1.2, 80).double() / 255
    ),
}


def rays_of(origins: np.ndarray, directions: np.ndarray, width: int | None = None) -> splat.Rays:
    unit = directions / np.linalg.norm(directions, axis=1, keepdims=True)
    return splat.Rays(torch.from_numpy(origins + 0.0), torch.from_numpy(unit), width)


def all_ways(count: int, seed: int = 20) -> splat.Rays:
    """Rays from everywhere to everywhere."""
    r = np.random.default_rng(seed)
    return rays_of(r.uniform(-1.3, 1.3, (count, 3)), r.normal(size=(count, 3)))


def side_by_side(count: int, towards: tuple[float, float, float] = (0.2, 1, -0.3)) -> splat.Rays:
    """Rays that stay close to one another."""
    r = np.random.default_rng(21)
    way = np.array(towards)
    origins = -2 * way + r.uniform(-0.03, 0.03, (count, 3))
    return rays_of(origins, way + r.normal(0, 0.01, (count, 3)))


def grid(width: int, height: int) -> splat.Rays:
    """Parallel rays along z through the centres of a grid."""
    x, y = np.meshgrid(np.linspace(-0.7, 0.7, width), np.linspace(-0.7, 0.7, height))
    origins = np.stack([x.ravel(), y.ravel(), np.full(x.size, -2.0)], axis=1)
    return rays_of(origins, np.tile([0.0, 0, 1], (x.size, 1)), width)


def mixed() -> splat.Rays:
    """Packets of both kinds, and one that is not full."""
    return splat.Rays(*joined([side_by_side(32), all_ways(23), side_by_side(16, (-1, 0.1, 0.1))]))


def joined(parts: list[splat.Rays]) -> tuple[torch.Tensor, torch.Tensor]:
    """Origins and directions."""
    return torch.cat([part.origins for part in parts]), torch.cat([part.directions for part in parts])


RAYS: dict[str, Callable[[], splat.Rays]] = {
    "all ways": lambda: all_ways(150),
    "side by side": lambda: side_by_side(100),
    "image": lambda: grid(13, 9),
    "mixed": mixed,
    "none": lambda: all_ways(0),
}

CASES = [(surfels, "mixed") for surfels in SURFELS] + [("dense", rays) for rays in RAYS if rays != "mixed"]


def generator(seed: int) -> torch.Generator:
    return torch.Generator().manual_seed(seed)


@dataclass(frozen=True)
class Answer:
    features: np.ndarray
    transmittance: np.ndarray
    depth: np.ndarray


def by_hand(surfels: splat.Surfels, rays: splat.Rays, near: float = 1e-4) -> Answer:
    """Ray by ray in float64: c + u s_u a_u + v s_v a_v = o + t d is solved for u, v and t."""
    c, s, opacity, f, q = (getattr(surfels, name).numpy() for name in PARTS)
    o, d = rays.origins.numpy(), rays.directions.numpy()
    axes = Rotation.from_quat(q, scalar_first=True).as_matrix() if len(q) else np.zeros((0, 3, 3))
    answer = Answer(np.zeros((len(o), f.shape[1])), np.ones(len(o)), np.zeros(len(o)))
    for i in range(len(o)):
        back = np.broadcast_to(-d[i], (len(c), 3))[:, :, None]
        systems = np.concatenate([axes[:, :, :2] * s[:, None], back], axis=2)
        meets = np.abs(np.linalg.det(systems)) > 1e-14 * s.prod(axis=1)
        systems[~meets] = np.eye(3)
        u, v, t = np.linalg.solve(systems, (o[i] - c)[:, :, None])[:, :, 0].T
        alpha = opacity * np.exp(-(u * u + v * v) / 2)
        counts = meets & (t > near) & (alpha >= 1 / 255)
        met = [(t[n], n, min(alpha[n], 0.99)) for n in np.flatnonzero(counts)]
        _along(sorted(met), f, answer, i)
    return answer


def _along(met: list[tuple[Any, Any, Any]], f: np.ndarray, answer: Answer, i: int) -> None:
    """Add what one ray meets, in order."""
    total = 0.0
    for t, n, alpha in met:
        weight = answer.transmittance[i] * alpha
        answer.features[i] += weight * f[n]
        answer.depth[i] += weight * t
        total += weight
        answer.transmittance[i] -= weight
        if answer.transmittance[i] <= 1e-4:
            break
    answer.depth[i] /= total or 1.0


def gradients(surfels: splat.Surfels, rays: splat.Rays, backend: splat.Backend) -> dict[str, torch.Tensor]:
    """Of a random weighting of all that is traced, by all that is given."""
    given = {f.name: getattr(surfels, f.name) for f in fields(surfels)}
    given |= {"origins": rays.origins, "directions": rays.directions}
    leaves = {name: value.detach().clone().requires_grad_() for name, value in given.items()}
    rays = splat.Rays(leaves.pop("origins"), leaves.pop("directions"), rays.width)
    found = splat.trace(splat.Surfels(**leaves), rays, backend=backend)
    random, loss = generator(1), torch.zeros(())
    for field in fields(found):
        values = getattr(found, field.name)
        weights = torch.rand(values.shape, generator=random, dtype=torch.float64) - 0.5
        loss = loss + (weights.to(values.dtype) * values).sum()
    loss.backward()
    leaves |= {"origins": rays.origins, "directions": rays.directions}
    return {name: torch.zeros_like(v) if v.grad is None else v.grad for name, v in leaves.items()}


def given_by(backend: splat.Backend, surfels: splat.Surfels, rays: splat.Rays, **more: Any) -> Answer:
    found = splat.trace(surfels, rays, backend=backend, **more)
    return Answer(*(getattr(found, field.name).numpy() for field in fields(found)))


def assert_same(ours: Answer, truth: Answer, tolerance: float) -> None:
    """Within the tolerance but for flips at the threshold of alpha, in at most one ray or 1 % of them."""
    wrong = np.zeros(truth.depth.shape, bool)
    for field in fields(truth):
        got, expected = getattr(ours, field.name), getattr(truth, field.name)
        assert got.shape == expected.shape, field.name
        off = np.abs(got - expected) > tolerance * np.maximum(np.abs(expected), 1)
        wrong |= off if off.ndim == 1 else off.any(axis=1)
    assert wrong.sum() <= max(1, 0.01 * wrong.size)
    assert (np.abs(ours.transmittance - truth.transmittance) < FLIP).all()
    assert (np.abs(ours.features - truth.features) < FLIP).all()


@pytest.mark.parametrize(("surfels", "rays"), CASES)
def test_values_are_those_found_by_hand(surfels: str, rays: str):
    scene, lines = SURFELS[surfels](), RAYS[rays]()
    truth = by_hand(scene, lines)
    assert_same(given_by("reference", scene, lines), truth, 1e-9)
    assert_same(given_by("cpu", scene, lines), truth, 1e-5)


@pytest.mark.parametrize("rays", ["all ways", "side by side", "image", "mixed"])
def test_scenes_are_not_empty(rays: str):
    """Else the comparisons would compare nothing with nothing."""
    assert (by_hand(SURFELS["dense"](), RAYS[rays]()).transmittance < 0.5).mean() > 0.3


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("channels", [0, 1, 2, 4, 19, 20, 40])
def test_any_number_of_channels(channels: int, backend: splat.Backend):
    surfels, rays = random_surfels(150, 1, channels), mixed()
    assert_same(given_by(backend, surfels, rays), by_hand(surfels, rays), 1e-5)


@pytest.mark.parametrize("backend", BACKENDS)
def test_one_disc(backend: splat.Backend):
    """Met one standard deviation aside, at an angle: opacity times exp(-1/2), at the plane's distance."""
    surfels, way = facing([2.0], 0.8, 0.5), np.array([[0.6, 0, 0.8]])
    rays = rays_of(np.array([[0.5, 0, 2]]) - 3 * way, way)
    found = given_by(backend, surfels, rays)
    assert found.transmittance[0] == pytest.approx(1 - 0.8 * np.exp(-0.5), abs=1e-6)
    assert found.depth[0] == pytest.approx(3, abs=1e-6)


@pytest.mark.parametrize("backend", BACKENDS)
def test_alpha_is_clamped_and_cut(backend: splat.Backend):
    lines = rays_of(np.zeros((1, 3)), np.array([[0.0, 0, 1]]))
    opaque, just, faint = (facing([1.0], value) for value in (1.0, 1.001 / 255, 0.999 / 255))
    assert given_by(backend, opaque, lines).transmittance[0] == pytest.approx(0.01, abs=1e-7)
    assert given_by(backend, just, lines).transmittance[0] == pytest.approx(1 - 1.001 / 255, abs=1e-6)
    assert given_by(backend, faint, lines).transmittance[0] == 1


@pytest.mark.parametrize("backend", BACKENDS)
def test_a_ray_ends_behind_the_disc_that_blocks_it(backend: splat.Backend):
    """Of 0.98 each, after two 4e-4 is left, after three 8e-6: the fourth is not looked at, nor any behind."""
    surfels = facing([5.0, 4, 3, 2, 1], 0.98)
    one_hot = replace(surfels, features=torch.eye(5, dtype=torch.float64))
    rays = rays_of(np.zeros((16, 3)), np.tile([0.0, 0, 1], (16, 1)))
    found = given_by(backend, one_hot, rays)
    np.testing.assert_allclose(found.features, [[0, 0, 0.98 * 4e-4, 0.98 * 0.02, 0.98]] * 16, rtol=1e-3)
    np.testing.assert_allclose(found.transmittance, 8e-6, rtol=1e-3)


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("near", [0.0, 1e-4, 0.5, 1.5])
def test_what_is_too_near_is_not_met(near: float, backend: splat.Backend):
    """The first of three discs holds the origins."""
    surfels = facing([0.0, 1.0, 2.0])
    rays = rays_of(np.array([[0.1, 0.2, 0], [0, 0, 0]]), np.array([[0.1, 0, 1], [0, 0, 1]]))
    found = given_by(backend, surfels, rays, near=near)
    np.testing.assert_array_equal(found.transmittance > 0.4, near > 1)  # one disc left, not two
    assert_same(found, by_hand(surfels, rays, near), 1e-6)
    assert_same(given_by(backend, facing([0.0]), rays), Answer(np.zeros((2, 1)), np.ones(2), np.zeros(2)), 0)


@pytest.mark.parametrize("backend", BACKENDS)
def test_equal_distances_are_taken_by_index(backend: splat.Backend):
    one_hot = replace(facing([1.0] * 4), features=torch.eye(4, dtype=torch.float64))
    rays = rays_of(np.zeros((3, 3)), np.array([[0.0, 0, 1], [0, 0, 1], [0, 0, -1]]))
    expected = [[0.5, 0.25, 0.125, 0.0625]] * 2 + [[0.0] * 4]
    np.testing.assert_allclose(given_by(backend, one_hot, rays).features, expected, atol=1e-6)


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("spread", [0.01, 0.3])
def test_equal_distances_are_taken_by_index_wherever_they_lie(spread: float, backend: splat.Backend):
    """Discs all over one plane, which the tree has in another order; rays across it, side by side or not."""
    count, r = 60, np.random.default_rng(30)
    places = np.concatenate([r.uniform(-0.4, 0.4, (count, 2)), np.ones((count, 1))], axis=1)
    plane = facing([1.0] * count, 0.1, 0.5)
    plane = replace(plane, centres=torch.from_numpy(places), features=torch.eye(count, dtype=torch.float64))
    origins = np.concatenate([r.uniform(-spread, spread, (16, 2)), np.zeros((16, 1))], axis=1)
    found = given_by(backend, plane, rays_of(origins, np.tile([0.0, 0, 1], (16, 1))))
    square = ((origins[:, None, :2] - places[:, :2]) ** 2).sum(axis=2) / 0.5**2
    alpha = 0.1 * np.exp(-square / 2)
    before = np.cumprod(np.concatenate([np.ones((16, 1)), 1 - alpha], axis=1), axis=1)
    np.testing.assert_allclose(found.features, alpha * before[:, :-1], atol=1e-5)
    assert alpha.min() > 1.1 / 255


@pytest.mark.parametrize("rays", ["beam", "single"])
def test_more_hits_than_there_is_room_for_at_first(rays: str):
    """All of 900 discs count: the rows outgrow their memory, several times."""
    surfels, r = in_a_row(900), np.random.default_rng(0)
    ways = r.normal([0, 0, 1], 0.002 if rays == "beam" else 0.3, (16, 3))
    lines = rays_of(np.zeros((16, 3)), ways)
    truth = by_hand(surfels, lines)
    assert_same(given_by("cpu", surfels, lines), truth, 1e-5)
    assert truth.transmittance.max() < 0.05


@pytest.mark.parametrize("backend", BACKENDS)
def test_rays_along_a_disc_do_not_meet_it(backend: splat.Backend):
    surfels = facing([0.0, 0.0, 1.0])
    ways = np.array([[1.0, 0, 0], [0, -1, 0], [0.6, 0.8, 0]])
    rays = rays_of(-0.2 * ways, ways)
    found = given_by(backend, surfels, rays)
    assert (found.transmittance == 1).all()
    assert all(g.isfinite().all() for g in gradients(surfels, rays, backend).values())


@pytest.mark.parametrize(("surfels", "rays"), CASES)
def test_gradients_are_those_of_the_specification(surfels: str, rays: str):
    """Within 1e-3 of the length of the gradient as a whole (1e-5 is usual)."""
    scene, lines = SURFELS[surfels](), RAYS[rays]()
    truth = gradients(scene, lines, "reference")
    for name, got in gradients(scene, lines, "cpu").items():
        assert (got - truth[name]).norm() <= 1e-3 * truth[name].norm() + 1e-9, name


@pytest.mark.parametrize("channels", [0, 1, 4, 19, 20, 40])
@pytest.mark.parametrize("rays", ["all ways", "side by side"])
def test_gradients_of_any_number_of_channels(channels: int, rays: str):
    surfels, lines = random_surfels(60, 9, channels, 0.3), RAYS[rays]()
    truth = gradients(surfels, lines, "reference")
    for name, got in gradients(surfels, lines, "cpu").items():
        assert (got - truth[name]).norm() <= 1e-4 * truth[name].norm(), name


def test_gradients_of_the_specification_are_differences_of_its_values():
    """Between thresholds: the discs are wide enough for the lists of hits to stay as they are."""
    surfels = replace(
        facing([1.0, 1.5, 2.2], 0.7, 0.6), features=torch.rand(3, 2, generator=generator(0)).double()
    )
    turns = torch.nn.functional.normalize(surfels.rotations + 0.2 * random_surfels(3, 2).rotations, dim=1)
    surfels = replace(surfels, rotations=turns)
    rays = rays_of(np.array([[0.1, 0, 0], [-0.1, 0.2, 0.1]]), np.array([[0.1, 0.1, 1], [0, -0.2, 1]]))

    def traced(*leaves: torch.Tensor) -> tuple[torch.Tensor, ...]:
        found = splat.trace(splat.Surfels(*leaves[:5]), splat.Rays(leaves[5], leaves[6]), backend="reference")
        return found.features, found.transmittance, found.depth

    leaves = [getattr(surfels, field.name) for field in fields(surfels)] + [rays.origins, rays.directions]
    assert torch.autograd.gradcheck(traced, [leaf.clone().requires_grad_() for leaf in leaves], eps=1e-6)


def test_what_was_not_kept_is_found_again(monkeypatch: pytest.MonkeyPatch):
    """To the same bits: packets of which all is kept, some that met more, and nothing."""
    surfels, rays, found = random_surfels(300, 2), mixed(), []
    for kept in (_trace_cpu.KEPT, 60, 0):
        monkeypatch.setattr(_trace_cpu, "KEPT", kept)
        found.append(gradients(surfels, rays, "cpu"))
    for name, first in found[0].items():
        assert all(torch.equal(first, other[name]) for other in found[1:]), name


def test_sums_in_one_part_are_the_same(monkeypatch: pytest.MonkeyPatch):
    """As with more surfels than the memory allows for several."""
    surfels, rays = random_surfels(300, 2), all_ways(900)
    several = gradients(surfels, rays, "cpu")
    monkeypatch.setattr(_trace_cpu, "SUMS_BYTES", 1)
    for name, got in gradients(surfels, rays, "cpu").items():
        assert (got - several[name]).norm() <= 1e-5 * several[name].norm(), name


def test_one_thread_and_two_give_the_same_bits():
    surfels, rays = random_surfels(500, 12, 5), splat.Rays(*joined([all_ways(999), side_by_side(999)]))
    before, found = numba.get_num_threads(), []
    try:
        for threads in (1, min(2, before), min(2, before)):
            numba.set_num_threads(threads)
            traced = splat.trace(surfels, rays)
            found.append(
                {**vars(traced), **{f"to {k}": v for k, v in gradients(surfels, rays, "cpu").items()}}
            )
    finally:
        numba.set_num_threads(before)
    for name, first in found[0].items():
        assert all(torch.equal(first, other[name]) for other in found[1:]), name


def test_the_order_of_the_surfels_does_not_matter():
    surfels, rays = random_surfels(400, 13), mixed()
    order = torch.randperm(400, generator=generator(0))
    shuffled = splat.Surfels(*(getattr(surfels, field.name)[order] for field in fields(surfels)))
    assert_same(given_by("cpu", shuffled, rays), given_by("cpu", surfels, rays), 1e-6)


def test_features_superpose():
    surfels, rays = random_surfels(200, 14), mixed()
    other = torch.rand(200, 3, generator=generator(2), dtype=torch.float64)
    parts = [splat.trace(surfels, rays, f).features for f in (surfels.features, other)]
    together = splat.trace(surfels, rays, 2 * surfels.features - 3 * other).features
    torch.testing.assert_close(together, 2 * parts[0] - 3 * parts[1], atol=1e-5, rtol=0)


def test_an_opaque_wall_hides_what_is_behind():
    """Visibility of points on both sides of it, from a lamp: none or all, but for what the clamp lets by."""
    y, x = np.mgrid[-2:2:21j, -2:2:21j]
    wall = facing([0.0] * x.size, 1.0, 0.2)
    places = np.stack([x.ravel(), y.ravel(), np.zeros(x.size)], axis=1)
    wall = replace(wall, centres=torch.from_numpy(places))
    r = np.random.default_rng(0)
    points = r.uniform([-1, -1, 0.1], [1, 1, 1.9], (300, 3)) * [1, 1, -1] ** r.integers(0, 2, (300, 1))
    lamp = np.array([0.1, 0.2, 2.0])
    seen = given_by("cpu", wall, rays_of(points, lamp - points)).transmittance
    behind = points[:, 2] < 0
    assert seen[behind].max() < 0.01
    assert behind.sum() > 100
    assert (seen[~behind] == 1).all()


def test_a_mirror_shows_what_the_mirrored_camera_sees():
    """Rays reflected at a plane meet what the camera behind the plane draws, to 40 dB or better.

    The discs lie across the view and apart, so that their centres' order is that of every ray.
    """
    count, r = 60, np.random.default_rng(15)
    surfels, turns = random_surfels(count, 15), np.array([1.0, 1, 0, 0]) + r.normal(0, 0.005, (count, 4))
    centres = np.stack([r.uniform(-1, 1, count), r.permutation(count) / 30 - 1, r.uniform(-1, 1, count)], 1)
    turns /= np.linalg.norm(turns, axis=1, keepdims=True)
    wide = torch.from_numpy(r.uniform(0.15, 0.3, (count, 2)))
    surfels = replace(
        surfels, centres=torch.from_numpy(centres), rotations=torch.from_numpy(turns), scales=wide
    )
    K, eye = np.array([[60.0, 0, 30], [0, 60, 25], [0, 0, 1]]), np.array([0.3, -1.8, 0.2])
    camera = gc.Camera(64, 48, K, gc.look_at(eye, eye - [0, 1, 0]))
    rays = splat.camera_rays(camera, torch.float64)
    way = (-3 - rays.origins[:, 1:2]) / rays.directions[:, 1:2]  # to the mirror at y = -3
    flip = torch.tensor([1.0, -1, 1], dtype=torch.float64)
    reflected = splat.Rays(rays.origins + way * rays.directions, rays.directions * flip, rays.width)
    found = splat.trace(surfels, reflected).features.reshape(48, 64, 3)
    K_flipped, pose = K * 1, camera.camera_to_world * 1
    K_flipped[0, 2] = 64 - K[0, 2]
    pose[1] *= -1
    pose[1, 3] -= 6
    pose[:3, 0] *= -1  # the picture of a mirrored camera is right-handed only when turned over
    drawn = splat.rasterize(surfels, gc.Camera(64, 48, K_flipped, pose)).features.flip(1)
    assert 10 * torch.log10(1 / ((found - drawn) ** 2).mean()) > 40
    assert drawn.std() > 0.1


def test_an_image_is_its_rays_one_by_one():
    surfels, rays = random_surfels(300, 2), grid(21, 10)
    apart = splat.Rays(rays.origins, rays.directions)
    assert_same(given_by("cpu", surfels, rays), given_by("cpu", surfels, apart), 1e-6)


def test_rays_of_a_camera_go_through_its_pixels():
    K = np.array([[30.0, 0, 6.3], [0, 33, 4.8], [0, 0, 1]])
    camera = gc.Camera(12, 10, K, gc.look_at(np.array([0.2, -2.5, 0.3]), np.zeros(3)))
    rays = splat.camera_rays(camera, torch.float64)
    assert (rays.width, len(rays)) == (12, 120)
    points = camera.world_to_camera[:3, :3] @ rays.directions.numpy().T
    image = K @ (points / points[2])
    np.testing.assert_allclose(image[:2, 25], [1.5, 2.5])
    np.testing.assert_allclose(rays.origins.numpy(), np.tile(camera.position, (120, 1)))


def test_a_tree_serves_more_than_once():
    surfels, rays = random_surfels(200, 2), all_ways(60)
    tree = splat.build_bvh(surfels)
    for lines in (rays, side_by_side(30)):
        again, anew = splat.trace(surfels, lines, bvh=tree), splat.trace(surfels, lines)
        assert torch.equal(again.features, anew.features)
    moved = replace(surfels, centres=surfels.centres + 1e-3)
    with pytest.raises(ValueError, match="others .in their centres."):
        splat.trace(moved, rays, bvh=tree)
    with pytest.raises(ValueError, match="others .in their centres."):
        splat.trace(random_surfels(3), rays, bvh=tree)


def test_neighbours_on_the_curve_are_neighbours_in_space():
    """Over the 512 cubes of the coarsest three levels, each of which the curve fills before it leaves."""
    cubes = np.stack(np.meshgrid(*[np.arange(8)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    keys = [_bvh_kernels.curve_key.py_func(*(int(k) << 7 for k in cube)) >> 21 for cube in cubes]
    np.testing.assert_array_equal(np.sort(keys), np.arange(512))
    steps = np.abs(np.diff(cubes[np.argsort(keys)], axis=0)).sum(axis=1)
    np.testing.assert_array_equal(steps, 1)


@pytest.mark.parametrize("count", [0, 1, 16, 17, 256, 257, 5000])
def test_boxes_hold_what_is_below_them(count: int):
    surfels = random_surfels(count, 3, 1)
    tree = splat.build_bvh(surfels).tree
    np.testing.assert_array_equal(np.sort(tree.order[tree.order >= 0]), np.arange(count))
    groups = tree.boxes.reshape(-1, 6, 16)
    for level, first in enumerate(tree.levels[:-1]):
        children = groups[first : tree.levels[level + 1]]
        parents = groups[tree.levels[level + 1] :].transpose(0, 2, 1).reshape(-1, 6)[: len(children)]
        np.testing.assert_array_equal(parents[:, :3], children[:, :3].min(axis=2))
        np.testing.assert_array_equal(parents[:, 3:], children[:, 3:].max(axis=2))


@settings(max_examples=25, deadline=None)
@given(
    count=st.integers(0, 60),
    scale=st.floats(0.01, 3),
    seed=st.integers(1000, 9999),
    spread=st.sampled_from([0.0, 0.01, 0.3, 3]),
    rays=st.integers(1, 40),
)
def test_any_scene(count: int, scale: float, seed: int, spread: float, rays: int):
    """Rays about one direction, from a common origin, spread from not at all to all ways."""
    r = np.random.default_rng(seed)
    surfels = random_surfels(count, seed, 2, scale)
    origin, way = r.uniform(-2, 2, 3), r.normal(size=3)
    lines = rays_of(np.tile(origin, (rays, 1)), way + spread * r.normal(size=(rays, 3)))
    assert_same(given_by("cpu", surfels, lines), by_hand(surfels, lines), 3e-5)


def test_float32_comes_back_as_float32():
    surfels, rays = random_surfels(50), all_ways(40)
    single = splat.Surfels(*(getattr(surfels, f.name).float() for f in fields(surfels)))
    lines = splat.Rays(rays.origins.float(), rays.directions.float())
    found = splat.trace(single, lines)
    assert {values.dtype for values in vars(found).values()} == {torch.float32}
    np.testing.assert_allclose(found.features, by_hand(surfels, rays).features, atol=1e-5)


def test_bad_rays_are_named():
    good = all_ways(3)
    with pytest.raises(ValueError, match="directions to be of unit length, got .* at ray 0"):
        splat.Rays(good.origins, 2 * good.directions)
    broken = good.origins.clone()
    broken[1, 2] = torch.nan
    with pytest.raises(ValueError, match="origins to be finite, got .*nan.* at ray 1"):
        splat.Rays(broken, good.directions)
    with pytest.raises(ValueError, match=r"directions of shape \(3, 3\) .* got \(2, 3\)"):
        splat.Rays(good.origins, good.directions[:2])
    with pytest.raises(ValueError, match="one floating dtype, got .* in torch.int64"):
        splat.Rays(good.origins.long(), good.directions)
    with pytest.raises(ValueError, match="width that divides the 3 rays, got 2"):
        splat.Rays(good.origins, good.directions, 2)
    with pytest.raises(ValueError, match="origins to be a torch.Tensor, got list"):
        splat.Rays([[0.0, 0, 0]], good.directions)  # type: ignore[arg-type]  # on purpose


def test_what_does_not_fit_is_refused():
    surfels, rays = random_surfels(5), all_ways(3)
    with pytest.raises(
        ValueError, match="rays in torch.float64 on cpu, as the surfels are, got torch.float32"
    ):
        splat.trace(surfels, splat.Rays(rays.origins.float(), rays.directions.float()))
    with pytest.raises(ValueError, match=r"features of shape \(5, C\)"):
        splat.trace(surfels, rays, torch.zeros(4, 3).double())
    with pytest.raises(ValueError, match="near distance of zero metres or more, got -1"):
        splat.trace(surfels, rays, near=-1)
    with pytest.raises(gc.UnknownNameError, match="did you mean 'reference'"):
        splat.trace(surfels, rays, backend="referense")  # type: ignore[arg-type]  # on purpose


@pytest.mark.parametrize(("surfels", "rays"), [(3, 2_000_000), (1_000_000, 3)])
def test_too_little_memory_is_said_before_it_is_taken(
    surfels: int, rays: int, monkeypatch: pytest.MonkeyPatch
):
    """Whether it is surfels or rays that would take it."""
    few = SimpleNamespace(available=2_000_000)
    monkeypatch.setattr(psutil, "virtual_memory", lambda: few)
    same = torch.eye(3)[:1].expand(rays, 3)
    lines = splat.Rays(same, same)
    one = facing([1.0])
    many = splat.Surfels(
        *(getattr(one, f.name).float().expand(surfels, *getattr(one, f.name).shape[1:]) for f in fields(one))
    )
    with pytest.raises(gc.MethodError, match=rf"GiB of memory to draw {surfels} surfels along {rays} rays"):
        splat.trace(many, lines)


@pytest.mark.parametrize("bad", [float("nan"), float("inf")])
@pytest.mark.parametrize("name", ["origins", "directions"])
def test_rays_that_are_no_numbers_are_refused(name: str, bad: float):
    values = {"origins": torch.zeros(3, 3), "directions": torch.eye(3)}
    values[name][1, 2] = bad
    with pytest.raises(ValueError, match=rf"expected {name} to be finite, got .*(nan|inf).* at ray 1"):
        splat.Rays(values["origins"], values["directions"])


def test_surfels_elsewhere_are_refused():
    surfels = random_surfels(2)
    # A device without data stands for one that is not here; its values cannot be looked at.
    elsewhere = object.__new__(splat.Surfels)
    for field in fields(surfels):
        object.__setattr__(elsewhere, field.name, getattr(surfels, field.name).to("meta"))
    with pytest.raises(ValueError, match="surfels on the CPU, got them on meta"):
        splat.build_bvh(elsewhere)
    with pytest.raises(ValueError, match="rays in torch.float64 on meta"):
        splat.trace(elsewhere, all_ways(1))


@numba.njit
def bits(a: Any, b: Any) -> tuple[int, int]:
    mask = masks.mask_at_least(simd.load(a, 0), simd.load(b, 0))
    return mask, masks.lowest_bit(mask)


def test_masks_are_the_comparisons():
    a = np.array([0, 1, -np.inf, np.nan, 2, 2, np.inf, 0] * 2, np.float32)
    b = np.array([1, 1, np.inf, 0, np.nan, 1, np.inf, -0.0] * 2, np.float32)
    expected = int(sum(1 << lane for lane in range(16) if a[lane] >= b[lane]))
    assert bits(a, b) == (expected, 1)
    assert bits(b, b)[0] == 0xFFFF - (1 << 4) - (1 << 12)


def test_masks_of_other_types_are_refused():
    @numba.njit
    def wrong(x: float) -> int:
        return masks.mask_at_least(x, x)

    with pytest.raises(numba.TypingError, match="expected float32x16 in both places"):
        wrong(1.0)
