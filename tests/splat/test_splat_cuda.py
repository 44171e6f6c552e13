# SPDX-License-Identifier: Apache-2.0
"""The back end ``cuda``: with gsplat's PyTorch code in the place of its kernels, and with them on a GPU."""

import sys
from collections.abc import Callable
from dataclasses import fields, replace
from functools import partial
from importlib.util import find_spec
from types import ModuleType
from typing import Any

import numpy as np
import pytest
import torch

from graycard import Camera, MethodError, look_at
from graycard.methods import splat
from graycard.methods.splat.cuda import _rasterize as _cuda
from gsplat_stand_ins import stand_ins
from random_surfels import random_surfels as any_surfels

needs_gsplat = pytest.mark.skipif(find_spec("gsplat") is None, reason="gsplat comes with the extra 'gpu'")


def camera_of(width: int = 21, height: int = 18, focal: float = 20) -> Camera:
    K = np.array([[focal, 0.4, width / 2 + 0.3], [0, 1.1 * focal, height / 2 - 0.2], [0, 0, 1]])
    return Camera(width, height, K, look_at(np.array([0.2, -2.5, 0.3]), np.zeros(3)))


random_surfels = partial(any_surfels, seed=1000, scale=0.2, opacities=(0.02, 0.97))


def at(surfels: splat.Surfels, direction: tuple[float, float, float]) -> splat.Surfels:
    return replace(surfels, centres=surfels.centres + torch.tensor(direction, dtype=torch.float64))


def opaque(surfels: splat.Surfels) -> splat.Surfels:
    return replace(surfels, opacities=torch.linspace(0.9, 1, len(surfels), dtype=torch.float64))


def edge_on(count: int) -> splat.Surfels:
    half = torch.linspace(-2e-3, 2e-3, count, dtype=torch.float64) + torch.pi / 4
    turns = torch.stack([half.cos(), 0 * half, half.sin(), 0 * half], dim=1)
    surfels = random_surfels(count)
    centres = surfels.centres * torch.tensor([0.0, 1, 1]) + torch.tensor([0.2, 0, 0])
    return replace(surfels, rotations=turns, centres=centres)


SCENES: dict[str, Callable[[], splat.Surfels]] = {
    "many": lambda: random_surfels(60),
    "large": lambda: random_surfels(15, scale=0.3),
    "none": lambda: random_surfels(0),
    "behind": lambda: at(random_surfels(10), (0, -4, 0)),
    "outside": lambda: at(random_surfels(10), (30, 0, 0)),
    "on the border": lambda: at(random_surfels(30), (1.4, 0, 0.9)),
}
"""Scenes in which gsplat's features are to be those of the contract."""
HARD: dict[str, Callable[[], splat.Surfels]] = {
    "through the camera's plane": lambda: random_surfels(15, scale=1.0),
    "around the camera": lambda: at(random_surfels(20, scale=0.4), (0, -2.2, 0)),
    "opaque": lambda: opaque(random_surfels(60, scale=0.4)),
    "edge-on": lambda: edge_on(20),
}
"""Scenes in which they may differ, as documented; all maps are to be right."""


def leaves_of(surfels: splat.Surfels, device: str = "cpu") -> dict[str, torch.Tensor]:
    leaves = {f.name: getattr(surfels, f.name).detach().to(device, copy=True) for f in fields(surfels)}
    leaves["offsets"] = (
        torch.linspace(-1.5, 1.5, 2 * len(surfels), dtype=torch.float64).reshape(-1, 2).to(device)
    )
    return {name: leaf.requires_grad_() for name, leaf in leaves.items()}


def surfels_from(leaves: dict[str, torch.Tensor]) -> splat.Surfels:
    return splat.Surfels(**{name: leaf for name, leaf in leaves.items() if name != "offsets"})


Draw = Callable[[splat.Surfels, Camera, torch.Tensor], splat.FeatureMaps]


def of_the_contract(surfels: splat.Surfels, camera: Camera, offsets: torch.Tensor) -> splat.Maps:
    return splat.rasterize(surfels, camera, backend="reference", offsets=offsets)


