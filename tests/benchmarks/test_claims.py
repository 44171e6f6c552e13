# SPDX-License-Identifier: Apache-2.0
"""Verdicts on claims, from runs whose numbers are written down."""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy import stats

from graycard.benchmarks.claims import Along, Check, Claim, Paper, Quantity, Scenes, judge_paper
from graycard.eval.statistics import mean_interval, mean_p, signed_rank_p
from graycard.records import ClaimResult, Cost, JobResult, RowMean, RunRecord
from runs_by_hand import Values, result_of, run_of, scene_of, without_metrics

SPREAD = np.array([-0.3, 0.2, -0.1, 0.4, -0.2, 0.1, 0.3, -0.4])
"""Of eight scenes; its mean is 0."""
BASE = 30 + np.arange(8.0)
"""Scenes differ far more than methods do: only differences scene by scene can tell."""


def values(mean: float, spread: np.ndarray = SPREAD) -> list[float]:
    return list(map(float, BASE[: len(spread)] + mean + spread))


def run_with(**rows: Values) -> RunRecord:
    return run_of({"bound": {"psnr": values(9)}, "gray": {"psnr": values(-9)}} | {
        row: {"psnr": found} for row, found in rows.items()
    })  # fmt: skip


def even_run(scenes: int) -> RunRecord:
    return run_of({row: {"psnr": [2.0] * scenes} for row in ("mine", "theirs")})


def check_of(rule: Any = "better", rows: Sequence[str] = ("mine", "theirs"), **more: Any) -> Check:
    options: dict[str, Any] = {"quantity": Quantity("psnr"), "expects": "higher"} | more
    return Check("a", "mine is better", rule, rows=tuple(rows), **options)


def paper_of(*checks: Check, **more: Any) -> Paper:
    claims = (Claim("S1", "It is better.", "Table 1", checks, **more),)
    return Paper("p", 1, "A paper", "dark", bound="bound", trivial="gray", claims=claims)


def judged(run: RunRecord, *checks: Check, **more: Any) -> ClaimResult:
    return judge_paper(paper_of(*checks, **more), run)[0]


def verdict(run: RunRecord, *checks: Check, **more: Any) -> str:
    return judged(run, *checks, **more).verdict


def against(mean: float, spread: np.ndarray = SPREAD) -> RunRecord:
    """``mine`` is better than ``theirs`` by a mean and a spread over scenes."""
    return run_with(mine=values(mean, spread), theirs=values(0, 0 * spread))


@pytest.mark.parametrize(
    ("lead", "paper", "expected"),
    [
        (5.0, 5.4, "reproduced"),
        (5.0, None, "reproduced"),
        (2.71, 5.4, "reproduced"),
        (2.69, 5.4, "direction only"),
        (10.7, 5.4, "reproduced"),
        (10.9, 5.4, "direction only"),
        (0.1, 5.4, "not supported"),
        (0.0, None, "not supported"),
        (-0.1, 5.4, "not supported"),
        (-1.0, 5.4, "contradicted"),
    ],
)
def test_better(lead: float, paper: float | None, expected: str) -> None:
    assert verdict(against(lead), check_of(paper=paper)) == expected


def led_by(effects: Sequence[float]) -> RunRecord:
    """``mine`` is ahead of ``theirs`` by so much on each scene."""
    return against(0.0, np.array(effects))


def test_a_mean_that_few_scenes_make_is_not_certain() -> None:
    """The interval leaves out 0, the ranks do not: three of eight scenes have the other sign."""
    skewed = [2.68, 1.76, 2.32, -0.25, -0.23, 0.6, 1.22, -0.25]
    found = judged(led_by(skewed), check_of()).checks[0]
    assert found.interval is not None
    assert found.p_rank is not None
    assert found.interval[0] > 0
    assert found.p_rank > 0.05
    assert found.verdict == "not supported"
    assert "; by ranks p = 0.102" in found.reason
    assert verdict(led_by([-e for e in skewed]), check_of()) == "not supported"
    few = {"mine": {"psnr": [1.0, 1.1, 1.2, 0.9, 0.8, 0, 0, 0]}, "theirs": {"psnr": [0.0] * 8}}
    assert verdict(run_of(few), check_of()) == "reproduced"  # five scenes have a sign, and all the same


