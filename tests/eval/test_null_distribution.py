# SPDX-License-Identifier: Apache-2.0
"""The one distribution of the signed-rank statistic: by counting, by scipy, and of more than 1,023 values."""

from itertools import product
from typing import Any

import numpy as np
import pytest
from scipy import stats

from graycard.eval.statistics import locate, rank_limit, signed_rank_p, signed_rank_ps
from graycard.eval.statistics._null_distribution import rank_chances, rank_tail, two_sided

MANY = 1100
"""More signs than a double can count the ways of: 2^1024 overflows."""


@pytest.mark.parametrize("ranks", [(1, 2, 3, 4), (3, 1, 4, 2), (2, 2, 5, 5, 7), (1,), ()])
def test_chances_are_those_of_all_signs(ranks: tuple[int, ...]) -> None:
    """Chances of so few are exact, in any order and with ties."""
    found = rank_chances(ranks)
    counted = np.zeros(sum(ranks) + 1)
    for signs in product((0, 1), repeat=len(ranks)):
        counted[int(np.dot(signs, ranks))] += 0.5 ** len(ranks)
    assert found.tolist() == counted.tolist()


def test_the_tail_is_kept_and_cannot_be_spoiled() -> None:
    assert rank_tail(12)[-1] == 1
    with pytest.raises(ValueError, match="read-only"):
        rank_tail(12)[0] = 0.5


@pytest.mark.parametrize("count", [1, 5, 6, 20, 60, MANY])
def test_p_of_every_statistic_is_symmetric_and_at_most_one(count: int) -> None:
    p = two_sided(count)
    assert np.array_equal(p, p[::-1])
    assert np.isfinite(p).all()
    assert p.max() == pytest.approx(1, abs=1e-2 if count > 5 else 1)
    assert (np.diff(p[: len(p) // 2]) >= 0).all()


def test_more_than_a_thousand_values_have_a_p_and_an_interval() -> None:
    """By scipy's exact test; ends by the normal approximation of the limit, to half a percent."""
    values = np.random.default_rng(0).normal(0.07, 1, MANY)
    found: Any = stats.wilcoxon(values, method="exact")
    expected = float(found.pvalue)
    assert 0.001 < expected < 0.9
    assert signed_rank_p(values) == pytest.approx(expected, rel=1e-9)
    assert signed_rank_ps(values[:, None]).item() == pytest.approx(expected, rel=1e-9)
    middle = MANY * (MANY + 1) / 4
    sd = np.sqrt(MANY * (MANY + 1) * (2 * MANY + 1) / 24)
    assert rank_limit(MANY, 0.95) == pytest.approx(middle - stats.norm.isf(0.025) * sd, rel=5e-3)
    low, high = locate(values).interval
    assert -np.inf < low < locate(values).estimate < high < np.inf
    assert high - low == pytest.approx(2 * 1.96 / np.sqrt(MANY * 3 / np.pi), rel=0.1)


def test_p_and_interval_agree_on_every_sample() -> None:
    """0 is outside of the interval exactly where p is at most 5 %."""
    samples = np.random.default_rng(1).normal(0.5, 1, (15, 400))
    intervals = [locate(sample).interval for sample in samples.T]
    outside = [low > 0 or high < 0 for low, high in intervals]
    assert outside == [(signed_rank_p(sample) or 0) <= 0.05 for sample in samples.T]
    assert 50 < sum(outside) < 350
