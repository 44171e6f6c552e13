# SPDX-License-Identifier: Apache-2.0
"""Looks after each new scene: the chance that any is wrong stays bounded."""

import numpy as np
import pytest

from effect_shapes import SHAPES
from graycard.eval.statistics import level_up_to, p_after_each, sequential_level, signed_rank_p
from sequential_trials import BEYOND, by_constant_level, errors, rivals


def test_p_is_that_of_the_exact_test_after_each_value() -> None:
    samples = np.random.default_rng(0).normal(size=(3, 14))
    found = p_after_each(samples)
    expected = [[signed_rank_p(row[: n + 1]) for n in range(14)] for row in samples]
    assert found == pytest.approx(np.array(expected))


def test_one_look_is_the_plain_test() -> None:
    """For eight scenes only one p lies between 3.9 and 5.4 %: no simulation can miss it.

    Of an error of 6 % one is kept for skew. Of 5 % the next lesser p is left, 2.3 %.
    """
    assert sequential_level([8], 0.06) == 1 - 2 * 5 / 2**8
    assert sequential_level([8]) == 1 - 2 * 3 / 2**8


def test_more_looks_ask_for_more() -> None:
    levels = [sequential_level(range(8, last)) for last in (9, 13, 25, 41)]
    assert levels == sorted(levels)
    assert level_up_to(40) >= sequential_level(range(8, 41)) >= sequential_level(range(8, 41, 4))
    assert level_up_to(40) == level_up_to(40)
    assert 0.99 < level_up_to(40) < 0.995


@pytest.mark.parametrize(("most", "level", "fewest"), [(12, 98.44, 7), (24, 99.06, 8), (40, 99.33, 9)])
def test_levels_are_those_of_the_docs(most: int, level: float, fewest: int) -> None:
    found = level_up_to(most)
    assert round(100 * found, 2) == level
    assert 2.0 ** (1 - fewest) <= 1 - found < 2.0 ** (2 - fewest)


@pytest.mark.parametrize(
    ("looks", "error", "words"),
    [
        ([], 0.05, "expected numbers of scenes from 1 up that rise, got []"),
        ([0, 3], 0.05, "that rise, got [0, 3]"),
        ([8, 8], 0.05, "that rise, got [8, 8]"),
        ([8], 0.0, "expected an error between 0.02 and 1, got 0"),
        ([3, 5], 0.05, "expected enough scenes for a p below 0.05, got 5"),
    ],
)
def test_looks_that_are_none(looks: list[int], error: float, words: str) -> None:
    with pytest.raises(ValueError, match=words.replace("[", r"\[")):
        sequential_level(looks, error)


def test_forty_looks_are_wrong_in_five_percent_at_most() -> None:
    """Two standard errors of so many samples are 0.3 %."""
    found = errors(range(8, 48), 20_000)
    assert set(found) == set(SHAPES)
    assert max(found.values()) < 0.053
    assert min(found.values()) > 0.03, "nothing is given away either"


def test_skewed_effects_are_bounded_closely() -> None:
    """One standard error of so many samples is 0.05 %. Twice as much skew is beyond the bound, as is said."""
    skewed = {name: SHAPES[name] for name in ("exponential", "lognormal")}
    found = errors(range(8, 48), 200_000, shapes=skewed)
    assert max(found.values()) <= 0.05
    assert found["exponential"] > 0.048, "the least part is kept"
    beyond = errors(range(8, 48), 100_000, shapes=BEYOND)
    assert 0.04 < beyond["lognormal, sigma 0.5"] < 0.045
    assert 0.05 < beyond["lognormal, sigma 1"] < 0.055


def test_looks_at_five_percent_each_would_be_wrong_much_more_often() -> None:
    samples = np.random.default_rng(4).normal(size=(4000, 40))
    assert (p_after_each(samples)[:, 7:] < 0.05).any(axis=1).mean() > 0.15


def test_strong_effects_are_decided_soonest_by_one_level() -> None:
    found = rivals(1.2, SHAPES["normal"], 1000)
    ours = found.pop("one level, any looks")
    assert ours.decided > 0.99
    assert all(ours.scenes < other.scenes for other in found.values())


def test_a_subset_of_scenes_is_no_more_often_wrong() -> None:
    """Claims about some families see fewer scenes at the same looks."""
    samples = np.random.default_rng(5).normal(size=(10_000, 14))
    assert 0.01 < by_constant_level(samples, range(3, 15), most=40).decided < 0.05