def test_where_ranks_cannot_tell_the_interval_does() -> None:
    """Of five scenes of one sign p is 0.06 at best."""
    run = run_of({"mine": {"psnr": [1.0, 1.1, 1.2, 0.9, 0.8]}, "theirs": {"psnr": [0.0] * 5}})
    found = judged(run, check_of()).checks[0]
    assert (found.verdict, found.p_rank) == ("reproduced", 0.0625)


@pytest.mark.parametrize(
    ("lead", "negligible", "expected"),
    [
        (1.0, 1.5, "not supported"),
        (-1.0, 1.5, "not supported"),
        (1.0, 1.2, "reproduced"),  # part of the interval is beyond
        (-1.0, 1.2, "contradicted"),
    ],
)
def test_what_nobody_would_care_for_is_no_difference(lead: float, negligible: float, expected: str) -> None:
    found = judged(against(lead), check_of(negligible=negligible))
    assert found.verdict == expected
    span = f"-{negligible:g} to {negligible:g} dB"
    assert f"the sign is certain, some of the interval is outside of {span}" in found.checks[0].rule
    said = f"negligible: {span} counts as no difference"
    assert (said in found.text) == (expected == "not supported")


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


def test_ranks_that_are_sure_of_the_opposite_are_no_support() -> None:
    lead = [-0.01 - 1e-4 * i for i in range(44)] + [10.0 + i for i in range(6)]
    rows = {"mine": {"psnr": lead}, "theirs": {"psnr": [0.0] * 50}}
    found = judged(run_of(rows), check_of()).checks[0]
    assert found.interval is not None
    assert found.p_rank is not None
    assert found.interval[0] > 0
    assert found.p_rank < 0.05
    assert found.verdict == "not supported"


def test_a_ratio_may_be_negligible() -> None:
    rows = {"mine": {"psnr": [1.01 + 0.001 * i for i in range(8)]}, "theirs": {"psnr": [1.0] * 8}}
    check = check_of(scale="ratio", negligible=0.1)
    found = judged(run_of(rows), check)
    assert found.verdict == "not supported"
    assert "negligible: 0.9 to 1.1× counts as no difference" in found.text
    assert judged(run_of(rows), replace(check, negligible=0.01)).verdict == "reproduced"


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
    ("loss", "expected"), [(-1.0, "reproduced"), (0.1, "not supported"), (1.0, "contradicted")]
)
def test_lower_is_the_claimed_sense(loss: float, expected: str) -> None:
    found = judged(against(loss), check_of(expects="lower"))
    assert found.verdict == expected
    assert found.checks[0].mean == pytest.approx(-loss)
    assert found.checks[0].effect_of == "theirs − mine"


@pytest.mark.parametrize(
    ("accepted", "expected"),
    [((4.0, math.inf), "reproduced"), ((6.0, math.inf), "direction only"), ((1, 2), "direction only")],
)
def test_a_size_may_be_said_otherwise(accepted: tuple[float, float], expected: str) -> None:
    assert verdict(against(5.0), check_of(paper=9.0, accepted=accepted)) == expected


@pytest.mark.parametrize(
    ("lead", "accepted", "expected"),
    [
        (0.0, (-0.5, 0.5), "reproduced"),
        (0.0, (-0.1, 0.1), "not supported"),  # the interval is wider: nothing says that it is so small
        (0.5, (-0.5, 0.5), "not supported"),
        (2.0, (-0.5, 0.5), "contradicted"),
        (-2.0, (-0.5, 0.5), "contradicted"),
        (-2.0, (-math.inf, 0.5), "reproduced"),
        (1.0, (-math.inf, 0.5), "contradicted"),
    ],
)
def test_within(lead: float, accepted: tuple[float, float], expected: str) -> None:
    assert verdict(against(lead), check_of("within", accepted=accepted)) == expected


