# SPDX-License-Identifier: Apache-2.0
"""Verdicts in words: the question, and what is possible and trivial beside it."""

import math
from dataclasses import replace

import pytest

from claims_by_hand import SPREAD, against, check_of, judged, run_with, values
from graycard.benchmarks.claims import Check, Quantity
from graycard.records import JobResult, RowMean, RunRecord
from runs_by_hand import run_of

GOOD, BAD, GONE = check_of(paper=5.0), check_of(rows=("theirs", "mine")), check_of(rows=("mine", "nobody"))


def test_the_limit_of_a_row_without_error_is_the_noise() -> None:
    rows = {"mine": {"psnr": values(5)}, "theirs": {"psnr": values(0)}, "bound": {"psnr": [math.inf] * 8}}
    run = run_of(rows)
    found = judged(run, check_of())
    assert found.checks[0].bound == RowMean("bound", None, "has no error")
    assert "upper bound bound has no error" in found.text
    noisy = judged(_noisy(run), check_of())
    told = "noise ceiling"
    assert noisy.checks[0].bound == RowMean("bound", 51.0, told)
    assert f"upper bound bound 51 dB ({told})" in noisy.text
    some = {"bound": {"psnr": [math.inf] * 4 + [31.0] * 4}}
    mixed = judged(_noisy(run_of(rows | some)), check_of()).checks[0]
    assert mixed.bound == RowMean("bound", 41.0, told)


def test_noise_accuses_nobody() -> None:
    """A row may be above the ceiling of a row without error by chance."""
    rows = {"mine": {"psnr": values(30)}, "theirs": {"psnr": values(0)}, "bound": {"psnr": [math.inf] * 8}}
    found = judged(_noisy(run_of(rows)), check_of())
    assert found.checks[0].rows[0].value == pytest.approx(63.5)
    assert "above the upper bound" not in found.text


def _noisy(run: RunRecord) -> RunRecord:
    return replace(run, results=tuple(map(with_ceiling, run.results)))


def with_ceiling(result: JobResult) -> JobResult:
    assert result.sheet is not None
    scores = tuple(replace(score, noise_ceiling=51.0) for score in result.sheet.scores)
    return replace(result, sheet=replace(result.sheet, scores=scores))


def test_a_gap_of_a_row_without_error_is_none() -> None:
    rows = {"mine": 1.0, "theirs": 3.0, "bound": math.inf}
    run = run_of(
        {row: {"psnr": [v + ahead for v in values(0)], "train": values(ahead)} for row, ahead in rows.items()}
    )
    found = judged(run, check_of(expects="lower", quantity=Quantity("train", less="psnr"))).checks[0]
    assert found.bound == RowMean("bound", None, "has no error, and so no difference")


@pytest.mark.parametrize(
    ("check", "rule"),
    [
        (check_of(), "the whole interval is above 0 dB; the paper names no size"),
        (check_of(paper=5.4), "the whole interval is above 0 dB, and some of it lies in 2.7 to 10.8 dB"),
        (
            check_of(accepted=(4.0, math.inf)),
            "the whole interval is above 0 dB, and some of it is at least 4 dB",
        ),
        (check_of("within", accepted=(-math.inf, 0.5)), "the whole interval is at most 0.5 dB"),
        (check_of("within", accepted=(-0.2, 0.2)), "the whole interval lies in -0.2 to 0.2 dB"),
        (
            check_of(scale="ratio", paper=2.0),
            "the whole interval is above 1×, and some of it lies in 1 to 4×",
        ),
        (
            check_of("monotone", ("mine", "theirs", "gray")),
            "the whole interval is above 0 dB, every step goes the claimed way; the paper names no size",
        ),
    ],
)
def test_what_a_check_asks_for_is_said(check: Check, rule: str) -> None:
    assert judged(against(5), check).checks[0].rule == rule


