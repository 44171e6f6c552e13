# SPDX-License-Identifier: Apache-2.0
"""Ties are ties: what decides a pair, whatever else stands in its table."""

import itertools
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
ORDER = {"worse": -2, "tie": 0, "too few scenes": 1, "better": 2}
"""Verdicts on a gap above 0, as it grows. With six scenes and more "too few scenes" is a gap that is no
tie."""
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
    every = [compare_pairs(table(x), True, intervals=False) for x in (values, wider)]
    chosen = [compare_against(table(x), "r1", True, intervals=False) for x in (values, wider)]
    for less, further in (every, chosen):
        assert ORDER[between(less, "r0", "r1")] <= ORDER[between(further, "r0", "r1")]


@FEW
@hypothesis.given(SEEDS, st.integers(2, 9), st.integers(6, 14), st.randoms())
def test_verdicts_depend_neither_on_the_order_of_rows_nor_on_that_of_a_pair(seed, rows, scenes, random):
    """Rows are drawn so that some are told apart; each number has the same bits in any order."""
    rowed = table(drawn(seed, rows, scenes))
    mixed = random.sample(rowed, len(rowed))
    found, again = (compare_pairs(x, True, intervals=False) for x in (rowed, mixed))
    numbers = {
        frozenset((p.first, p.second)): (p.p_mean, p.p_mean_corrected, p.p_rank, p.error) for p in found
    }
    for pair in again:
        assert numbers[frozenset((pair.first, pair.second))] == (
            pair.p_mean, pair.p_mean_corrected, pair.p_rank, pair.error,
        )  # fmt: skip
        assert between(found, pair.first, pair.second) == pair.verdict


@FEW
@hypothesis.given(SEEDS, st.integers(6, 14), st.integers(0, 72), st.floats(10.0, 1e3))
def test_ten_standard_errors_from_a_chosen_row_are_decided_among_74_rows(seed, scenes, others, errors):
    two = ten_errors_apart(seed, scenes, errors)
    rows = [*table(two), *(candidate(f"x{i}", x) for i, x in enumerate(drawn(seed, others, scenes)))]
    assert between(compare_against(rows, "r0", True, intervals=False), "r1", "r0") == "better"


@FEW
@hypothesis.given(SEEDS, st.integers(6, 14), st.integers(0, 70), st.floats(10.0, 30.0))
def test_no_number_of_rows_makes_ten_standard_errors_a_tie(seed, scenes, others, errors):
    two = ten_errors_apart(seed, scenes, errors)
    rows = [*table(two), *(candidate(f"x{i}", x) for i, x in enumerate(drawn(seed, others, scenes)))]
    every = compare_pairs(rows, True, intervals=False)
    for found in (every, compare_against(rows, "r0", True, intervals=False)):
        assert between(found, "r1", "r0") in ("too few scenes", "better")


def test_a_thousand_rows_make_no_tie_of_ten_standard_errors():
    rows = [*table(ten_errors_apart(1, 6)), *table(drawn(1, 1000, 6))[2:]]
    found = compare_against(rows, "r0", True, intervals=False)
    (pair,) = [p for p in found if p.first == "r1"]
    assert (pair.verdict, pair.p_mean_corrected) == ("too few scenes", pytest.approx(0.63, abs=0.01))


def test_a_gap_just_below_ten_standard_errors_may_be_a_tie():
    """Among 60 rows on six scenes chance makes it, and only ten are said not to be one."""
    for errors, verdict in ((9.99, "tie"), (10.0, "too few scenes")):
        rows = [*table(ten_errors_apart(1, 6, errors)), *table(drawn(1, 60, 6))[2:]]
        assert between(compare_pairs(rows, True, intervals=False), "r1", "r0") == verdict


@pytest.mark.parametrize(("rows", "verdict"), [(2, "better"), (25, "too few scenes")])
def test_a_gap_without_end_is_no_tie(rows: int, verdict: str):
    """Only ranks can decide it, whose p has a floor."""
    values = drawn(1, rows, 8)
    values[0] = math.inf
    assert between(compare_pairs(table(values), True, intervals=False), "r0", "r1") == verdict


@pytest.mark.parametrize(("scenes", "rows"), [(6, 12), (7, 21), (8, 34), (12, 184)])
def test_among_all_pairs_ten_standard_errors_are_decided_in_tables_of_so_many_rows(scenes: int, rows: int):
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
    expected = [4 * (1 - 0.99**10), 4 * (1 - (1 - 1e-5) ** 10), 1.0]
    assert correct(test, 10) == pytest.approx(expected)
    with pytest.raises(ValueError, match="expected 1 or more comparisons, got 0"):
        correct(test, 0)


def careful_p(column: np.ndarray) -> float:
    """Count every choice of signs, and every order of equal sizes of which the worst is taken."""
    if not column.any():
        return math.nan
    if column.sum() == 0:
        return 1.0
    turned = column * np.sign(column.sum())
    worst = sorted(turned, key=lambda x: (abs(x), x <= 0))
    ranks = np.arange(1, len(column) + 1)
    lost = ranks[np.array(worst) <= 0].sum()
    sums = [ranks[list(signs)].sum() for signs in itertools.product((False, True), repeat=len(column))]
    return min(1.0, 2 * float(np.mean(np.array(sums) <= lost)))


