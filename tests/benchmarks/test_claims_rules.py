# SPDX-License-Identifier: Apache-2.0
"""Verdicts from intervals that can be worked out by hand: one word each, and how checks make a claim."""

import math
import re
from collections.abc import Mapping
from dataclasses import replace
from typing import Any, get_args

import numpy as np
import pytest
from scipy import stats

from claims_by_hand import (
    SPREAD,
    against,
    check_of,
    cut_off,
    estimate_of,
    fitted,
    interval_of,
    judged,
    led_by,
    run_with,
    values,
    verdict,
)
from graycard.benchmarks.claims import RULES, Check
from graycard.eval.statistics import mean_interval, signed_rank_p
from graycard.records import ClaimVerdict
from runs_by_hand import run_of

OF_PAPERS = {
    "reproduced", "larger than claimed", "smaller than claimed", "no effect", "contradicted",
    "undecided", "not testable here",
}  # fmt: skip
OWN = {"holds", "does not hold", "open", "not testable here"}
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
    """Of five p is 0.0625 at best: no interval at 95 %, and what is needed is said. Six have one."""
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
    assert found.p_rank == 0.0625  # of the five that have a sign


def test_a_mean_that_few_scenes_make_is_not_certain() -> None:
    """The interval of the mean leaves out 0, that of ranks does not: three of eight scenes have the other sign."""
    skewed = [2.68, 1.76, 2.32, -0.25, -0.23, 0.6, 1.22, -0.25]
    around_mean = mean_interval(skewed)
    assert around_mean is not None
    assert around_mean[0] > 0
    found = judged(led_by(skewed), check_of()).checks[0]
    assert found.interval is not None
    assert found.p_rank == pytest.approx(0.102, abs=5e-4)
    assert found.interval[0] < 0 < found.interval[1]
    assert found.verdict == "undecided"
    assert verdict(led_by([-e for e in skewed]), check_of()) == "undecided"


def test_few_scenes_of_great_gain_are_no_support() -> None:
    """44 of 50 scenes say the opposite: the mean is as claimed, the centre is not."""
    lead = [-0.01 - 1e-4 * i for i in range(44)] + [10.0 + i for i in range(6)]
    assert np.mean(lead) > 1
    found = judged(led_by(lead), check_of()).checks[0]
    assert found.estimate == pytest.approx(estimate_of(lead))
    assert found.estimate < 0
    assert found.interval is not None
    assert found.interval[1] < 0
    assert found.p_rank == pytest.approx(signed_rank_p(lead))
    assert found.verdict == "contradicted"


def test_ties_support_no_lead_and_all_equality() -> None:
    run = run_with(mine=values(0), theirs=values(0))
    assert verdict(run, check_of()) == "no effect"  # from 0 to 0: as certain as can be
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


GOOD, WEAK, OPEN, BAD = (check_of(paper=p, rows=r) for p, r in (
    (5.0, ("mine", "theirs")),
    (50.0, ("mine", "theirs")),
    (None, ("gray", "same")),
    (None, ("theirs", "mine")),
))  # fmt: skip
GONE = check_of(rows=("mine", "nobody"))
TWELVE = np.linspace(-0.5, 0.5, 12)
SHARED = re.findall(r"100 % less ([\d.]+) % over their number", RULES["several checks"])
"""Percent of error that several checks share, as the rule says."""


def strict(checks: int) -> float:
    """Return the level of a word that one of several checks is enough for."""
    return 1 - float(SHARED[0]) / 100 / checks


