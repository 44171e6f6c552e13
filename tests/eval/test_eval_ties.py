# SPDX-License-Identifier: Apache-2.0
"""Ties are ties: what decides a pair, whatever else stands in its table."""

import math

import hypothesis
import numpy as np
import pytest
from hypothesis import strategies as st
from scipy import stats

import family_errors
from graycard.eval.statistics import (
    Candidate,
    MeanTest,
    compare_against,
    compare_pairs,
    correct,
    signed_rank_p,
    signed_rank_ps,
    student_test,
)
from graycard.records import PairDifference

SEEDS = st.integers(0, 2**32 - 1)
ORDER = {"worse": -1, "tie": 0, "better": 1}
TURNED = {"better": "worse", "worse": "better", "tie": "tie", "too few scenes": "too few scenes"}
FEW = hypothesis.settings(max_examples=60, deadline=None)


def candidate(name: str, values: np.ndarray) -> Candidate:
    return Candidate(name, True, {f"s{i:02}": float(x) for i, x in enumerate(values)})


def table(values: np.ndarray) -> list[Candidate]:
    """Rows ``r0``, ``r1``, … of scores of shape ``(rows, scenes)``."""
    return [candidate(f"r{i}", row) for i, row in enumerate(values)]


def between(pairs: tuple[PairDifference, ...], first: str, second: str) -> str:
    """Return the verdict on the first, in whichever order the pair stands."""
    found = next(p for p in pairs if {p.first, p.second} == {first, second})
    return found.verdict if found.first == first else TURNED[found.verdict]


def drawn(seed: int, rows: int, scenes: int) -> np.ndarray:
    """Scores with an effect of each scene, and rows of different levels and spreads."""
    random = np.random.default_rng(seed)
    spread, level = random.uniform(0.1, 3, (rows, 1)), random.normal(0, 2, (rows, 1))
    return random.normal(25, 3, scenes) + level + spread * random.standard_t(4, (rows, scenes))


def ten_errors_apart(seed: int, scenes: int, errors: float = 10.0) -> np.ndarray:
    """Two rows whose gap is that many of its standard errors."""
    base, noise = np.random.default_rng(seed).normal(size=(2, scenes))
    noise = (noise - noise.mean()) / noise.std(ddof=1)
    return np.stack([25 + base, 25 + base + errors / math.sqrt(scenes) + noise])


@FEW
@hypothesis.given(SEEDS, st.integers(2, 9), st.integers(6, 14), st.floats(0.0, 30.0))
def test_a_larger_gap_of_the_same_spread_is_never_less_decided(
    seed: int, rows: int, scenes: int, more: float
):
    values = drawn(seed, rows, scenes)
    values[0] += values[1].mean() - values[0].mean()
    wider = values.copy()
    values[0] += 0.4
    wider[0] += 0.4 + more
    for compare in (compare_pairs, lambda rows, up: compare_against(rows, "r1", up)):
        verdicts = [between(compare(table(x), True), "r0", "r1") for x in (values, wider)]
        assert ORDER[verdicts[0]] <= ORDER[verdicts[1]]


@FEW
@hypothesis.given(SEEDS, st.integers(2, 9), st.integers(6, 14), st.randoms())
def test_verdicts_depend_neither_on_the_order_of_rows_nor_on_that_of_a_pair(seed, rows, scenes, random):
    """Rows are drawn so that some are told apart; each number has the same bits in any order."""
    rowed = table(drawn(seed, rows, scenes))
    mixed = random.sample(rowed, len(rowed))
    found, again = compare_pairs(rowed, True), compare_pairs(mixed, True)
    numbers = {
        frozenset((p.first, p.second)): (p.p_mean, p.p_mean_corrected, p.p_rank, p.error) for p in found
    }
    for pair in again:
        assert numbers[frozenset((pair.first, pair.second))] == (
            pair.p_mean, pair.p_mean_corrected, pair.p_rank, pair.error,
        )  # fmt: skip
        assert between(found, pair.first, pair.second) == pair.verdict


@FEW
@hypothesis.given(SEEDS, st.integers(6, 14), st.integers(0, 299), st.floats(10.0, 1e3))
def test_no_number_of_rows_up_to_301_ties_ten_standard_errors_with_a_chosen_row(seed, scenes, others, errors):
    two = ten_errors_apart(seed, scenes, errors)
    rows = [*table(two), *(candidate(f"x{i}", x) for i, x in enumerate(drawn(seed, others, scenes)))]
    assert between(compare_against(rows, "r0", True), "r1", "r0") == "better"


@pytest.mark.parametrize(("scenes", "rows"), [(6, 21), (7, 36), (8, 60), (12, 300)])
def test_among_all_pairs_ten_standard_errors_are_no_tie_in_tables_of_so_many_rows(scenes: int, rows: int):
    others = drawn(1, rows - 2, scenes)
    everyone = [*table(ten_errors_apart(1, scenes)), *(candidate(f"x{i}", x) for i, x in enumerate(others))]
    assert between(compare_pairs(everyone, True, intervals=False), "r1", "r0") == "better"


