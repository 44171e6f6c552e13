# SPDX-License-Identifier: Apache-2.0
"""Adam on all parameters in one sweep, beside PyTorch's, one tensor at a time."""

from dataclasses import dataclass

import numba
import pytest
import torch
from torch.optim.adam import adam

from graycard.methods.splat.fit._adam import move_all
from graycard.methods.splat.fit._moved import Moved

SHAPES = ((300, 3), (41,), (5, 2, 3), (7,), ())
"""Sizes that fill vectors and others; the last has one number."""
RATES = (1e-2, 5e-2, 3e-3, 1e-1, 2e-2)
EPSILON = 1e-15


@dataclass(frozen=True)
class Fit:
    values: list[torch.Tensor]
    first: list[torch.Tensor]
    second: list[torch.Tensor]


def begun() -> Fit:
    draws = torch.Generator().manual_seed(0)
    values = [torch.randn(shape, generator=draws) for shape in SHAPES]
    return Fit(values, *([torch.zeros(shape) for shape in SHAPES] for _ in range(2)))


def gradients(step: int) -> list[torch.Tensor]:
    """Large and small ones, and some of zero."""
    draws = torch.Generator().manual_seed(100 + step)
    found = [10 ** torch.randn((), generator=draws) * torch.randn(s, generator=draws) for s in SHAPES]
    found[0][:7] = 0
    return found


def swept(fit: Fit, steps: int) -> Fit:
    for step in range(steps):
        rows = zip(fit.values, gradients(step), fit.first, fit.second, RATES, strict=True)
        move_all([Moved(*row, steps=step + 1) for row in rows], EPSILON)
    return fit


def one_by_one(fit: Fit, steps: int) -> Fit:
    counts = [torch.zeros(()) for _ in SHAPES]
    for step in range(steps):
        rows = zip(fit.values, gradients(step), fit.first, fit.second, counts, RATES, strict=True)
        for values, gradient, first, second, count, rate in rows:
            adam(
                [values], [gradient], [first], [second], [], [count], fused=True, amsgrad=False, beta1=0.9,
                beta2=0.999, lr=rate, weight_decay=0.0, eps=EPSILON, maximize=False,
            )  # fmt: skip
    return fit


def test_steps_are_those_of_pytorch():
    """But for rounding of what does not fill a vector."""
    found, expected = swept(begun(), 30), one_by_one(begun(), 30)
    for name in ("values", "first", "second"):
        for mine, theirs in zip(getattr(found, name), getattr(expected, name), strict=True):
            torch.testing.assert_close(mine, theirs, rtol=1e-5, atol=1e-6)
    assert not torch.equal(found.values[4], begun().values[4])


def test_threads_do_not_change_the_bits():
    before, found = numba.get_num_threads(), []
    for count in {1, before}:
        numba.set_num_threads(count)
        found.append(swept(begun(), 3))
    numba.set_num_threads(before)
    for other in found:
        assert all(torch.equal(a, b) for a, b in zip(found[0].values, other.values, strict=True))


def test_what_has_no_gradient_yet_stays():
    fit = begun()
    move_all([], EPSILON)
    rows = zip(fit.values, [torch.zeros(s) for s in SHAPES], fit.first, fit.second, RATES, strict=True)
    move_all([Moved(*row, steps=1) for row in rows], EPSILON)
    assert all(torch.equal(a, b) for a, b in zip(fit.values, begun().values, strict=True))


@pytest.mark.parametrize(
    "gradient",
    [
        pytest.param(torch.zeros(4, 3, dtype=torch.float64), id="float64"),
        pytest.param(torch.zeros(3, 4).T, id="columns first"),
        pytest.param(torch.zeros(4), id="another shape"),
    ],
)
def test_what_the_kernel_cannot_read_is_refused(gradient: torch.Tensor):
    values, first, second = (torch.zeros(4, 3) for _ in range(3))
    with pytest.raises(ValueError, match="expected tensors in float32 on the CPU or a GPU, in C order"):
        move_all([Moved(values, gradient, first, second, 0.1, 1)], EPSILON)