@pytest.mark.parametrize(
    ("checks", "by_all", "by_any"),
    [
        ((GOOD, GOOD), "reproduced", "reproduced"),
        ((GOOD, WEAK), "smaller than claimed", "reproduced"),
        ((GOOD, OPEN), "undecided", "reproduced"),
        ((GOOD, GONE), "not testable here", "reproduced"),
        ((GOOD, WEAK, OPEN), "smaller than claimed", "reproduced"),
        ((WEAK, OPEN, GONE), "smaller than claimed", "undecided"),
        ((OPEN, GONE), "not testable here", "undecided"),
        ((OPEN, GONE, BAD), "contradicted", "undecided"),
        ((WEAK, BAD), "contradicted", "smaller than claimed"),
        ((GOOD, replace(BAD, decides=False)), "reproduced", "reproduced"),
    ],
)
def test_a_claim_follows_from_its_checks(checks: tuple[Check, ...], by_all: str, by_any: str) -> None:
    run = run_with(mine=values(5), theirs=values(0, 0 * SPREAD), same=values(-9, -SPREAD))
    named = [replace(check, id=str(number)) for number, check in enumerate(checks)]
    assert verdict(run, *named, verdict_by="all") == by_all
    assert verdict(run, *named, verdict_by="any") == by_any


def run_of_twelve(lead: float) -> Any:
    return led_by(list(lead + TWELVE))


def copies(check: Check, count: int) -> list[Check]:
    return [replace(check, id=str(number)) for number in range(count)]


@pytest.mark.parametrize("count", [2, 3, 5])
def test_a_word_that_one_check_is_enough_for_is_asked_at_a_stricter_level(count: int) -> None:
    """Of ``all``, one check contradicts: at a level of the rule. All have to support, at 95 %."""
    usual_end, strict_end = (interval_of(TWELVE, level)[1] for level in (0.95, strict(count)))
    assert cut_off(12, strict(count)) < cut_off(12, 0.95)
    lead = (usual_end + strict_end) / 2
    assert verdict(run_of_twelve(-lead), check_of()) == "contradicted"
    assert verdict(run_of_twelve(-lead), *copies(check_of(), count)) == "undecided"
    assert verdict(run_of_twelve(-strict_end - 0.01), *copies(check_of(), count)) == "contradicted"
    assert verdict(run_of_twelve(lead), *copies(check_of(), count)) == "reproduced"
    assert verdict(run_of_twelve(lead), *copies(check_of(), count), verdict_by="any") == "undecided"
    assert verdict(run_of_twelve(-lead), *copies(check_of(), count), verdict_by="any") == "contradicted"


def test_several_checks_share_an_error_of_five_percent_at_most() -> None:
    """Each end errs with half of it: of any number of checks the sum stays below that of one, both ends taken."""
    assert len(SHARED) == 1
    assert 0 < float(SHARED[0]) <= 5


def test_told_checks_make_no_level_stricter() -> None:
    usual_end, strict_end = (interval_of(TWELVE, level)[1] for level in (0.95, strict(4)))
    one, *told = copies(check_of(), 4)
    run = run_of_twelve(-(usual_end + strict_end) / 2)
    assert verdict(run, one, *(replace(check, decides=False) for check in told)) == "contradicted"


@pytest.mark.parametrize("count", [2, 3, 5])
def test_smallness_and_nothing_are_asked_at_the_stricter_level_too(count: int) -> None:
    usual_end, strict_end = (interval_of(TWELVE, level)[1] for level in (0.95, strict(count)))
    between = (usual_end + strict_end) / 2
    small = check_of(accepted=(5.0, 9.0))
    assert verdict(run_of_twelve(5 - between), small) == "smaller than claimed"
    assert verdict(run_of_twelve(5 - between), *copies(small, count)) == "undecided"
    assert verdict(run_of_twelve(5 - strict_end - 0.01), *copies(small, count)) == "smaller than claimed"
    nothing = check_of(negligible=between)
    assert verdict(run_of_twelve(0.0), nothing) == "no effect"
    assert verdict(run_of_twelve(0.0), *copies(nothing, count)) == "undecided"


ANSWERS: Mapping[str, tuple[float, Check, str]] = {
    "reproduced": (5.0, STATED, "holds"),
    "larger than claimed": (15.0, STATED, "holds"),
    "smaller than claimed": (1.0, STATED, "does not hold"),
    "no effect": (0.0, MARGIN, "does not hold"),
    "contradicted": (-5.0, STATED, "does not hold"),
    "undecided": (0.0, check_of(), "open"),
    "not testable here": (5.0, GONE, "not testable here"),
}


