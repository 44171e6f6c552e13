# SPDX-License-Identifier: Apache-2.0
"""Mistakes of users: each has a clear error, and none ends the interpreter."""

import subprocess
import sys
from collections.abc import Callable
from dataclasses import fields, replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import psutil
import pytest
import torch

from graycard import Camera, MethodError, UnknownNameError
from graycard.methods import splat

BACKENDS: list[splat.Backend] = ["cpu", "reference"]
HOW: list[Callable[..., splat.FeatureMaps]] = [splat.rasterize, splat.rasterize_features]
TENSORS = ("centres", "rotations", "scales", "opacities", "features")


def camera_of(width: int = 20, height: int = 17) -> Camera:
    return Camera(width, height, np.array([[20, 0, 10.0], [0, 20, 8], [0, 0, 1]]), np.eye(4))


def surfels_of(count: int = 3, dtype: torch.dtype = torch.float64) -> splat.Surfels:
    return splat.Surfels(
        torch.tensor([[0.0, 0, 2]] * count, dtype=dtype).reshape(count, 3),
        torch.tensor([[1.0, 0, 0, 0]] * count, dtype=dtype).reshape(count, 4),
        torch.full((count, 2), 0.2, dtype=dtype),
        torch.full((count,), 0.5, dtype=dtype),
        torch.ones(count, 3, dtype=dtype),
    )


@pytest.mark.parametrize("bad", [float("nan"), float("inf"), -float("inf")])
@pytest.mark.parametrize("name", TENSORS)
def test_numbers_that_are_none_are_refused(name: str, bad: float):
    values = getattr(surfels_of(), name).clone()
    values[1] = bad
    with pytest.raises(ValueError, match=rf"expected {name} to be finite, got .*(nan|inf).* at surfel 1"):
        replace(surfels_of(), **{name: values})


@pytest.mark.parametrize(
    ("name", "bad", "rule"),
    [
        ("scales", 0.0, "positive"),
        ("scales", -0.1, "positive"),
        ("opacities", 1.01, r"in \[0, 1\]"),
        ("opacities", -1e-9, r"in \[0, 1\]"),
        ("rotations", 0.0, "of unit length"),
        ("rotations", 2.0, "of unit length"),
    ],
)
def test_values_out_of_range_are_refused(name: str, bad: float, rule: str):
    values = getattr(surfels_of(), name).clone()
    values[2] = bad
    with pytest.raises(ValueError, match=f"expected {name} to be {rule}, got .* at surfel 2"):
        replace(surfels_of(), **{name: values})


@pytest.mark.parametrize("name", TENSORS)
def test_wrong_shapes_dtypes_and_devices_are_refused(name: str):
    good = getattr(surfels_of(), name)
    with pytest.raises(ValueError, match=f"expected {name} of shape"):
        replace(surfels_of(), **{name: good[..., None]})
    with pytest.raises(ValueError, match="expected .* of shape"):
        replace(surfels_of(), **{name: good[:2]})
    for dtype in (torch.float16, torch.int64):
        with pytest.raises(ValueError, match=f"expected {name} in float32 or float64, got {dtype}"):
            replace(surfels_of(), **{name: good.to(dtype)})
    with pytest.raises(ValueError, match="as the centres are"):
        replace(surfels_of(), **{name: good.float()})
    with pytest.raises(ValueError, match=f"expected {name} to be a torch.Tensor, got ndarray"):
        replace(surfels_of(), **{name: good.numpy()})


def test_tensors_on_several_devices_are_refused():
    elsewhere = surfels_of().opacities.to("meta")
    with pytest.raises(ValueError, match=r"as the centres are \(.*on cpu\), got .* on meta"):
        replace(surfels_of(), opacities=elsewhere)


@pytest.mark.parametrize("size", [(0, 5), (5, 0), (-3, 5)])
def test_an_image_without_pixels_is_refused(size: tuple[int, int]):
    with pytest.raises(ValueError, match="expected a positive image size"):
        camera_of(*size)


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("how", HOW)
@pytest.mark.parametrize("name", ["features", "offsets"])
def test_what_comes_beside_the_surfels_has_to_fit(name: str, how: Any, backend: splat.Backend):
    one = torch.zeros(3, 2, dtype=torch.float64)
    for bad in (one[:2], one[0], one.float(), one[:, :, None]):
        with pytest.raises(ValueError, match=rf"expected {name} of shape \(3, .\) in torch.float64, got"):
            how(surfels_of(), camera_of(), backend=backend, **{name: bad})
    with pytest.raises(ValueError, match=rf"expected {name} of shape .* got a list"):
        how(surfels_of(), camera_of(), backend=backend, **{name: [[1.0, 1.0]] * 3})
    for number in (float("nan"), float("inf")):
        one[1, 0] = number
        with pytest.raises(ValueError, match=rf"expected {name} to be finite, got .*(nan|inf).* at surfel 1"):
            how(surfels_of(), camera_of(), backend=backend, **{name: one})


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("how", HOW)
def test_an_unknown_back_end_is_named(how: Any, backend: splat.Backend):
    with pytest.raises(UnknownNameError, match=f"did you mean {backend!r}"):
        how(surfels_of(), camera_of(), backend=backend + "s")