def assert_same(surfels: splat.Surfels, draw: Draw, atol: float = 1e-5, device: str = "cpu") -> None:
    """Values but for one flip, and gradients of all the maps that come, within 1e-4 of their length."""
    images, found = [], []
    for how, where in ((draw, device), (of_the_contract, "cpu")):
        leaves = leaves_of(surfels, where)
        maps = how(surfels_from(leaves), camera_of(), leaves["offsets"])
        images.append({f.name: getattr(maps, f.name).cpu() for f in fields(maps)})
        random, loss = torch.Generator().manual_seed(1000), torch.zeros((), dtype=torch.float64)
        for name in images[0]:
            weights = torch.rand(images[-1][name].shape, generator=random, dtype=torch.float64) - 0.5
            loss = loss + (weights * images[-1][name]).sum()
        loss.backward()
        grads = {
            name: torch.zeros_like(leaf) if leaf.grad is None else leaf.grad for name, leaf in leaves.items()
        }
        found.append({name: grad.cpu() for name, grad in grads.items()})
    ours, truth = images
    for name, got in ours.items():
        assert got.dtype == torch.float64
        off = (got - truth[name]).abs() > atol * truth[name].abs().clamp(min=1)
        assert (off if off.ndim == 2 else off.any(dim=2)).sum() <= 1, name
        assert ((got - truth[name]).abs() < 4e-3).all() or name in ("depth", "median_depth"), name
    for name, expected in found[1].items():
        error, length = float((found[0][name] - expected).norm()), float(expected.norm())
        assert error <= 1e-4 * length, f"{name}: error {error:.3g}, gradient {length:.3g}"


def maps_here(surfels: splat.Surfels, camera: Camera, offsets: torch.Tensor) -> splat.Maps:
    return _cuda.draw_maps(stand_ins(), surfels, camera, offsets=offsets)


def features_here(surfels: splat.Surfels, camera: Camera, offsets: torch.Tensor) -> splat.FeatureMaps:
    return _cuda.draw_features(stand_ins(), surfels, camera, offsets=offsets)


@needs_gsplat
@pytest.mark.parametrize("name", SCENES | HARD)
def test_all_maps_are_those_of_the_contract(name: str):
    assert_same((SCENES | HARD)[name](), maps_here, atol=1e-9)


@needs_gsplat
@pytest.mark.parametrize("name", SCENES)
def test_features_are_those_of_the_contract(name: str):
    assert_same(SCENES[name](), features_here)


@needs_gsplat
@pytest.mark.parametrize("channels", [0, 1, 5, 32, 40])
def test_any_number_of_channels(channels: int):
    surfels = random_surfels(20, channels=channels)
    assert_same(surfels, features_here)
    assert_same(surfels, maps_here)


@needs_gsplat
def test_features_of_opaque_surfels_differ_by_less_than_a_hundredth():
    surfels = opaque(random_surfels(60, scale=0.4))
    maps = _cuda.draw_features(stand_ins(), surfels, camera_of())
    error = (maps.alpha - splat.rasterize(surfels, camera_of(), backend="reference").alpha).abs()
    assert 1e-5 < error.max() < 0.01


@needs_gsplat
def test_an_opaque_surfel_can_fade():
    leaves = leaves_of(opaque(random_surfels(20)))
    _cuda.draw_features(stand_ins(), surfels_from(leaves), camera_of()).alpha.sum().backward()
    assert leaves["opacities"].grad is not None
    assert leaves["opacities"].grad[-1] > 0


@needs_gsplat
def test_float32_and_features_of_ones_own():
    exact = random_surfels(20)
    surfels = splat.Surfels(*(getattr(exact, f.name).float() for f in fields(exact)))
    features = torch.rand(20, 2, generator=torch.Generator().manual_seed(1000))
    for maps in (
        _cuda.draw_maps(stand_ins(), surfels, camera_of(), features),
        _cuda.draw_features(stand_ins(), surfels, camera_of(), features),
    ):
        truth = splat.rasterize(exact, camera_of(), features.double(), backend="reference")
        assert maps.features.dtype == torch.float32
        np.testing.assert_allclose(maps.features, truth.features, atol=2e-5)