@pytest.mark.parametrize("rows", [2, 25, 60, 300])
def test_fifteen_decibels_on_all_of_eight_scenes_are_no_tie(rows: int):
    """The bootstrap's p could not fall below 1.7e-4: from 25 rows on the correction made each gap a tie."""
    values = drawn(2, rows, 8)
    values[0] = values[1] - 15 + np.random.default_rng(3).normal(0, 0.5, 8)
    assert between(compare_pairs(table(values), True, intervals=False), "r0", "r1") == "worse"


def test_the_correction_is_that_of_sidak_and_of_a_margin():
    test = MeanTest(np.array([1.0, 1.0, 0.0]), np.array([0.5, 0.1, 1.0]), np.array([0.01, 1e-5, 1.0]))
    expected = [4 * (1 - 0.99**10), 1 - (1 - 1e-5) ** 10, 1.0]
    assert correct(test, 10) == pytest.approx(expected)
    with pytest.raises(ValueError, match="expected 1 or more comparisons, got 0"):
        correct(test, 0)
    assert correct(test, 10, 1.3)[1] == pytest.approx(1.3 * expected[1])
    with pytest.raises(ValueError, match="expected a margin between 1 and 4, got 5"):
        correct(test, 10, 5.0)


def test_the_tests_of_many_samples_are_those_of_each():
    random = np.random.default_rng(1)
    samples = np.round(random.normal(0.5, 1, (9, 40)), 1)  # with ties and zeros
    samples[:, :3] = 0.3
    samples[[0, 8], :3] = 0.0
    samples[:, 3] = 0.7
    samples[:, 4] = 0.0
    found = student_test(samples)
    for i, column in enumerate(samples.T):
        p = signed_rank_p(column)
        assert (np.isnan(signed_rank_ps(samples)[i]) and p is None) or signed_rank_ps(samples)[i] == p
        if i not in (3, 4):
            assert found.p[i] == pytest.approx(float(stats.ttest_1samp(column, 0).pvalue))
            assert found.error[i] == pytest.approx(float(stats.sem(column)))
        alone = student_test(samples[:, [i]])
        assert (alone.mean[0], alone.error[0], alone.p[0]) == (found.mean[i], found.error[i], found.p[i])
    assert (found.p[3], found.ratio[3], found.p[4], found.ratio[4]) == (0.0, math.inf, 1.0, 0.0)


def test_a_score_that_is_no_number_is_a_scene_that_lacks():
    values = ten_errors_apart(1, 7)
    values[0, 2] = math.nan
    (pair,) = compare_pairs(table(values), True)
    assert (pair.scenes, pair.verdict) == (6, "worse")


def test_a_chosen_row_that_a_table_lacks_has_no_comparisons():
    assert compare_against(table(drawn(1, 3, 8)), "absent", True) == ()


def test_a_chosen_row_asks_for_less_than_all_pairs():
    """A gap of seven standard errors on eight scenes, among 20 rows."""
    values = [
        *table(ten_errors_apart(1, 8, 7.0)),
        *(candidate(f"x{i}", x) for i, x in enumerate(drawn(1, 18, 8))),
    ]
    assert between(compare_pairs(values, True), "r1", "r0") == "tie"
    assert between(compare_against(values, "r0", True), "r1", "r0") == "better"


@pytest.mark.parametrize("shape", family_errors.SHAPES)
def test_tables_without_a_difference_seldom_show_one(shape: str):
    """The bound is 5 % and two standard errors of 400 tables."""
    draw, levels = family_errors.SHAPES[shape], np.zeros(25)
    for family in (family_errors.all_pairs(25), *family_errors.chosen_rows(25).values()):
        assert family_errors.false_tables(family, draw, levels, 8, 400) <= 0.05 + 2 * math.sqrt(
            0.05 * 0.95 / 400
        )


@pytest.mark.slow
def test_tables_of_each_size_and_shape_seldom_show_what_is_not_there():
    """The whole table of the docs, with fewer tables: at most 5 % and four standard errors of 1000."""
    bound = 0.05 + 4 * math.sqrt(0.05 * 0.95 / 1000)
    assert {line for line in family_errors.error_table(1000) if line[-1] > bound} == set()


def test_without_the_margin_skewed_differences_would_be_told_apart_too_often():
    """The planted fault: Student's test alone, of 12 lognormal scores and 60 rows."""
    family, draw = family_errors.all_pairs(60), family_errors.SHAPES["lognormal"]
    false = 0
    for scores in family_errors.tables(draw, np.zeros(60), 12, 300):
        gaps = (scores[:, :, family.first] - scores[:, :, family.second]).reshape(12, -1)
        p = student_test(gaps).p.reshape(scores.shape[1], -1)
        false += int((p.min(axis=1) * len(family.first) < 0.05).sum())
    assert false / 300 > 0.05