def test_ranks_without_equal_sizes_have_the_p_of_the_exact_test():
    samples = np.random.default_rng(2).normal(0.7, 1, (9, 50))
    found = signed_rank_ps(samples)
    for p, column in zip(found, samples.T, strict=True):
        lost = signed_rank_p(column)
        assert p in (lost, 1.0)
    assert (found < 0.05).sum() > 10
    assert signed_rank_ps(np.full((8, 1), math.inf))[0] == 2 / 2**8
    assert signed_rank_ps(np.array([[math.inf], [-math.inf], [1.0]]))[0] == 1.0


def test_the_sign_of_ranks_must_be_that_of_the_mean():
    """Eighty small losses and twenty large gains: the mean is above 0, the ranks are below."""
    gaps = np.r_[np.linspace(-0.1, -0.05, 80), np.linspace(1, 1.1, 20)]
    assert student_test(gaps[:, None]).p[0] < 0.01
    assert signed_rank_p(gaps) == pytest.approx(0.0142, abs=0.001)
    (pair,) = compare_pairs([candidate("a", gaps), candidate("b", 0 * gaps)], True)
    assert (pair.verdict, pair.p_rank) == ("tie", 1.0)


def test_the_tests_of_many_samples_are_those_of_each():
    random = np.random.default_rng(1)
    samples = np.round(random.normal(0.5, 1, (9, 40)), 1)  # with ties and zeros
    samples[:, :3] = 0.3
    samples[[0, 8], :3] = 0.0
    samples[:, 3] = 0.7
    samples[:, 4] = 0.0
    found = student_test(samples)
    for i, column in enumerate(samples.T):
        assert signed_rank_ps(samples)[i] == pytest.approx(careful_p(column), nan_ok=True)
        if i not in (3, 4):
            ratio = abs(column.mean()) / float(stats.sem(column))
            assert found.p[i] == pytest.approx(2 * float(stats.t.sf(ratio, len(column) - 1)))
            assert found.error[i] == pytest.approx(float(stats.sem(column)))
        alone = student_test(samples[:, [i]])
        assert (alone.mean[0], alone.error[0], alone.p[0]) == (found.mean[i], found.error[i], found.p[i])
    assert (found.p[3], found.error[3], found.p[4], found.error[4]) == (0.0, 0.0, 1.0, 0.0)


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


@FEW
@hypothesis.given(st.lists(st.integers(-3, 9), min_size=6, max_size=14), st.integers(1, 12))
def test_a_larger_gap_is_never_less_decided_where_sizes_are_equal(steps: list[int], more: int):
    """By mean ranks it was: the distribution of their sum is another with each tie."""
    gaps = np.array(steps, float)
    gaps += max(0.0, 0.5 - gaps.mean())
    for rows in (2, 5):
        others = drawn(1, rows - 2, len(gaps))
        scores = [np.vstack([x, 0 * x, others]) for x in (gaps, gaps + more / 4)]
        verdicts = [between(compare_pairs(table(x), True, intervals=False), "r0", "r1") for x in scores]
        assert ORDER[verdicts[0]] <= ORDER[verdicts[1]]


def test_mean_ranks_would_decide_less_as_a_gap_grows():
    """The planted fault, of ten scenes."""
    gaps = np.array([-1.0, -1.0, -1.0, 0.0, 7.0, 7.0, 9.0, 10.0, 10.0, 10.0])
    both = gaps, gaps + 0.25
    assert [signed_rank_p(x) < 0.05 for x in both] == [True, False]  # pyright: ignore[reportOptionalOperand]
    careful = [signed_rank_ps(x[:, None])[0] for x in both]
    assert careful[0] >= careful[1]


@pytest.mark.parametrize("shape", family_errors.SHAPES)
def test_tables_without_a_difference_seldom_show_one(shape: str):
    """The bound is 5 % and two standard errors of 400 tables."""
    drawn = family_errors.tables(family_errors.SHAPES[shape], np.zeros(25), 8, 400)
    found = family_errors.false_tables(family_errors.families(25), drawn)
    assert max(found.values()) <= 0.05 + 2 * math.sqrt(0.05 * 0.95 / 400)


@pytest.mark.parametrize("rows", family_errors.ROWS)
def test_rows_that_are_far_make_no_false_pair_of_others(rows: int):
    """The simulation relies on this: the worst table is that in which no row is better than another."""
    every = family_errors.all_pairs(rows)
    far = np.where(np.arange(rows) % 2, 1024.0 * np.arange(rows), 0.0)
    same = far[every.first] == far[every.second]
    draw = family_errors.SHAPES["lognormal"]
    level, apart = (next(family_errors.tables(draw, x, 12, 100)) for x in (np.zeros(rows), far))
    found, other = every.decided(level)[:, same], every.decided(apart)[:, same]
    assert (found == other).all()


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
