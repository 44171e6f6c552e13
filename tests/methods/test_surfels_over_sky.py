# SPDX-License-Identifier: Apache-2.0
"""Surfels over the sky against the formula in PyTorch."""

import numba
import pytest
import torch

from graycard.methods.splat import FeatureMaps
from graycard.methods.surfels._compose import composed
from graycard.methods.surfels._start import SKY

SIZES = [(1, 1, 1), (3, 5, 1), (5, 3, 4), (70, 65, 1), (70, 65, 9)]
"""Height, width and harmonics; the largest are more than a thread takes at a time."""
Inputs = tuple[torch.Tensor, ...]


def inputs(height: int, width: int, harmonics: int) -> Inputs:
    """Features, alpha, harmonics of the pixels, and the sky's weights."""
    random = torch.Generator().manual_seed(height + harmonics)
    shapes = (height, width, 3), (height, width), (height, width, harmonics), (harmonics, 3)
    return tuple(torch.rand(shape, generator=random) for shape in shapes)


def definition(features: torch.Tensor, alpha: torch.Tensor, sky: torch.Tensor, weights: torch.Tensor):
    return features + (1 - alpha)[..., None] * (sky @ weights)


def ours(features: torch.Tensor, alpha: torch.Tensor, sky: torch.Tensor, weights: torch.Tensor):
    return composed(FeatureMaps(features, alpha), sky, {SKY: weights})


def gradients(values: Inputs, picture: torch.Tensor) -> Inputs:
    """Return gradients of a random weighting of the picture, by all but the harmonics."""
    asked = torch.rand(picture.shape, generator=torch.Generator().manual_seed(7), dtype=torch.float64) - 0.4
    features, alpha, _sky, weights = values
    return torch.autograd.grad((asked * picture).sum(), [features, alpha, weights])


@pytest.mark.parametrize("size", SIZES)
def test_the_picture_and_its_gradients_are_those_of_the_formula(size: tuple[int, int, int]):
    single = tuple(one.requires_grad_() for one in inputs(*size))
    double = tuple(one.detach().double().requires_grad_() for one in single)
    picture, expected = ours(*single), definition(*double)
    torch.testing.assert_close(picture.double(), expected, rtol=0, atol=1e-6)
    for got, truth in zip(gradients(single, picture), gradients(double, expected), strict=True):
        assert got.dtype == torch.float32
        torch.testing.assert_close(got.double(), truth, rtol=1e-5, atol=1e-5)


def test_memory_may_lie_in_any_order():
    features, alpha, sky, weights = inputs(6, 7, 4)
    turned = (one.transpose(0, 1).contiguous().transpose(0, 1) for one in (features, alpha, sky, weights))
    assert torch.equal(ours(*turned), ours(features, alpha, sky, weights))


def test_one_thread_and_two_give_the_same_bits():
    values = tuple(one.requires_grad_() for one in inputs(120, 90, 4))
    before, found = numba.get_num_threads(), []
    try:
        for threads in (1, min(2, before)):
            numba.set_num_threads(threads)
            picture = ours(*values)
            found.append((picture, *gradients(values, picture)))
    finally:
        numba.set_num_threads(before)
    assert all(torch.equal(one, other) for one, other in zip(*found, strict=True))
