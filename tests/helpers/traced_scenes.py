# SPDX-License-Identifier: Apache-2.0
"""Scenes and rays for the tests of the tracer, and what it should give, found by hand."""

from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
import torch
from scipy.spatial.transform import Rotation

from graycard.methods import splat
from random_surfels import random_surfels

BACKENDS: tuple[splat.Backend, ...] = ("cpu", "reference")


PARTS = ("centres", "scales", "opacities", "features", "rotations")


FLIP = 4e-3
"""Largest change of one ray by a surfel whose alpha is 1/255 but for rounding."""


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


def cut_short(rays: splat.Rays) -> splat.Rays:
    """The same with ends, some of which are at once or never."""
    far = torch.rand(len(rays), generator=generator(3), dtype=torch.float64) * 4
    far[::7], far[1::7] = 0, torch.inf
    return replace(rays, far=far)


RAYS: dict[str, Callable[[], splat.Rays]] = {
    "all ways": lambda: all_ways(150),
    "side by side": lambda: side_by_side(100),
    "image": lambda: grid(13, 9),
    "mixed": mixed,
    "cut short": lambda: cut_short(all_ways(150)),
    "image, cut short": lambda: cut_short(grid(13, 9)),
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
        counts = (
            meets
            & (t > near)
            & (t <= (np.inf if rays.far is None else float(rays.far[i])))
            & (alpha >= 1 / 255)
        )
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
    """Return gradients of a random weighting of all that is traced, by all that is given."""
    given = {f.name: getattr(surfels, f.name) for f in fields(surfels)}
    given |= {"origins": rays.origins, "directions": rays.directions}
    leaves = {name: value.detach().clone().requires_grad_() for name, value in given.items()}
    rays = splat.Rays(leaves.pop("origins"), leaves.pop("directions"), rays.width, rays.far)
    found = splat.trace_rays(splat.Surfels(**leaves), rays, backend=backend)
    random, loss = generator(1), torch.zeros(())
    for field in fields(found):
        values = getattr(found, field.name)
        weights = torch.rand(values.shape, generator=random, dtype=torch.float64) - 0.5
        loss = loss + (weights.to(values.dtype) * values).sum()
    loss.backward()
    leaves |= {"origins": rays.origins, "directions": rays.directions}
    return {name: torch.zeros_like(v) if v.grad is None else v.grad for name, v in leaves.items()}


def given_by(backend: splat.Backend, surfels: splat.Surfels, rays: splat.Rays, **more: Any) -> Answer:
    found = splat.trace_rays(surfels, rays, backend=backend, **more)
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
