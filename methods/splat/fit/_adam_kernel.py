# SPDX-License-Identifier: Apache-2.0
"""Adam on all parameters in one parallel region, however many tensors they are."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from llvmlite import ir
from numba import types
from numba.extending import intrinsic
from numba.np.numpy_support import carray

from graycard.methods._numba import njit
from graycard.methods.splat.fit._moved import BETA_1, BETA_2, Moved
from graycard.methods.splat.parallel import UNWRAPPED, run, share, task


def _floats_at(typing: Any, address: types.Type) -> Any:
    """Return the floats at an address."""
    pointer = types.CPointer(types.float32)

    def code(_context: Any, builder: ir.IRBuilder, _types: Any, given: Sequence[Any]) -> Any:
        return builder.inttoptr(given[0], ir.FloatType().as_pointer())

    return pointer(types.int64), code


def _fused(typing: Any, a: types.Type, b: types.Type, c: types.Type) -> Any:
    """Return ``a * b + c``, rounded once."""

    def code(_context: Any, builder: ir.IRBuilder, _types: Any, given: Sequence[Any]) -> Any:
        return builder.fma(*given)

    return types.float32(types.float32, types.float32, types.float32), code


floats_at: Any = intrinsic(_floats_at)
fused: Any = intrinsic(_fused)


@njit(error_model="numpy", **UNWRAPPED)
def move(values, gradient, first, second, numbers):
    """Move some floats; ``numbers`` are those of :func:`adam_all` for their parameter."""
    step, root, epsilon, keep_second = numbers[0], numbers[1], numbers[2], numbers[3]
    take_first, take_second = numbers[4], numbers[5]
    for i in range(values.size):
        g = gradient[i]
        mean = fused(take_first, g - first[i], first[i])
        square = fused(take_second * g, g, second[i] * keep_second)
        first[i], second[i] = mean, square
        values[i] -= step * mean / (np.sqrt(square) / root + epsilon)


@njit(**UNWRAPPED)
def move_part(part, parts, addresses, begins, numbers):
    """Move the floats of a part, whatever tensors they belong to."""
    start, stop = share(part, parts, begins[-1])
    for number in range(len(addresses)):
        low, high = max(start, begins[number]), min(stop, begins[number + 1])
        if low < high:
            size, at = (high - low,), 4 * (low - begins[number])
            place = addresses[number]
            move(
                carray(floats_at(place[0] + at), size), carray(floats_at(place[1] + at), size),
                carray(floats_at(place[2] + at), size), carray(floats_at(place[3] + at), size),
                numbers[number],
            )  # fmt: skip


@njit(cache=True)
def adam_all(addresses, begins, numbers):
    """Move all parameters.

    Args:
        addresses: int64 ``(P, 4)``: of values, gradients and both means of each parameter.
        begins: int64 ``(P + 1,)``: floats in all parameters before each of them.
        numbers: float32 ``(P, 6)``: of each parameter the length of its step, the root of what corrects the
            second mean, epsilon, the share that the second mean keeps, and what both take of the new.
    """
    run(task(move_part, (addresses, begins, numbers)))


def move_by_kernel(parameters: Sequence[Moved], epsilon: float) -> None:
    """Move parameters on the CPU in place; see :func:`graycard.methods.splat.fit._adam.move_all`."""
    tensors = [(one.values, one.gradient, one.first, one.second) for one in parameters]
    addresses = np.array([[tensor.data_ptr() for tensor in row] for row in tensors], np.int64)
    begins = np.cumsum([0, *(one.values.numel() for one in parameters)], dtype=np.int64)
    numbers = [
        (
            one.rate / (1 - BETA_1**one.steps), (1 - BETA_2**one.steps) ** 0.5, epsilon,
            BETA_2, 1 - BETA_1, 1 - BETA_2,
        )
        for one in parameters
    ]  # fmt: skip
    adam_all(addresses, begins, np.array(numbers, np.float32))