@pytest.mark.parametrize("word", ANSWERS)
def test_questions_of_graycards_own_have_words_of_their_own(word: str) -> None:
    lead, check, own = ANSWERS[word]
    told = replace(check, id="told", decides=False)
    paper = judged(against(lead), check, told)
    assert (paper.asked_by, paper.verdict, {c.verdict for c in paper.checks}) == ("paper", word, {word})
    asked = judged(against(lead), check, told, asked_by="graycard")
    assert (asked.asked_by, asked.verdict, {c.verdict for c in asked.checks}) == ("graycard", own, {own})


def test_there_are_seven_words_of_papers_and_four_of_our_own() -> None:
    assert ANSWERS.keys() == OF_PAPERS
    assert {own for _, _, own in ANSWERS.values()} == OWN
    assert set(get_args(ClaimVerdict)) == OF_PAPERS | OWN | {"consistent", "inconsistent"}


LEVELS = ("a", "b", "c")


def course(*means: float) -> Any:
    """Three rows with these means; scenes differ in how steep they are, by half the spread a level."""
    steps = enumerate(means)
    return run_with(**{n: values(m, i * SPREAD / 2) for n, (i, m) in zip(LEVELS, steps, strict=True)})


@pytest.mark.parametrize(
    ("means", "expected"),
    [
        ((0, -1, -2), "reproduced"),
        ((0, -0.1, -2), "reproduced"),
        ((0, 0.14, -2), "undecided"),  # the first step may go as claimed
        ((0, 0.16, -2), "contradicted"),  # it certainly does not
        ((0, -3, -2), "contradicted"),
        ((0, 0.05, 0), "undecided"),
        ((0, 1, 2), "contradicted"),
    ],
)
def test_monotone(means: tuple[float, ...], expected: str) -> None:
    """The change along the line is the last less the first, ± 0.3; each step is ± 0.15 at 97.5 %, as there are two."""
    check = check_of("monotone", LEVELS, expects="lower")
    assert interval_of(SPREAD / 2, 0.975) == pytest.approx((-0.15, 0.15))
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
"""How favourable a word is."""


@pytest.mark.parametrize(
    "check",
    [
        check_of(),
        check_of(negligible=1.0),
        check_of(paper=2.0),
        check_of(paper=2.0, negligible=0.5),
        check_of(accepted=(-1.0, 1.0), negligible=2.0),
        check_of(rows=("mine",), against=1.0),
    ],
    ids=["plain", "margin", "size", "both", "odd band", "one row"],
)
def test_a_more_favourable_scene_never_makes_a_verdict_less_so(check: Check) -> None:
    """Values are whole numbers, so that ties and ends on a bound are met; nobody knows the noise of the fits."""
    random = np.random.default_rng(30)
    for _ in range(500):
        effects = random.choice([0, 1, 2, 5, -1], 8, p=random.dirichlet([0.5] * 5)) + random.integers(-4, 2)
        better = effects.copy()
        better[random.integers(8)] += random.integers(1, 4)
        before, after = (verdict(fitted(led_by([*map(float, e)])), check) for e in (effects, better))
        assert HEIGHT[after] >= HEIGHT[before], f"{effects} is {before}, {better} is {after}"


@pytest.mark.parametrize("negligible", [0.0, 0.1])
@pytest.mark.parametrize("paper", [None, 2.0])
def test_nor_does_it_where_scenes_are_equal(negligible: float, paper: float | None) -> None:
    """From one scene that is worse, over none that differs, to more and more that are better."""
    check = check_of(paper=paper, negligible=negligible)
    ladder = [[-1.0] * n + [0.0] * (8 - n) for n in range(8, 0, -1)]
    ladder += [[1.0] * n + [0.0] * (8 - n) for n in range(9)]
    words = [verdict(fitted(led_by(effects)), check) for effects in ladder]
    heights = [HEIGHT[word] for word in words]
    assert heights == sorted(heights), words
