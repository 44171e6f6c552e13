# SPDX-License-Identifier: Apache-2.0
"""Round lengths, for the bar of a plan and the steps of its scale of heights."""

import pytest

from graycard.reports.plan._marks import round_length


@pytest.mark.parametrize(
    ("length", "expected"),
    [(1.0, 1.0), (1.99, 1.0), (2.0, 2.0), (4.99, 2.0), (5.0, 5.0), (9.9, 5.0), (10.0, 10.0), (0.037, 0.02)],
)
def test_a_round_length_is_the_longest_that_fits(length: float, expected: float):
    assert round_length(length) == pytest.approx(expected, rel=1e-12)


def test_a_length_a_rounding_error_short_of_a_round_one_is_that_one():
    assert round_length(0.3 - 0.1) == pytest.approx(0.2, rel=1e-12)
