# SPDX-License-Identifier: Apache-2.0
"""Filters by matrix products, against those of scipy."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.ndimage import correlate1d

from graycard.eval.measures._filters import along_columns, along_rows, separable


@settings(max_examples=40, deadline=None)
@given(
    size=st.tuples(st.integers(1, 100), st.integers(1, 100)),
    reaches=st.tuples(st.integers(0, 12), st.integers(0, 12)),
    seed=st.integers(0, 10_000),
)
def test_it_is_one_filter_after_the_other(size: tuple[int, int], reaches: tuple[int, int], seed: int) -> None:
    rng = np.random.default_rng(seed)
    image = rng.normal(size=size)
    down, across = (rng.normal(size=2 * reach + 1) for reach in reaches)
    expected = correlate1d(correlate1d(image, down, 0, mode="nearest"), across, 1, mode="nearest")
    np.testing.assert_allclose(separable(image, down, across), expected, rtol=0, atol=1e-11)


def test_a_point_shows_the_filter_turned_round() -> None:
    image, weights = np.zeros((5, 70)), np.array([1.0, 2, 4])
    image[2, 40] = 1
    assert along_rows(image, weights)[2, 39:42].tolist() == [4, 2, 1]
    assert along_columns(image, weights)[1:4, 40].tolist() == [4, 2, 1]


def test_what_lies_beyond_the_reach_changes_nothing_not_even_a_digit() -> None:
    rng = np.random.default_rng(4)
    image, weights = rng.random((70, 70)), rng.random(5)
    changed = image.copy()
    changed[:, 40:] = 1e6
    changed[50:] = 1e6
    same = separable(changed, weights, weights)[:48, :38]
    assert np.array_equal(same, separable(image, weights, weights)[:48, :38])


def test_a_filter_has_a_middle() -> None:
    with pytest.raises(ValueError, match="expected an odd number of weights, got 4"):
        along_rows(np.ones((3, 3)), np.ones(4))
