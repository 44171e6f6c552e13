# SPDX-License-Identifier: Apache-2.0
"""The one parallel loop: every part runs once, shares cover a range, a part that fails is heard of."""

from typing import Any

import numpy as np
import pytest
from numba import njit
from numba.core.errors import TypingError

from graycard.methods.splat.simd._parts import UNWRAPPED, run, run_in, share, task


@njit(**UNWRAPPED)
def add(part: int, parts: int, values: Any, by: Any) -> None:
    start, stop = share(part, parts, values.size)
    for at in range(start, stop):
        values[at] += by[0] + by[1][at]


@njit
def add_in(parts: int, *given: Any) -> None:
    run_in(task(add, given), parts)


@njit
def add_all(*given: Any) -> None:
    run(task(add, given))


@njit(**UNWRAPPED)
def fail(part: int, parts: int, values: Any) -> None:
    if part == 1:
        raise ValueError


@njit
def fail_in(parts: int, *given: Any) -> None:
    run_in(task(fail, given), parts)


@njit
def no_kernel(*given: Any) -> None:
    run(task(3, given))


@pytest.mark.parametrize("parts", [1, 2, 3, 20])
@pytest.mark.parametrize("count", [0, 1, 7])
def test_each_element_is_visited_once(parts: int, count: int):
    values = np.zeros(count)
    add_in(parts, values, (1.0, np.arange(float(count))))
    assert values.tolist() == [1 + n for n in range(count)]


def test_all_threads_do_the_same():
    values = np.zeros(5)
    add_all(values, (1.0, np.arange(5.0)))
    assert values.tolist() == [1, 2, 3, 4, 5]


def test_a_part_that_fails_is_an_error():
    fail_in(1, np.zeros(1))
    with pytest.raises(MemoryError, match="a part of a kernel failed, most likely for want of memory"):
        fail_in(2, np.zeros(1))


def test_only_kernels_can_be_tasks():
    with pytest.raises(TypingError, match="expected a kernel and a tuple of its arguments"):
        no_kernel(np.zeros(1))