def test_the_numbers_are_those_of_the_statistics() -> None:
    found = judged(against(5.0), check_of(paper=5.4)).checks[0]
    effects = 5.0 + SPREAD
    assert list(found.scenes.values()) == pytest.approx(effects)
    assert list(found.scenes) == [f"s{i}" for i in range(8)]
    assert found.mean == pytest.approx(5.0)
    assert found.interval == pytest.approx(mean_interval(effects))
    assert found.p_mean == pytest.approx(mean_p(effects), abs=1e-12)
    assert found.p_rank == signed_rank_p(effects)
    assert found.accepted == pytest.approx((2.7, 10.8))
    assert [(r.row, r.value) for r in found.rows] == [
        ("mine", pytest.approx(38.5)), ("theirs", pytest.approx(33.5)),
    ]  # fmt: skip


def test_seeds_are_averaged_before_scenes_are_compared() -> None:
    once = against(5.0)
    more = [
        result_of("mine", n, {"psnr": v + 2}, seed=1) for n, v in enumerate(values(5.0))
    ]  # the mean of both is 1 higher
    found = judged(replace(once, results=(*once.results, *more)), check_of()).checks[0]
    assert found.mean == pytest.approx(6.0)
    assert len(found.scenes) == 8
    assert found.interval == pytest.approx(mean_interval(6.0 + SPREAD))


def test_ties_support_no_lead_and_all_equality() -> None:
    run = run_with(mine=values(0), theirs=values(0))
    assert verdict(run, check_of()) == "not supported"
    assert verdict(run, check_of("within", accepted=(-0.1, 0.1))) == "reproduced"


def test_one_row_is_judged_against_a_number() -> None:
    run = run_with(mine=values(0, SPREAD))
    assert verdict(run, check_of(rows=["mine"], against=20.0)) == "reproduced"
    assert verdict(run, check_of(rows=["mine"], against=50.0)) == "contradicted"
    lower = judged(run, check_of(rows=["mine"], against=50.0, expects="lower")).checks[0]
    assert (lower.verdict, lower.effect_of) == ("reproduced", "50 − mine")
    assert lower.mean == pytest.approx(16.5)


def test_a_ratio_is_of_geometric_means() -> None:
    costs = {"mine": Cost(10, 100, {"steps": 50}), "theirs": Cost(130, 100, {"steps": 800})}
    rows = {row: {"psnr": values(0)} for row in costs}
    times = Quantity("cost.wall_s")
    run = run_of(rows, costs=costs)
    check = check_of(rows=["theirs", "mine"], quantity=times, scale="ratio", paper=13.0)
    found = judged(run, check).checks[0]
    assert (found.verdict, found.unit, found.neutral) == ("reproduced", "×", 1.0)
    assert found.mean == pytest.approx(13.0)
    assert found.interval == pytest.approx((13.0, 13.0))
    assert verdict(run, replace(check, paper=30.0)) == "direction only"
    assert verdict(run, replace(check, expects="lower")) == "contradicted"
    counted = judged(run, replace(check, quantity=Quantity("count.steps"))).checks[0]
    assert (counted.mean, counted.quantity) == (pytest.approx(16.0), "Steps a picture")
    at_most = check_of("within", ["mine", "theirs"], quantity=times, scale="ratio", accepted=(0.0, 1.0))
    assert verdict(run, at_most) == "reproduced"
    assert "counts no tiles" in judged(run, replace(check, quantity=Quantity("count.tiles"))).text
    bare = run_of(rows)
    assert "cost was not measured on s0" in judged(bare, check).text


def test_a_row_may_be_a_multiple_of_a_number() -> None:
    run = run_of({"mine": {"psnr": [4.0, 5.0, 6.0]}})
    check = check_of(rows=["mine"], scale="ratio", against=2.0)
    assert judged(run, check).checks[0].mean == pytest.approx((2 * 2.5 * 3) ** (1 / 3))
    turned = judged(run, replace(check, expects="lower")).checks[0]
    assert (turned.verdict, turned.effect_of) == ("contradicted", "2 / mine")


def test_ratios_of_nothing() -> None:
    run = run_of({"mine": {"psnr": [0.0, 1.0, 2.0]}, "theirs": {"psnr": [1.0, 1.0, 1.0]}})
    assert "a ratio needs values above 0" in judged(run, check_of(scale="ratio")).text