@pytest.mark.parametrize("how", HOW)
@pytest.mark.parametrize("pixels", [8, 2400])
def test_too_little_memory_is_said_before_it_is_taken(how: Any, pixels: int, monkeypatch: pytest.MonkeyPatch):
    """Surfels or pixels would take it."""
    few = SimpleNamespace(available=2_000_000, total=4_000_000, percent=50.0)
    monkeypatch.setattr(psutil, "virtual_memory", lambda: few)
    surfels = surfels_of(700_000 if pixels == 8 else 3, torch.float32)
    with pytest.raises(MethodError, match=r"(?is)memory.*(fewer|smaller)"):
        how(surfels, camera_of(pixels, pixels))


def test_tensors_of_any_layout_are_the_same_to_it():
    """Strided, expanded, a part of something larger: what a kernel on bare pointers may get wrong."""
    r = torch.Generator().manual_seed(1000)
    plain = surfels_of(6)
    plain = replace(plain, features=torch.rand(6, 3, dtype=torch.float64, generator=r))
    strided = splat.Surfels(
        plain.centres.T.contiguous().T,
        torch.tensor([1.0, 0, 0, 0], dtype=torch.float64).expand(6, 4),
        torch.full((6, 4), 0.2, dtype=torch.float64)[:, ::2],
        torch.full((12,), 0.5, dtype=torch.float64)[::2],
        torch.cat([plain.features, plain.features], dim=1)[:, :3],
    )
    offsets = torch.zeros(2, 6, dtype=torch.float64).T
    for how in HOW:
        expected, got = how(plain, camera_of()), how(strided, camera_of(), offsets=offsets)
        for f in fields(expected):
            assert torch.equal(getattr(got, f.name), getattr(expected, f.name)), f.name


def test_gradients_of_some_tensors_only():
    for name in TENSORS:
        leaf = getattr(surfels_of(), name).requires_grad_()
        maps = splat.rasterize(replace(surfels_of(), **{name: leaf}), camera_of())
        (maps.features.sum() + maps.alpha.sum() + maps.depth.sum()).backward()
        assert leaf.grad is not None
        assert torch.isfinite(leaf.grad).all()


CRASHES = """
import sys
from dataclasses import fields

import numpy as np
import torch

from graycard import Camera, GraycardError
from graycard.methods import splat

SIZE = torch.float64
names = ["centres", "rotations", "scales", "opacities", "features", "offsets"]
bad = [float("nan"), float("inf"), -float("inf"), 1e30, -1e30, 1e300, 1e-300, 0.0, -1.0, 3e9, 1e18]
refused = drawn = 0
for K in (20.0, 1e-6, 1e12):
    camera = Camera(20, 17, np.array([[K, 0, 10.0], [0, K, 8], [0, 0, 1]]), np.eye(4))
    for name in names:
        for value in bad:
            for how in (splat.rasterize, splat.rasterize_features):
                tensors = {
                    "centres": torch.tensor([[0.0, 0, 2], [0.1, 0, 2.5], [0, 0.1, 3]], dtype=SIZE),
                    "rotations": torch.tensor([[1.0, 0, 0, 0]] * 3, dtype=SIZE),
                    "scales": torch.full((3, 2), 0.2, dtype=SIZE),
                    "opacities": torch.full((3,), 0.5, dtype=SIZE),
                    "features": torch.ones(3, 3, dtype=SIZE),
                    "offsets": torch.zeros(3, 2, dtype=SIZE),
                }
                leaves = {key: tensor.requires_grad_() for key, tensor in tensors.items()}
                surfels = splat.Surfels(**{key: leaves[key] for key in names[:5]})
                with torch.no_grad():  # behind the back of Surfels, as an optimiser that diverges
                    leaves[name][1] = value
                try:
                    maps = how(surfels, camera, offsets=leaves["offsets"])
                    sum(getattr(maps, f.name).sum() for f in fields(maps)).backward()
                    drawn += 1
                except (ValueError, GraycardError):
                    refused += 1
sys.stdout.write(f"{refused} refused, {drawn} drawn")
"""


def test_nothing_ends_the_interpreter():
    """Values that no surfel may have, put in behind the checks, and values that none should have."""
    done = subprocess.run([sys.executable, "-c", CRASHES], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr[-2000:]
    refused, drawn = (int(word) for word in done.stdout.split() if word.isdigit())
    assert refused + drawn == 3 * 6 * 11 * 2
    assert drawn > 100