def test_a_lead_that_is_trivial_is_called_that() -> None:
    rows = {"mine": values(5), "theirs": values(0, 0 * SPREAD), "gray": values(6), "bound": values(9)}
    found = judged(run_of({row: {"psnr": v} for row, v in rows.items()}), check_of())
    assert found.verdict == "reproduced"
    assert "gray has 39.5 dB, no worse than all rows compared" in found.text
    trivial, bound = found.checks[0].trivial, found.checks[0].bound
    assert trivial is not None
    assert bound is not None
    assert (trivial.row, trivial.value) == ("gray", pytest.approx(39.5))
    assert (bound.row, bound.value) == ("bound", pytest.approx(42.5))
    between = judged(
        run_of({row: {"psnr": v} for row, v in (rows | {"gray": values(2)}).items()}), check_of()
    )
    assert "no worse than theirs" in between.text
    honest = judged(against(5), check_of())
    assert "no worse" not in honest.text
    assert honest.text.endswith("; upper bound bound 42.5 dB, trivial gray 24.5 dB")


def test_a_lead_over_the_trivial_row_is_not_held_against_itself() -> None:
    check = check_of(rows=["mine", "gray"])
    assert "no worse" not in judged(against(5), check).text
    behind = run_of({row: {"psnr": values(v)} for row, v in {"mine": 1, "gray": 3, "bound": 9}.items()})
    assert "no worse than mine" in judged(behind, check).text


def test_what_the_trivial_row_shows_too_is_called_that() -> None:
    check = check_of(rows=["mine"], against=20.0)
    doubt = "what is trivial shows it no less: gray has 24.5 dB"
    assert doubt in judged(run_with(mine=values(-10)), check).text
    assert doubt not in judged(run_with(mine=values(-8)), check).text
    lower = check_of(rows=["mine"], against=60.0, expects="lower")
    assert doubt in judged(run_with(mine=values(-8)), lower).text
    assert doubt not in judged(run_with(mine=values(-10)), lower).text


def test_to_be_worse_is_no_merit_that_could_be_trivial() -> None:
    worse = judged(run_with(mine=values(-10), theirs=values(0)), check_of(expects="lower"))
    assert worse.verdict == "reproduced"
    assert "But" not in worse.text


def test_more_than_is_possible_is_called_that() -> None:
    rows = {"mine": values(5), "theirs": values(0), "gray": values(-9), "bound": values(3)}
    found = judged(run_of({row: {"psnr": v} for row, v in rows.items()}), check_of())
    assert "mine is above the upper bound bound" in found.text
    level = run_of({row: {"psnr": v} for row, v in (rows | {"bound": rows["mine"]}).items()})
    assert "above" not in judged(level, check_of()).text


def test_rows_beside_a_check_that_are_missing_say_so() -> None:
    run = run_of({"mine": {"psnr": values(5)}, "theirs": {"psnr": values(0)}, "gray": {"error": [0.0] * 8}})
    found = judged(run, check_of()).checks[0]
    assert found.bound == RowMean("bound", None, "not in this run")
    assert found.reason.endswith("; upper bound bound not in this run, trivial gray has no psnr on s0")
    assert found.trivial is not None
    assert found.trivial.reason == "has no psnr on s0"


def test_the_checks_that_decided_are_told() -> None:
    run = run_with(mine=values(5), theirs=values(0, 0 * SPREAD))
    found = judged(run, GOOD, replace(GONE, id="b"), replace(GONE, id="c", rows=("mine", "nowhere")))
    assert found.text == ("cannot be tested here: the run has no row nobody (and 1 more reasons)")
    assert judged(run, GOOD, replace(BAD, id="b")).text.startswith(
        "the opposite of the claim in 1 of 2 checks: PSNR, theirs − mine = -5 dB ("
    )


def test_what_needs_real_captures_is_not_testable() -> None:
    found = judged(against(5), GOOD, unavailable="It needs a robot.")
    assert (found.verdict, found.text) == ("not testable here", "It needs a robot.")
    assert found.checks[0].verdict == "reproduced"