def test_a_gap_is_a_difference_of_two_metrics() -> None:
    rows = {"mine": 1.0, "theirs": 3.0}
    run = run_of({row: {"psnr": values(0), "train": values(ahead)} for row, ahead in rows.items()})
    gap = Quantity("train", less="psnr")
    found = judged(run, check_of(expects="lower", quantity=gap)).checks[0]
    assert found.verdict == "reproduced"
    assert found.mean == pytest.approx(2.0)
    assert found.quantity == "Training PSNR less PSNR"


LEVELS = ("a", "b", "c")


def line_through(places: Sequence[float], found: Sequence[float]) -> float:
    line: Any = stats.linregress(places, found)
    return line.slope


def course(*means: float, spread: np.ndarray = SPREAD) -> RunRecord:
    """Three rows with these means; scenes differ in how steep they are."""
    steps = enumerate(means)
    return run_with(**{n: values(m, i * spread / 2) for n, (i, m) in zip(LEVELS, steps, strict=True)})


@pytest.mark.parametrize(
    ("means", "expected"),
    [
        ((0, -1, -2), "reproduced"),
        ((0, -3, -2), "direction only"),  # it falls, but not with each level
        ((0, 0.05, 0), "not supported"),
        ((0, 1, 2), "contradicted"),
    ],
)
def test_monotone(means: tuple[float, ...], expected: str) -> None:
    check = check_of("monotone", LEVELS, expects="lower")
    assert verdict(course(*means), check) == expected
    assert verdict(course(*(-m for m in means)), replace(check, expects="higher")) == expected


def test_the_change_along_levels_is_that_of_the_line() -> None:
    places = (0.0, 1.0, 4.0)
    run = course(0, -1, -5)
    found = judged(run, check_of("monotone", LEVELS, expects="lower", levels=places)).checks[0]
    lines = [line_through(places, [-i * s / 2 - m for i, m in enumerate((0, -1, -5))]) * 4 for s in SPREAD]
    assert list(found.scenes.values()) == pytest.approx(lines)
    assert found.effect_of == "change from the first to the last of: a; b; c, a fall counted as positive"


def test_a_gap_that_grows() -> None:
    rows = {"a": 0.0, "b": 1.0, "c": 2.0, "x": 0.0, "y": 0.5, "z": 0.6}
    run = run_with(**{row: values(mean, SPREAD * (mean + 1)) for row, mean in rows.items()})
    check = check_of("monotone", LEVELS, minus=("x", "y", "z"))
    found = judged(run, check)
    assert found.verdict == "reproduced"
    assert found.checks[0].mean == pytest.approx(1.4)
    assert verdict(run, replace(check, rows=("x", "y", "z"), minus=LEVELS)) == "contradicted"


def along_knob(slope: float) -> RunRecord:
    knobs = np.linspace(0, 0.7, 8)
    lead = 3 + slope * knobs
    rows = {"mine": {"psnr": list(BASE + lead + SPREAD / 10)}, "theirs": {"psnr": list(BASE)}}
    return run_of(rows, [scene_of(i, offset=float(k)) for i, k in enumerate(knobs)])


def test_along_a_knob() -> None:
    along = Along("offset", 0.1, 0.6)
    check = check_of(along=along)
    found = judged(along_knob(4.0), check).checks[0]
    line: Any = stats.linregress(np.linspace(0, 0.7, 8), 3 + 4 * np.linspace(0, 0.7, 8) + SPREAD / 10)
    half = stats.t.ppf(0.975, 6) * line.stderr * 0.5
    assert found.verdict == "reproduced"
    assert found.mean == pytest.approx(0.5 * line.slope)
    assert found.interval == pytest.approx((0.5 * line.slope - half, 0.5 * line.slope + half))
    assert found.p_mean == pytest.approx(line.pvalue)
    assert found.p_rank is None
    assert verdict(along_knob(-4.0), check) == "contradicted"
    level = check_of("within", along=along, accepted=(-0.5, 0.5))
    assert verdict(along_knob(0.0), level) == "reproduced"
    assert verdict(along_knob(4.0), level) == "contradicted"


