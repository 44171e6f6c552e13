# SPDX-License-Identifier: Apache-2.0
"""The CPU engine against the specification, on random and on nasty scenes."""

from collections.abc import Callable
from dataclasses import fields, replace
from types import SimpleNamespace
from typing import cast

import numba
import numpy as np
import pytest
import torch

from graycard import Camera, MethodError, UnknownNameError, look_at
from graycard.methods import splat
from graycard.methods.splat.raster import _stages
from random_surfels import random_surfels

FLIP = 4e-3
"""Largest change of one pixel by a surfel whose alpha is 1/255 but for rounding."""


def camera_of(width: int = 37, height: int = 29, focal: float = 30) -> Camera:
    K = np.array([[focal, 0, width / 2 + 0.3], [0, 1.1 * focal, height / 2 - 0.2], [0, 0, 1]])
    pose = look_at(np.array([0.2, -2.5, 0.3]), np.zeros(3))
    return Camera(width, height, K, pose)


def moved(surfels: splat.Surfels, direction: tuple[float, float, float]) -> splat.Surfels:
    return replace(surfels, centres=surfels.centres + torch.tensor(direction, dtype=torch.float64))


def with_opacity(surfels: splat.Surfels, low: float, high: float) -> splat.Surfels:
    return replace(surfels, opacities=torch.linspace(low, high, len(surfels), dtype=torch.float64))


def edge_on(count: int) -> splat.Surfels:
    """Discs whose plane all but holds the camera's centre."""
    surfels = random_surfels(count, 3)
    half = torch.linspace(-2e-3, 2e-3, count, dtype=torch.float64) + torch.pi / 4
    turns = torch.stack([half.cos(), 0 * half, half.sin(), 0 * half], dim=1)
    line = torch.stack([torch.full_like(half, 0.2), surfels.centres[:, 1], surfels.centres[:, 2]], dim=1)
    return replace(surfels, rotations=turns, centres=line)


def in_one_pixel(count: int) -> splat.Surfels:
    surfels = random_surfels(count, 4, scale=1e-3)
    return with_opacity(replace(surfels, centres=surfels.centres * 0.01), 0.005, 0.05)


SCENES: dict[str, Callable[[], splat.Surfels]] = {
    "sparse": lambda: random_surfels(5, 1),
    "dense": lambda: random_surfels(400, 2),
    "large": lambda: random_surfels(40, 5, scale=1.0),
    "none": lambda: random_surfels(0),
    "edge-on": lambda: edge_on(40),
    "behind": lambda: moved(random_surfels(40, 6), (0, -4, 0)),
    "around the camera": lambda: moved(random_surfels(60, 7, scale=0.4), (0, -2.2, 0)),
    "on the border": lambda: moved(random_surfels(80, 8), (1.4, 0, 0.9)),
    "outside": lambda: moved(random_surfels(30, 9), (30, 0, 0)),
    "opaque": lambda: with_opacity(random_surfels(80, 10), 0.98, 1),
    "faint": lambda: with_opacity(random_surfels(80, 11), 0.9 / 255, 1.2 / 255),
    "a thousand in a pixel": lambda: in_one_pixel(1000),
}


def offsets_of(surfels: splat.Surfels) -> torch.Tensor:
    """Up to three pixels either way."""
    generator = torch.Generator().manual_seed(5)
    return 6 * torch.rand(len(surfels), 2, dtype=torch.float64, generator=generator) - 3


def assert_same(ours: splat.FeatureMaps, truth: splat.FeatureMaps) -> None:
    """Within 1e-5 but for flips at the threshold, in at most one pixel or 0.02 % of them."""
    wrong = torch.zeros_like(truth.alpha, dtype=torch.bool)
    for field in fields(truth):
        got, expected = getattr(ours, field.name), getattr(truth, field.name)
        assert got.shape == expected.shape, field.name
        assert got.dtype == expected.dtype, field.name
        off = (got - expected).abs() > 1e-5 * expected.abs().clamp(min=1)
        wrong |= off if off.ndim == 2 else off.any(dim=2)
    assert wrong.sum() <= max(1, 2e-4 * wrong.numel())
    assert (ours.alpha - truth.alpha).abs().max() < FLIP
    assert ((ours.features - truth.features).abs() < FLIP).all()


@pytest.mark.parametrize("name", SCENES)
def test_values_are_those_of_the_specification(name: str):
    surfels, camera = SCENES[name](), camera_of()
    assert_same(splat.rasterize(surfels, camera), splat.rasterize(surfels, camera, backend="reference"))


@pytest.mark.parametrize("name", SCENES)
def test_values_of_moved_pictures_are_those_of_the_specification(name: str):
    surfels, camera = SCENES[name](), camera_of()
    offsets = offsets_of(surfels)
    truth = splat.rasterize(surfels, camera, offsets=offsets, backend="reference")
    assert_same(splat.rasterize(surfels, camera, offsets=offsets), truth)


