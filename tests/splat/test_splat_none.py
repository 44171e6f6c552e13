# SPDX-License-Identifier: Apache-2.0
"""Outputs that kernels make only for a user: the type decides, at compile time, and no Python runs."""

from typing import Any

import pytest
from numba import njit, types

from graycard.methods.splat.raster._backward import deep_for
from graycard.methods.splat.raster._blocks import either, where_given


@where_given
@njit
def doubled(value: float) -> float:
    return 2 * value


@njit
def doubled_if_given(user: Any) -> Any:
    return doubled(user)


@njit
def length_of_either(user: Any) -> int:
    return len(either(user, (1, 2), (1, 2, 3)))


def test_it_is_made_of_what_is_given():
    assert doubled_if_given(1.5) == 3.0


def test_none_is_made_of_none_and_of_no_optional_type():
    assert doubled_if_given(None) is None
    assert doubled_if_given.nopython_signatures[-1].return_type == types.none


@pytest.mark.parametrize(("user", "length"), [(7, 2), (None, 3)])
def test_either_takes_the_other_without_user(user: int | None, length: int):
    assert length_of_either(user) == len(either(user, (1, 2), (1, 2, 3))) == length


def test_python_gets_an_error_where_it_would_end_the_process():
    with pytest.raises(TypeError, match="expected a call from a kernel, got one from Python with 3"):
        deep_for(3)
