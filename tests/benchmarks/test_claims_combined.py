# SPDX-License-Identifier: Apache-2.0
"""Claims made of checks: certainty that each needs, and the words of whoever asks."""

import re
from collections.abc import Mapping
from dataclasses import replace
from typing import get_args

import numpy as np
import pytest

from claims_by_hand import (
    LEVELS,
    SPREAD,
    against,
    check_of,
    cut_off,
    interval_of,
    judged,
    led_by,
    paper_of,
    run_with,
    values,
    verdict,
)
from graycard.benchmarks.claims import RULES, Check
from graycard.benchmarks.claims._rules import levels_for
from graycard.records import ClaimVerdict, RunRecord

OF_PAPERS = {
    "reproduced", "larger than claimed", "smaller than claimed", "no effect", "contradicted",
    "undecided", "not testable here",
}  # fmt: skip
OWN = {"holds", "does not hold", "open", "not testable here"}
STATED = check_of(paper=5.4)
"""Its band is 2.7 to 10.8 dB."""
MARGIN = check_of(negligible=0.5)
"""No size, but what is within 0.5 dB counts as nothing."""


GOOD, WEAK, OPEN, BAD = (check_of(paper=p, rows=r) for p, r in (
    (5.0, ("mine", "theirs")),
    (50.0, ("mine", "theirs")),
    (None, ("gray", "same")),
    (None, ("theirs", "mine")),
))  # fmt: skip
GONE = check_of(rows=("mine", "nobody"))
TWELVE = np.linspace(-0.5, 0.5, 12)
SHARED = re.findall(r"100 % less ([\d.]+) % over the number of their intervals", RULES["several checks"])
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


def run_of_twelve(lead: float) -> RunRecord:
    return led_by(list(lead + TWELVE))


def copies(check: Check, count: int) -> list[Check]:
    return [replace(check, id=str(number)) for number in range(count)]


@pytest.mark.parametrize("count", [2, 3, 5])
def test_a_word_that_one_check_is_enough_for_is_asked_at_a_stricter_level(count: int) -> None:
    """One check contradicts a claim by ``all``, at a level of the rule. All have to support, at 95 %."""
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
    """The number of checks does not matter, as the errors of all of them are added."""
    assert len(SHARED) == 1
    assert 0 < float(SHARED[0]) <= 5


@pytest.mark.parametrize(("statements", "level"), [(2, 0.98125), (3, 0.9875), (4, 0.990625), (10, 0.99625)])
def test_three_quarters_of_the_error_are_divided(statements: int, level: float) -> None:
    assert levels_for(statements, 0.95) == pytest.approx(level)
    assert levels_for(1, 0.95) == 0.95


def test_a_course_makes_a_statement_of_its_effect_and_one_of_each_step() -> None:
    three, six = check_of("monotone", LEVELS, id="b"), check_of("monotone", tuple("abcdef"), id="c")
    assert [check.statements for check in (check_of(), three, six)] == [1, 3, 6]
    (claim,) = paper_of(check_of(), three, replace(six, decides=False)).claims
    assert claim.statements == 4


@pytest.mark.parametrize("by", ["all", "any"])
def test_a_word_that_is_certain_at_the_usual_level_alone_is_told(by: str) -> None:
    usual_end, strict_end = (interval_of(TWELVE, level)[1] for level in (0.95, strict(2)))
    lead = (usual_end + strict_end) / 2 * (-1 if by == "all" else 1)
    word = "contradicted" if by == "all" else "reproduced"
    two = judged(run_of_twelve(lead), *copies(check_of(), 2), verdict_by=by)
    level = f"{100 * strict(2):.4g} %"
    told = f"; {word} at 95 %, but one of several checks has to be certain at {level}; "
    assert (two.verdict, [told in check.reason for check in two.checks]) == ("undecided", [True, True])
    assert "has to be certain" not in judged(run_of_twelve(lead), check_of(), verdict_by=by).text
    assert "has to be certain" not in judged(run_of_twelve(0.0), *copies(check_of(), 2), verdict_by=by).text


def test_scenes_that_the_stricter_level_needs_are_told() -> None:
    """Six of one sign have p = 2/64, seven 2/128: 98.125 % asks for less than 0.01875."""
    six, seven = ([-1.0 - 0.1 * i for i in range(count)] for count in (6, 7))
    found = judged(led_by(six), *copies(check_of(), 2))
    assert found.verdict == "undecided"
    assert f"has to be certain at {100 * strict(2):.4g} %, which needs 7 scenes; " in found.text
    assert verdict(led_by(seven), *copies(check_of(), 2)) == "contradicted"


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
    assert (paper.asked_by, paper.verdict) == ("paper", word)
    assert [c.verdict for c in paper.checks] == [word, own], "what decides nothing contradicts nobody"
    asked = judged(against(lead), check, told, asked_by="graycard")
    assert (asked.asked_by, asked.verdict, {c.verdict for c in asked.checks}) == ("graycard", own, {own})


def test_there_are_seven_words_of_papers_and_four_of_our_own() -> None:
    assert ANSWERS.keys() == OF_PAPERS
    assert {own for _, _, own in ANSWERS.values()} == OWN
    assert set(get_args(ClaimVerdict)) == OF_PAPERS | OWN | {"consistent", "inconsistent"}