def test_a_knob_that_no_scene_differs_in() -> None:
    rows = {"mine": {"psnr": values(1)}, "theirs": {"psnr": values(0)}}
    check = check_of(along=Along("offset", 0.1, 0.6))
    same = run_of(rows, [scene_of(i, offset=0.25) for i in range(8)])
    assert "scenes that differ in offset, got 0.25 in all" in judged(same, check).text
    assert "the run does not tell the knob offset of s0" in judged(run_of(rows), check).text


def test_scenes_are_chosen_by_family_and_knob() -> None:
    rows = {"mine": {"psnr": values(0, 5 * np.sign(SPREAD))}, "theirs": {"psnr": values(0, 0 * SPREAD)}}
    good = [scene_of(i, "corridor" if s > 0 else "shelf", gloss=float(s > 0)) for i, s in enumerate(SPREAD)]
    run = run_of(rows | {"gray": {"psnr": list(map(float, SPREAD))}}, good)
    assert verdict(run, check_of()) == "not supported"
    corridors = judged(run, check_of(scenes=Scenes(("corridor",)))).checks[0]
    assert (corridors.verdict, list(corridors.scenes)) == ("reproduced", ["s1", "s3", "s5", "s6"])
    assert verdict(run, check_of(scenes=Scenes(knobs={"gloss": (0.0, 0.5)}))) == "contradicted"
    assert corridors.trivial is not None
    assert corridors.trivial.value == pytest.approx(np.mean([SPREAD[i] for i in (1, 3, 5, 6)]))
    assert "has no psnr on scenes that this is about" in judged(run, check_of(scenes=Scenes(("lab",)))).text


@pytest.mark.parametrize(
    ("run", "reason"),
    [
        (run_with(mine=values(5)), "the run has no row theirs"),
        (
            even_run(2),
            "an interval needs 3 scenes, got 2: s0, s1",
        ),
        (
            even_run(1),
            "an interval needs 3 scenes, got 1: s0",
        ),
        (run_with(mine=[*values(5)[:-1], None], theirs=values(0)), "mine psnr failed on s7 (black)"),
        (run_with(mine=values(5)[:-1], theirs=values(0)), "mine was not run on s7"),
        (run_with(mine=[math.inf] * 8, theirs=values(0)), "a score is infinite"),
        (without_metrics(against(5), "psnr"), "the run has no metric psnr"),
    ],
)
def test_what_cannot_be_checked_says_why(run: RunRecord, reason: str) -> None:
    found = judged(run, check_of(paper=5.0))
    assert found.verdict == "not checkable"
    assert reason in found.text
    assert found.checks[0].accepted == (2.5, 10)  # what it would ask for is told all the same


def test_a_job_that_failed_is_no_scene_less() -> None:
    run = against(5)
    failed = replace(run.results[-1], status="failed", reason="it ran out of memory", sheet=None)
    found = judged(replace(run, results=(*run.results[:-1], failed)), check_of())
    assert found.verdict == "not checkable"
    assert "theirs failed on s7: it ran out of memory" in found.text


def test_a_seed_that_failed_is_not_averaged_away() -> None:
    once = against(5)
    again = [result_of("mine", n, {"psnr": None if n == 3 else 30.0}, seed=1) for n in range(8)]
    found = judged(replace(once, results=(*once.results, *again)), check_of())
    assert found.verdict == "not checkable"
    assert "mine psnr failed on s3 (black)" in found.text


def test_a_score_that_others_have_there_is_missing() -> None:
    rows = {"mine": {"error": [0.1] * 4, "psnr": values(1)[:3]}, "theirs": {"psnr": values(0)[:4]}}
    found = judged(run_of(rows), check_of())
    assert found.verdict == "not checkable"
    assert "mine has no psnr on s3" in found.text


def test_scenes_that_do_not_have_the_metric_are_not_meant() -> None:
    rows = {row: {"error": [e] * 3, "psnr": values(0)} for row, e in (("mine", 0.1), ("theirs", 0.4))}
    rows["bound"] = {"error": [0.0] * 3, "psnr": values(9)}
    found = judged(run_of(rows), check_of(expects="lower", quantity=Quantity("error"))).checks[0]
    assert (found.verdict, list(found.scenes)) == ("reproduced", ["s0", "s1", "s2"])
    assert found.bound == RowMean("bound", 0.0)