def test_a_plane_is_not_met_in_front_of_the_near_plane():
    """It passes 5 mm below the camera: the steeper half of the rays below the horizon meets it too early."""
    flat = [[0.0, 0.005, 1.0]], [[0.5**0.5, 0.5**0.5, 0, 0]], [[5.0, 5.0]], [1.0], [[1.0]]
    floor = splat.Surfels(*(torch.tensor(value, dtype=torch.float64) for value in flat))
    camera = Camera(20, 20, np.array([[10, 0, 10.0], [0, 10, 10], [0, 0, 1]]), np.eye(4))
    maps = splat.rasterize_features(floor, camera)
    assert (maps.alpha[10:15] > 0.9).all()  # down by up to 1 in 2: at 0.005 / 0.5 m or farther
    assert (maps.alpha[15:] == 0).all()
    assert_same(maps, splat.rasterize_features(floor, camera, backend="reference"))


def test_equal_depths_are_drawn_as_they_come():
    """More of them than are drawn at a time, and further ones before and behind."""
    surfels = random_surfels(210, 6, scale=0.4)
    depths = torch.tensor([3.0, 2.0, 4.0], dtype=torch.float64)[torch.arange(210) // 30 % 3]
    centres = torch.cat([surfels.centres[:, :2], depths[:, None]], dim=1)
    surfels = with_opacity(replace(surfels, centres=centres), 0.03, 0.06)
    camera = Camera(20, 18, np.array([[20, 0, 10.0], [0, 20, 9], [0, 0, 1]]), np.eye(4))
    assert_same(splat.rasterize(surfels, camera), splat.rasterize(surfels, camera, backend="reference"))


@pytest.mark.parametrize("draw", [splat.rasterize, splat.rasterize_features])
@pytest.mark.parametrize("channels", [0, 1, 2, 7, 16, 17, 40])
def test_any_number_of_channels(channels: int, draw: Callable[..., splat.FeatureMaps]):
    surfels, camera = random_surfels(60, 1), camera_of()
    features = torch.rand(60, channels, dtype=torch.float64, generator=torch.Generator().manual_seed(0))
    assert_same(draw(surfels, camera, features), draw(surfels, camera, features, backend="reference"))


@pytest.mark.parametrize(("width", "height"), [(1, 1), (16, 16), (17, 15), (1, 40), (33, 3)])
def test_any_size(width: int, height: int):
    surfels, camera = random_surfels(60, 2), camera_of(width, height, 20)
    assert_same(splat.rasterize(surfels, camera), splat.rasterize(surfels, camera, backend="reference"))


def test_far_from_the_corner_no_digits_are_lost():
    """Pixel coordinates beyond a thousand, on a strip that the reference can hold."""
    surfels = replace(random_surfels(60, 3, scale=0.003), centres=torch.from_numpy(
        np.random.default_rng(0).uniform(-1, 1, (60, 3)) * [1, 0.5, 0.001]))  # fmt: skip
    K = np.array([[2000, 0, 1000.0], [0, 2000, 2], [0, 0, 1]])
    camera = Camera(2000, 4, K, look_at(np.array([0, -2.5, 0.0]), np.zeros(3)))
    truth = splat.rasterize(surfels, camera, backend="reference")
    assert (truth.alpha[:, 1000:] > 0.1).sum() > 20
    assert_same(splat.rasterize(surfels, camera), truth)


def test_float32_comes_back_as_float32():
    surfels = random_surfels(20)
    single = splat.Surfels(*(getattr(surfels, f.name).float() for f in fields(surfels)))
    exact = splat.Surfels(*(getattr(single, f.name).double() for f in fields(surfels)))
    maps = splat.rasterize(single, camera_of())
    assert maps.alpha.dtype == torch.float32
    truth = splat.rasterize(exact, camera_of(), backend="reference")
    np.testing.assert_allclose(maps.features, truth.features, atol=1e-5)


def test_one_thread_and_two_draw_the_same_bits():
    surfels, camera = random_surfels(500, 12), camera_of(70, 50, 60)
    before, drawn = numba.get_num_threads(), []
    try:
        for threads in (1, min(2, before), min(2, before)):
            numba.set_num_threads(threads)
            drawn.append(splat.rasterize(surfels, camera))
    finally:
        numba.set_num_threads(before)
    for field in fields(drawn[0]):
        assert all(torch.equal(getattr(drawn[0], field.name), getattr(d, field.name)) for d in drawn[1:])


def gradients(
    surfels: splat.Surfels,
    camera: Camera,
    backend: splat.Backend,
    draw: Callable[..., splat.FeatureMaps] = splat.rasterize,
) -> dict[str, torch.Tensor]:
    """Return gradients of a random weighting of all maps, by each tensor of the surfels and by their
    offsets."""
    values = {f.name: getattr(surfels, f.name) for f in fields(surfels)}
    values["offsets"] = 0.3 * offsets_of(surfels)
    leaves = {name: value.detach().clone().requires_grad_() for name, value in values.items()}
    tensors = {name: leaf for name, leaf in leaves.items() if name != "offsets"}
    maps = draw(splat.Surfels(**tensors), camera, backend=backend, offsets=leaves["offsets"])
    random, loss = torch.Generator().manual_seed(1), torch.zeros(())
    for field in fields(maps):
        values = getattr(maps, field.name)
        weights = torch.rand(values.shape, generator=random, dtype=torch.float64) - 0.5
        loss = loss + (weights.to(values.dtype) * values).sum()
    loss.backward()
    return {name: cast(torch.Tensor, leaf.grad) for name, leaf in leaves.items()}


def assert_same_gradients(
    surfels: splat.Surfels, camera: Camera, draw: Callable[..., splat.FeatureMaps] = splat.rasterize
) -> None:
    """Within 1e-4 of the length of the gradient as a whole, and of its largest number one by one."""
    truth = gradients(surfels, camera, "reference", draw)
    for name, got in gradients(surfels, camera, "cpu", draw).items():
        expected, error = truth[name], got - truth[name]
        assert error.norm() <= 1e-4 * expected.norm(), name
        assert error.numel() == 0 or error.abs().max() <= 1e-4 * expected.abs().max(), name


@pytest.mark.parametrize("name", SCENES)
def test_gradients_are_those_of_the_specification(name: str):
    assert_same_gradients(SCENES[name](), camera_of())


@pytest.mark.parametrize("name", SCENES)
def test_gradients_of_features_alone_are_those_of_the_specification(name: str):
    assert_same_gradients(SCENES[name](), camera_of(), splat.rasterize_features)


@pytest.mark.parametrize("draw", [splat.rasterize, splat.rasterize_features])
@pytest.mark.parametrize("channels", [0, 1, 4, 5, 13, 16, 40])
def test_gradients_of_any_number_of_channels(channels: int, draw: Callable[..., splat.FeatureMaps]):
    assert_same_gradients(random_surfels(40, 1, channels), camera_of(21, 18, 20), draw)


@pytest.mark.parametrize("name", ["sparse", "dense", "large", "around the camera", "on the border"])
def test_scenes_are_not_empty(name: str):
    """Else the comparisons above would compare nothing with nothing."""
    assert all(g.abs().max() > 0 for g in gradients(SCENES[name](), camera_of(), "cpu").values())


def test_one_thread_and_two_give_the_same_gradients():
    surfels, camera = random_surfels(500, 12), camera_of(70, 50, 60)
    before, torch_before, found = numba.get_num_threads(), torch.get_num_threads(), []
    try:
        for threads in (1, min(2, before), min(2, before)):
            numba.set_num_threads(threads)
            torch.set_num_threads(threads)
            found.append(gradients(surfels, camera, "cpu"))
    finally:
        torch.set_num_threads(torch_before)
        numba.set_num_threads(before)
    for name, first in found[0].items():
        assert all(torch.equal(first, other[name]) for other in found[1:]), name


def test_an_unknown_back_end_is_named():
    with pytest.raises(UnknownNameError, match="did you mean 'reference'"):
        splat.rasterize(random_surfels(1), camera_of(), backend="referense")  # type: ignore[arg-type]  # on purpose


def test_surfels_elsewhere_are_refused():
    surfels = random_surfels(2)
    # A device without data stands for one that is not here; its values cannot be looked at.
    elsewhere = object.__new__(splat.Surfels)
    for field in fields(surfels):
        object.__setattr__(elsewhere, field.name, getattr(surfels, field.name).to("meta"))
    with pytest.raises(ValueError, match="surfels on the CPU, got them on meta"):
        splat.rasterize(elsewhere, camera_of())


def test_more_than_the_memory_is_refused_before_it_is_taken(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(_stages, "UNCHECKED", 0)
    monkeypatch.setattr("psutil.virtual_memory", lambda: SimpleNamespace(available=1000))
    with pytest.raises(MethodError, match=r"GiB of memory to draw 20 surfels, got .*: draw fewer"):
        splat.rasterize_features(random_surfels(20), camera_of())


@pytest.mark.parametrize(("channels", "drawn"), [(0, 3), (3, 3), (4, 8), (8, 8), (9, 16), (17, 32)])
def test_few_numbers_of_channels_are_compiled(channels: int, drawn: int):
    assert _stages.padded_channels(channels) == drawn
