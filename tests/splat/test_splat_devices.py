# SPDX-License-Identifier: Apache-2.0
"""The operations in PyTorch, of which a fit on a GPU is made, held to the kernels of the CPU."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import pytest
import torch

from graycard import Camera, look_at
from graycard.methods import splat
from graycard.methods.splat._devices import on_device
from graycard.methods.splat.fit._adam import move_all, move_by_pytorch
from graycard.methods.splat.fit._moved import Moved
from graycard.methods.splat.ops import _depth_normal, _pytorch

SIZES = [(1, 1, 1), (3, 2, 1), (2, 60, 3), (33, 29, 2), (40, 33, 3)]
RANGES = {"unit": (0.0, 1.0), "bright and flat": (5.0, 0.01), "nearly black": (0.0, 1e-3), "lamps": (0, 100)}
EYE = np.array([0.3, -2.0, 0.7])


def drawn(*shape: int, seed: int = 0) -> torch.Tensor:
    return torch.from_numpy(np.random.default_rng(seed).uniform(size=shape).astype(np.float32))


def assert_alike(
    ours: Callable[..., torch.Tensor],
    theirs: Callable[..., torch.Tensor],
    *given: torch.Tensor,
    bar: float = 1e-4,
):
    """Values to 1e-5, gradients to a share of their length."""
    found = []
    for function in (ours, theirs):
        leaves = [one.clone().requires_grad_() for one in given]
        values = function(*leaves)
        weights = drawn(*values.shape, seed=7) - 0.4
        gradients = torch.autograd.grad((weights * values).sum(), leaves, allow_unused=True)
        found.append((values.detach(), gradients))
    (values, gradients), (expected, truth) = found
    assert values.dtype == expected.dtype
    torch.testing.assert_close(values, expected, rtol=1e-5, atol=1e-5)
    for mine, other in zip(gradients, truth, strict=True):
        if mine is None or other is None:
            assert mine is None or not mine.any()
            assert other is None or not other.any()
            continue
        assert float((mine - other).norm()) <= bar * float(other.norm()) + 1e-7


@pytest.mark.parametrize("values", RANGES)
@pytest.mark.parametrize("size", SIZES)
def test_images_are_compared_as_by_the_kernel(size: tuple[int, int, int], values: str):
    offset, contrast = RANGES[values]
    bar = 5e-4 if values == "bright and flat" else 1e-4  # there the kernel's float32 has no more digits
    image, noise = drawn(*size), drawn(*size, seed=1)
    image, target = offset + contrast * image, offset + contrast * (0.6 * image + 0.4 * noise)
    for terms, kernel in (
        ((1.0, 0.0, -1.0), lambda x: splat.ssim_map(x, target)),
        ((0.0, 0.8, 0.2), lambda x: splat.photometric_map(x, target)),
    ):
        assert_alike(lambda x, terms=terms: _pytorch.compare_images(x, target, terms), kernel, image, bar=bar)


def test_equal_images_have_a_similarity_of_one_and_no_gradient():
    image = (3 + drawn(20, 30, 3)).requires_grad_()
    similar = _pytorch.compare_images(image, image.detach(), (1.0, 0.0, -1.0))
    assert torch.equal(similar, torch.ones_like(similar))
    similar.sum().backward()
    assert image.grad is not None
    assert not image.grad.any()


def camera_of(width: int, height: int) -> Camera:
    K = np.array([[30.0, 0.4, width / 2 + 0.3], [0, 33, height / 2 - 0.2], [0, 0, 1]])
    return Camera(width, height, K, look_at(EYE, np.zeros(3)))


@pytest.mark.parametrize("size", [(1, 1), (2, 9), (3, 3), (9, 7), (20, 40)])
@pytest.mark.parametrize("holes", [False, True])
def test_normals_of_a_depth_are_those_of_the_kernel(size: tuple[int, int], holes: bool):
    height, width = size
    camera, depth = camera_of(width, height), 2 + 0.1 * drawn(height, width)
    if holes:
        depth[::4, ::3], depth[1::5, 2::4] = 0, torch.inf
    normal, alpha = drawn(height, width, 3, seed=2) - 0.5, drawn(height, width, seed=3)
    frame = _depth_normal._frame(camera, depth.dtype)
    assert_alike(
        lambda z: _pytorch.normals_of_depth(z, frame), lambda z: splat.depth_to_normals(z, camera), depth
    )
    assert_alike(
        lambda z, n: _pytorch.normal_mismatch(z, n, alpha, frame),
        lambda z, n: splat.depth_normal_map(z, n, alpha, camera),
        depth,
        normal,
    )


@pytest.mark.parametrize("degree", [0, 1, 2, 3])
def test_colours_of_harmonics_are_those_of_the_kernel(degree: int):
    coefficients, centres = drawn(50, 16, 3) - 0.5, drawn(50, 3, seed=1)
    centres[7] = torch.from_numpy(EYE)  # in the eye: no direction, and so no gradient
    assert_alike(
        lambda c, x: _pytorch.harmonics_sum(c, x, EYE, (degree + 1) ** 2),
        lambda c, x: splat.spherical_harmonics_colours(c, x, EYE, degree),
        coefficients,
        centres,
    )


def test_adam_moves_as_the_kernel_does():
    fits = []
    for move in (lambda one: move_all([one], 1e-15), lambda one: move_by_pytorch(one, 1e-15)):
        values, means = drawn(300, 3), torch.zeros(2, 300, 3)
        for step in range(20):
            gradient = 10.0 ** (step % 5 - 2) * (drawn(300, 3, seed=step) - 0.5)
            gradient[:7] = 0
            move(Moved(values, gradient, means[0], means[1], 1e-2, step + 1))
        fits.append((values, *means))
    for mine, other in zip(*fits, strict=True):
        torch.testing.assert_close(mine, other, rtol=1e-5, atol=1e-6)
    assert not torch.equal(fits[0][0], drawn(300, 3))


class Pair(NamedTuple):
    one: torch.Tensor
    other: object


def test_all_tensors_of_a_value_are_moved_and_nothing_else():
    meta = torch.device("meta")
    camera, one = camera_of(4, 4), torch.zeros(2)
    value = {"views": [(camera, one)], "pair": Pair(one, "name"), "none": None}
    moved = on_device(value, meta)
    assert moved["views"][0][1].device == moved["pair"].one.device == meta
    assert moved["views"][0][0] is camera
    assert isinstance(moved["pair"], Pair)
    assert on_device(value, splat.CPU) is value
    surfels = splat.Surfels(*(torch.rand(3, n) for n in (3,)), *_rest())
    assert on_device(surfels, splat.CPU) is surfels


def _rest() -> tuple[torch.Tensor, ...]:
    turns = torch.tensor([[1.0, 0, 0, 0]]).repeat(3, 1)
    return turns, torch.rand(3, 2) + 0.1, torch.rand(3), torch.rand(3, 1)


def test_an_unknown_place_is_refused():
    with pytest.raises(ValueError, match="float32 on the CPU or a GPU, got torch.float32 on meta"):
        splat.ssim_map(torch.zeros(4, 4, 3, device="meta"), torch.zeros(4, 4, 3, device="meta"))