@needs_gsplat
def test_the_public_functions_draw_with_gsplats(monkeypatch: pytest.MonkeyPatch):
    """They draw as on a GPU, but for the place of the tensors."""
    monkeypatch.setattr(_cuda, "gsplat_kernels", stand_ins)
    monkeypatch.setattr(_cuda, "_check_device", lambda surfels: None)
    surfels = random_surfels(20)
    truth = splat.rasterize(surfels, camera_of(), backend="reference")
    np.testing.assert_allclose(_cuda.rasterize_cuda(surfels, camera_of()).depth, truth.depth, atol=1e-9)
    features = _cuda.rasterize_features_cuda(surfels, camera_of()).features
    np.testing.assert_allclose(features, truth.features, atol=1e-5)


@pytest.mark.parametrize("draw", [_cuda.draw_maps, _cuda.draw_features])
def test_what_does_not_fit_is_refused(draw: Any):
    kernels: Any = None
    with pytest.raises(ValueError, match=r"features of shape \(5, C\)"):
        draw(kernels, random_surfels(5), camera_of(), features=torch.zeros(4, 2).double())
    with pytest.raises(ValueError, match=r"offsets of shape \(5, 2\)"):
        draw(kernels, random_surfels(5), camera_of(), offsets=torch.zeros(5, 3).double())


@pytest.mark.parametrize("draw", [_cuda.rasterize_cuda, _cuda.rasterize_features_cuda])
def test_without_gsplat_it_says_what_to_install(draw: Any, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(_cuda, "find_spec", lambda name: None)
    with pytest.raises(MethodError, match=r"pip install 'graycard\[gpu\]'"):
        draw(random_surfels(1), camera_of())


@needs_gsplat
def test_without_a_gpu_it_says_so(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(torch.cuda, "is_available", lambda: False)
    with pytest.raises(MethodError, match="expected a CUDA device"):
        _cuda.rasterize_cuda(random_surfels(1), camera_of())


@needs_gsplat
@pytest.mark.parametrize("compiled", [False, True])
def test_gsplat_needs_its_kernels(compiled: bool, monkeypatch: pytest.MonkeyPatch):
    """A GPU, but no compiler; and both, but surfels that were left on the CPU."""
    import gsplat.cuda

    backend = ModuleType("gsplat.cuda._backend")
    backend._C = object() if compiled else None  # pyright: ignore[reportAttributeAccessIssue]
    monkeypatch.setitem(sys.modules, "gsplat.cuda._backend", backend)
    monkeypatch.setattr(gsplat.cuda, "_backend", backend, raising=False)
    monkeypatch.setattr(torch.cuda, "is_available", lambda: True)
    error, match = (ValueError, "on a CUDA device, got them on cpu") if compiled else (MethodError, "nvcc")
    with pytest.raises(error, match=match):
        _cuda.rasterize_cuda(random_surfels(1), camera_of())


@pytest.mark.gpu
@pytest.mark.parametrize("name", SCENES | HARD)
def test_all_maps_on_a_gpu(name: str):
    def draw(surfels: splat.Surfels, camera: Camera, offsets: torch.Tensor) -> splat.Maps:
        return _cuda.rasterize_cuda(surfels, camera, offsets=offsets)

    assert_same((SCENES | HARD)[name](), draw, device="cuda")


@pytest.mark.gpu
@pytest.mark.parametrize("name", SCENES)
def test_features_on_a_gpu(name: str):
    def draw(surfels: splat.Surfels, camera: Camera, offsets: torch.Tensor) -> splat.FeatureMaps:
        return _cuda.rasterize_features_cuda(surfels, camera, offsets=offsets)

    assert_same(SCENES[name](), draw, atol=1e-4, device="cuda")  # gsplat's are fast-math kernels