def test_parts_and_protocols_of_a_score() -> None:
    run = against(0.0)
    results = []
    for result in run.results:
        assert result.sheet is not None
        score = result.sheet.scores[0]
        off = 4.0 if result.job.method == "mine" else 0.0
        parted = replace(score, breakdown={"off": (score.value or 0) + off})
        published = replace(score, protocol="nerfactor", metric="albedo", value=(score.value or 0) - off)
        sheet = replace(result.sheet, scores=(parted,), protocols=(published,))
        results.append(replace(result, sheet=sheet))
    run = replace(run, results=tuple(results))
    part = judged(run, check_of(quantity=Quantity("psnr", part="off"))).checks[0]
    assert (part.verdict, part.quantity) == ("reproduced", "PSNR (off)")
    assert "psnr has no part on on s0" in judged(run, check_of(quantity=Quantity("psnr", part="on"))).text
    published = judged(run, check_of(quantity=Quantity("Albedo", protocol="nerfactor"))).checks[0]
    assert (published.verdict, published.unit, published.quantity) == ("contradicted", "dB", "Albedo")
    other = judged(run, check_of(quantity=Quantity("Albedo", protocol="orb")))
    assert "the run has no score by the protocol orb" in other.text


@pytest.mark.parametrize(
    ("check", "rule"),
    [
        (check_of(), "the sign is certain; the paper names no size"),
        (check_of(paper=5.4), "the sign is certain, and the mean lies in 2.7 to 10.8 dB"),
        (
            check_of(accepted=(4.0, math.inf)),
            "the sign is certain, and the mean is at least 4 dB",
        ),
        (check_of("within", accepted=(-math.inf, 0.5)), "the whole interval is at most 0.5 dB"),
        (check_of("within", accepted=(-0.2, 0.2)), "the whole interval lies in -0.2 to 0.2 dB"),
        (check_of(scale="ratio", paper=2.0), "the sign is certain, and the mean lies in 1 to 4×"),
        (
            check_of("monotone", ("mine", "theirs", "gray")),
            "the sign is certain, every step goes the claimed way; the paper names no size",
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


GOOD, WEAK, OPEN, BAD = (check_of(paper=p, accepted=a, rows=r) for p, a, r in (
    (5.0, None, ("mine", "theirs")),
    (50.0, None, ("mine", "theirs")),
    (None, None, ("gray", "same")),
    (None, None, ("theirs", "mine")),
))  # fmt: skip
GONE = check_of(rows=("mine", "nobody"))


@pytest.mark.parametrize(
    ("checks", "by_all", "by_any"),
    [
        ((GOOD, GOOD), "reproduced", "reproduced"),
        ((GOOD, WEAK), "direction only", "reproduced"),
        ((GOOD, WEAK, OPEN), "not supported", "reproduced"),
        ((WEAK, OPEN, GONE), "not checkable", "direction only"),
        ((OPEN, GONE, BAD), "contradicted", "not supported"),
        ((GOOD, replace(BAD, decides=False)), "reproduced", "reproduced"),
    ],
)
def test_a_claim_follows_from_its_checks(checks: tuple[Check, ...], by_all: str, by_any: str) -> None:
    run = run_with(mine=values(5), theirs=values(0, 0 * SPREAD), same=values(-9))
    named = [replace(check, id=str(number)) for number, check in enumerate(checks)]
    assert verdict(run, *named, verdict_by="all") == by_all
    assert verdict(run, *named, verdict_by="any") == by_any


def test_the_checks_that_decided_are_told() -> None:
    run = run_with(mine=values(5), theirs=values(0, 0 * SPREAD))
    found = judged(run, GOOD, replace(GONE, id="b"), replace(GONE, id="c", rows=("mine", "nowhere")))
    assert found.text == ("cannot be checked here: the run has no row nobody (and 1 more reasons)")
    assert judged(run, GOOD, replace(BAD, id="b")).text.startswith(
        "1 of 2 checks, the opposite of the claim: PSNR, theirs − mine = -5 dB ("
    )


def test_what_needs_real_captures_is_not_checkable() -> None:
    found = judged(against(5), GOOD, unavailable="It needs a robot.")
    assert (found.verdict, found.text) == ("not checkable", "It needs a robot.")
    assert found.checks[0].verdict == "reproduced"
