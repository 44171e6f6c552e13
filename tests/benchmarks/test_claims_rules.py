# SPDX-License-Identifier: Apache-2.0
"""Verdicts from intervals that can be worked out by hand: one word each, and how checks make a claim."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from claims_by_hand import (
    LEVELS,
    SPREAD,
    against,
    check_of,
    course,
    estimate_of,
    interval_of,
    judged,
    led_by,
    run_with,
    values,
    verdict,
)
from graycard.benchmarks.claims import Check
from graycard.eval.statistics import mean_interval, signed_rank_p
from runs_by_hand import run_of

STATED = check_of(paper=5.4)
"""Its band is 2.7 to 10.8 dB."""
MARGIN = check_of(negligible=0.5)
"""No size, but what is within 0.5 dB counts as nothing."""


@pytest.mark.parametrize(
    ("lead", "paper", "expected"),
    [  # the interval is 0.3 wide to either side of the lead
        (5.0, 5.4, "reproduced"),
        (5.0, None, "reproduced"),
        (2.41, 5.4, "reproduced"),  # up to 2.71: some of it is in the band
        (2.39, 5.4, "smaller than claimed"),  # up to 2.69
        (11.09, 5.4, "reproduced"),  # from 10.79
        (11.11, 5.4, "larger than claimed"),  # from 10.81
        (0.31, None, "reproduced"),  # from 0.01
        (0.29, None, "undecided"),  # from -0.01
        (0.1, 5.4, "smaller than claimed"),
        (0.0, None, "undecided"),
        (-0.1, 5.4, "smaller than claimed"),  # whatever the sign
        (-0.29, 5.4, "smaller than claimed"),  # up to 0.01
        (-0.29, None, "undecided"),
        (-0.31, 5.4, "contradicted"),  # up to -0.01
        (-1.0, None, "contradicted"),
    ],
)
def test_better(lead: float, paper: float | None, expected: str) -> None:
    found = judged(against(lead), check_of(paper=paper))
    assert found.verdict == found.checks[0].verdict == expected
    assert found.checks[0].interval == pytest.approx((lead - 0.3, lead + 0.3))


def test_an_interval_that_meets_the_band_but_not_all_of_the_claimed_sense_is_undecided() -> None:
    """From -2 to 4 dB, by 2.7 to 10.8 dB and 0."""
    assert verdict(against(1.0, SPREAD * 10), STATED) == "undecided"


@pytest.mark.parametrize(
    ("lead", "expected"),
    [
        (0.1, "no effect"),  # -0.2 to 0.4
        (0.19, "no effect"),
        (-0.19, "no effect"),
        (0.21, "undecided"),  # -0.09 to 0.51
        (0.31, "reproduced"),  # 0.01 to 0.61
        (-0.21, "smaller than claimed"),  # -0.51 to 0.09: no room for more than the margin
        (-0.29, "smaller than claimed"),
        (-0.31, "contradicted"),  # -0.61 to -0.01
    ],
)
def test_a_claim_of_no_size_claims_more_than_its_margin(lead: float, expected: str) -> None:
    assert verdict(against(lead), MARGIN) == expected


@pytest.mark.parametrize(
    ("lead", "negligible", "expected"),
    [
        (1.0, 1.31, "no effect"),  # 0.7 to 1.3, though the sign is certain
        (-1.0, 1.31, "no effect"),
        (1.0, 1.29, "reproduced"),  # part of the interval is beyond
        (-1.0, 1.29, "contradicted"),
    ],
)
def test_what_nobody_would_care_for_is_no_difference(lead: float, negligible: float, expected: str) -> None:
    found = judged(against(lead), check_of(negligible=negligible))
    assert found.verdict == expected
    span = f"-{negligible:g} to {negligible:g} dB"
    assert f"the whole interval is above 0 dB, not all of it in {span}" in found.checks[0].rule
    assert (f"{span} counts as no difference" in found.text) == (expected == "no effect")


@pytest.mark.parametrize(
    ("lead", "expected"), [(0.1, "no effect"), (0.31, "smaller than claimed"), (2.41, "reproduced")]
)
def test_a_margin_beside_a_size(lead: float, expected: str) -> None:
    assert verdict(against(lead), replace(MARGIN, paper=5.4)) == expected


def test_a_ratio_may_be_negligible() -> None:
    rows = {"mine": {"psnr": [1.01 + 0.001 * i for i in range(8)]}, "theirs": {"psnr": [1.0] * 8}}
    check = check_of(scale="ratio", negligible=0.1)
    found = judged(run_of(rows), check)
    assert found.verdict == "no effect"
    assert "0.9 to 1.1× counts as no difference" in found.text
    assert verdict(run_of(rows), replace(check, negligible=0.01)) == "reproduced"


@pytest.mark.parametrize(
    ("loss", "expected"),
    [(-1.0, "reproduced"), (-0.29, "undecided"), (0.1, "undecided"), (1.0, "contradicted")],
)
def test_lower_is_the_claimed_sense(loss: float, expected: str) -> None:
    found = judged(against(loss), check_of(expects="lower"))
    assert found.verdict == expected
    assert found.checks[0].estimate == pytest.approx(-loss)
    assert found.checks[0].effect_of == "theirs − mine"


@pytest.mark.parametrize(
    ("accepted", "expected"),
    [
        ((4.0, math.inf), "reproduced"),
        ((5.29, math.inf), "reproduced"),
        ((5.31, math.inf), "smaller than claimed"),
        ((6.0, math.inf), "smaller than claimed"),
        ((1, 2), "larger than claimed"),
        ((-math.inf, 4.69), "larger than claimed"),
        ((-math.inf, 4.71), "reproduced"),
    ],
)
def test_a_size_may_be_said_otherwise(accepted: tuple[float, float], expected: str) -> None:
    assert verdict(against(5.0), check_of(paper=9.0, accepted=accepted)) == expected


@pytest.mark.parametrize(
    ("lead", "accepted", "expected"),
    [
        (0.0, (-0.5, 0.5), "reproduced"),
        (0.0, (-0.29, 0.29), "undecided"),  # the interval is wider: nothing says that it is so small
        (0.0, (-0.31, 0.31), "reproduced"),
        (0.5, (-0.5, 0.5), "undecided"),
        (0.79, (-0.5, 0.5), "undecided"),
        (0.81, (-0.5, 0.5), "contradicted"),
        (-0.81, (-0.5, 0.5), "contradicted"),
        (-2.0, (-math.inf, 0.5), "reproduced"),
        (1.0, (-math.inf, 0.5), "contradicted"),
    ],
)
def test_within(lead: float, accepted: tuple[float, float], expected: str) -> None:
    assert verdict(against(lead), check_of("within", accepted=accepted)) == expected


def test_the_numbers_are_those_of_the_definitions() -> None:
    effects = 5.0 + SPREAD * np.array([1, 1, 1, 5, 1, 1, 1, 1])
    found = judged(against(5.0, effects - 5), STATED).checks[0]
    assert list(found.scenes.values()) == pytest.approx(effects)
    assert list(found.scenes) == [f"s{i}" for i in range(8)]
    assert found.estimate == pytest.approx(estimate_of(effects))
    assert found.estimate != pytest.approx(effects.mean(), abs=0.05)
    assert found.interval == pytest.approx(interval_of(effects))
    assert found.p_rank == pytest.approx(stats.wilcoxon(effects, method="exact").pvalue)  # pyright: ignore
    assert found.accepted == pytest.approx((2.7, 10.8))
    assert [(r.row, r.value) for r in found.rows] == [
        ("mine", pytest.approx(33.5 + effects.mean())), ("theirs", pytest.approx(33.5)),
    ]  # fmt: skip


@pytest.mark.parametrize("count", [6, 7, 8, 11])
@pytest.mark.parametrize("level", [0.9, 0.95])
def test_the_interval_holds_what_the_exact_test_does_not_refuse(count: int, level: float) -> None:
    """By scipy: outside of either end p is at most 1 less the level, inside of both it is more."""
    effects = np.random.default_rng(count).lognormal(0, 0.8, count)
    found = judged(led_by(list(effects)), check_of(), level=level).checks[0].interval
    assert found is not None
    assert found == pytest.approx(interval_of(effects, level))
    low, high = found
    tiny = 1e-6
    for outside, inside in ((low - tiny, low + tiny), (high + tiny, high - tiny)):
        p = [
            float(stats.wilcoxon(effects - place, method="exact").pvalue)  # pyright: ignore
            for place in (outside, inside)
        ]
        assert p[0] <= 1 - level < p[1]


def test_five_scenes_of_one_sign_are_too_few() -> None:
    """Five scenes have p 0.0625 at best: no interval at 95 %, and what is needed is said. Six have one."""
    lead = [1.0, 1.1, 1.2, 0.9, 0.8]
    found = judged(led_by(lead), check_of())
    check = found.checks[0]
    assert (found.verdict, check.p_rank, check.interval) == ("undecided", 0.0625, (-math.inf, math.inf))
    assert check.estimate == pytest.approx(1.0)
    assert "an interval at 95 % needs 6 scenes" in check.reason
    assert verdict(led_by([-value for value in lead]), check_of()) == "undecided"
    assert verdict(led_by(lead), check_of("within", accepted=(0.0, 2.0))) == "undecided"
    six = judged(led_by([*lead, 1.3]), check_of())
    assert (six.verdict, six.checks[0].interval) == ("reproduced", (0.8, 1.3))
    assert "needs" not in six.checks[0].reason


def test_scenes_without_a_sign_are_scenes() -> None:
    """Three of eight are equal: of their six Walsh averages of 0 the fourth from below is one."""
    few = led_by([1.0, 1.1, 1.2, 0.9, 0.8, 0.0, 0.0, 0.0])
    found = judged(few, check_of()).checks[0]
    assert found.interval is not None
    assert (found.verdict, found.interval[0]) == ("undecided", 0.0)
    assert found.p_rank == 28 / 256  # twice the 14 of 256 signs whose ranks sum to 6 or less


def test_a_mean_that_few_scenes_make_is_not_certain() -> None:
    """The interval of the mean leaves out 0, that of ranks does not: three of eight scenes say otherwise."""
    skewed = [2.68, 1.76, 2.32, -0.25, -0.23, 0.6, 1.22, -0.25]
    around_mean = mean_interval(skewed)
    assert around_mean is not None
    assert around_mean[0] > 0
    found = judged(led_by(skewed), check_of()).checks[0]
    assert found.interval is not None
    assert found.p_rank == 28 / 256  # six of the 36 means of two scenes are below 0, none is 0
    assert found.interval[0] < 0 < found.interval[1]
    assert found.verdict == "undecided"
    assert verdict(led_by([-e for e in skewed]), check_of()) == "undecided"


def test_few_scenes_of_great_gain_are_no_support() -> None:
    """44 of 50 scenes say the opposite: the mean is as claimed, the centre is not."""
    lead = [-0.01 - 1e-4 * i for i in range(44)] + [10.0 + i for i in range(6)]
    assert np.mean(lead) > 1
    found = judged(led_by(lead), check_of()).checks[0]
    assert found.estimate is not None
    assert found.estimate == pytest.approx(estimate_of(lead))
    assert found.estimate < 0
    assert found.interval is not None
    assert found.interval[1] < 0
    assert found.p_rank == pytest.approx(signed_rank_p(lead))
    assert found.verdict == "contradicted"


def test_ties_support_no_lead_and_all_equality() -> None:
    run = run_with(mine=values(0), theirs=values(0))
    assert verdict(run, check_of()) == "undecided"  # from 0 to 0, but nobody said what counts as nothing
    assert verdict(run, check_of(paper=5.4)) == "smaller than claimed"
    assert verdict(run, check_of(negligible=0.1)) == "no effect"
    assert verdict(run, check_of("within", accepted=(-0.1, 0.1))) == "reproduced"


def test_a_level_passes_through() -> None:
    """At 99 % the ends are the outermost scenes, 0.4 from the lead; eight scenes have none at 99.5 %."""
    run = against(0.35)
    assert verdict(run, check_of()) == "reproduced"
    finer = judged(run, check_of(), level=0.99)
    assert finer.checks[0].interval == pytest.approx((-0.05, 0.75))
    assert finer.verdict == "undecided"
    none = judged(against(5.0), check_of(), level=0.995)
    assert (none.verdict, none.checks[0].interval) == ("undecided", (-math.inf, math.inf))
    assert "an interval at 99.5 % needs 9 scenes" in none.text


@pytest.mark.parametrize(
    ("means", "expected"),
    [
        ((0, -1, -2), "reproduced"),
        ((0, -0.1, -2), "reproduced"),
        ((0, 0.19, -2), "undecided"),  # the first step may go as claimed
        ((0, 0.21, -2), "contradicted"),  # it certainly does not
        ((0, -3, -2), "contradicted"),
        ((0, 0.05, 0), "undecided"),
        ((0, 1, 2), "contradicted"),
    ],
)
def test_monotone(means: tuple[float, ...], expected: str) -> None:
    """The change of the line is the last less the first, ± 0.3; both steps are ± 0.2, at 98.75 % each."""
    check = check_of("monotone", LEVELS, expects="lower")
    assert interval_of(SPREAD / 2, 1 - 0.0375 / 3) == pytest.approx((-0.2, 0.2))
    found = judged(course(*means), check).checks[0]
    assert found.verdict == expected
    assert found.estimate == pytest.approx(means[0] - means[2])
    assert found.interval == pytest.approx((means[0] - means[2] - 0.3, means[0] - means[2] + 0.3))
    assert verdict(course(*(-m for m in means)), replace(check, expects="higher")) == expected


def test_a_step_that_certainly_goes_back_contradicts_a_size_that_is_met() -> None:
    check = check_of("monotone", LEVELS, paper=2.0)
    assert verdict(course(0, 1, 2), check) == "reproduced"
    assert verdict(course(0, 1, 5), check) == "larger than claimed"
    assert verdict(course(0, 0.2, 0.5), check) == "smaller than claimed"
    assert verdict(course(0, 3, 2), check) == "contradicted"


HEIGHT = {
    "contradicted": 0, "no effect": 1, "smaller than claimed": 1, "undecided": 2, "reproduced": 3,
    "larger than claimed": 4,
}  # fmt: skip
"""Rank of each word, from the least favourable."""


@pytest.mark.parametrize(
    "check",
    [
        check_of(),
        check_of(negligible=1.0),
        check_of(paper=2.0),
        check_of(paper=2.0, negligible=0.5),
        check_of(accepted=(-1.0, 1.0), negligible=0.5),
        check_of(rows=("mine",), against=1.0),
    ],
    ids=["plain", "margin", "size", "both", "odd band", "one row"],
)
def test_a_more_favourable_scene_never_makes_a_verdict_less_so(check: Check) -> None:
    """Values are whole numbers, so that ties and ends on a bound are met; nothing is fitted, so that nothing
    is held back."""
    random = np.random.default_rng(30)
    for _ in range(150):
        effects = random.choice([0, 1, 2, 5, -1], 8, p=random.dirichlet([0.5] * 5)) + random.integers(-4, 2)
        better = effects.copy()
        better[random.integers(8)] += random.integers(1, 4)
        before, after = (verdict(led_by([*map(float, e)]), check) for e in (effects, better))
        assert HEIGHT[after] >= HEIGHT[before], f"{effects} is {before}, {better} is {after}"


@pytest.mark.parametrize("negligible", [0.0, 0.1])
@pytest.mark.parametrize("paper", [None, 2.0])
def test_nor_does_it_where_scenes_are_equal(negligible: float, paper: float | None) -> None:
    """From one scene that is worse, over none that differs, to more and more that are better."""
    check = check_of(paper=paper, negligible=negligible)
    ladder = [[-1.0] * n + [0.0] * (8 - n) for n in range(8, 0, -1)]
    ladder += [[1.0] * n + [0.0] * (8 - n) for n in range(9)]
    words = [verdict(led_by(effects), check) for effects in ladder]
    heights = [HEIGHT[word] for word in words]
    assert heights == sorted(heights), words
