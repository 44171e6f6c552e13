# SPDX-License-Identifier: Apache-2.0
"""Effects of claims, from runs whose numbers are written down: by scene, seed, metric, level and knob."""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy import stats

from claims_by_hand import (
    BASE,
    LEVELS,
    SPREAD,
    against,
    check_of,
    course,
    estimate_of,
    fitted,
    interval_of,
    judged,
    run_with,
    seeded,
    values,
    verdict,
)
from graycard.benchmarks.claims import Along, Quantity, Scenes
from graycard.records import Cost, RowMean, RunRecord
from runs_by_hand import result_of, run_of, scene_of, without_metrics


def even_run(scenes: int) -> RunRecord:
    return run_of({row: {"psnr": [2.0] * scenes} for row in ("mine", "theirs")})


def test_seeds_are_averaged_before_scenes_are_compared() -> None:
    once = against(5.0)
    more = [
        result_of("mine", n, {"psnr": v + 2}, seed=1) for n, v in enumerate(values(5.0))
    ]  # the mean of both is 1 higher
    found = judged(replace(once, results=(*once.results, *more)), check_of()).checks[0]
    assert found.estimate == pytest.approx(6.0)
    assert len(found.scenes) == 8
    assert found.interval == pytest.approx(interval_of(6.0 + SPREAD))


def test_one_row_is_judged_against_a_number() -> None:
    run = run_with(mine=values(0, SPREAD))
    assert verdict(run, check_of(rows=["mine"], against=20.0)) == "reproduced"
    assert verdict(run, check_of(rows=["mine"], against=50.0)) == "contradicted"
    lower = judged(run, check_of(rows=["mine"], against=50.0, expects="lower")).checks[0]
    assert (lower.verdict, lower.effect_of) == ("reproduced", "50 − mine")
    assert lower.estimate == pytest.approx(50 - estimate_of(values(0)))
    assert lower.interval == pytest.approx(interval_of(50 - np.array(values(0))))


def test_a_ratio_is_of_geometric_means() -> None:
    costs = {"mine": Cost(10, 100, {"steps": 50}), "theirs": Cost(130, 100, {"steps": 800})}
    rows = {row: {"psnr": values(0)} for row in costs}
    times = Quantity("cost.wall_s")
    run = run_of(rows, costs=costs)
    check = check_of(rows=["theirs", "mine"], quantity=times, scale="ratio", paper=13.0)
    found = judged(run, check).checks[0]
    assert (found.verdict, found.unit, found.neutral) == ("reproduced", "×", 1.0)
    assert found.estimate == pytest.approx(13.0)
    assert found.interval == pytest.approx((13.0, 13.0))
    assert verdict(run, replace(check, paper=30.0)) == "smaller than claimed"
    assert verdict(run, replace(check, expects="lower")) == "contradicted"
    counted = judged(run, replace(check, quantity=Quantity("count.steps"))).checks[0]
    assert (counted.estimate, counted.quantity) == (pytest.approx(16.0), "Steps a picture")
    at_most = check_of("within", ["mine", "theirs"], quantity=times, scale="ratio", accepted=(0.0, 1.0))
    assert verdict(run, at_most) == "reproduced"
    assert "counts no tiles" in judged(run, replace(check, quantity=Quantity("count.tiles"))).text
    bare = run_of(rows)
    assert "cost was not measured on s0" in judged(bare, check).text


def test_a_row_may_be_a_multiple_of_a_number() -> None:
    found = [4.0, 5.0, 6.0, 4.5, 7.0, 9.0]
    run = run_of({"mine": {"psnr": found}})
    check = check_of(rows=["mine"], scale="ratio", against=2.0)
    logarithms = np.log(np.array(found) / 2)
    times = judged(run, check).checks[0]
    assert times.estimate == pytest.approx(math.exp(estimate_of(logarithms)))
    assert times.interval == pytest.approx(np.exp(interval_of(logarithms)))
    assert times.interval == pytest.approx((2.0, 4.5))  # six scenes: from the least to the greatest
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
    assert found.estimate == pytest.approx(2.0)
    assert found.quantity == "Training PSNR less PSNR"


def line_through(places: Sequence[float], found: Sequence[float]) -> float:
    line: Any = stats.linregress(places, found)
    return line.slope


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
    assert found.checks[0].estimate == pytest.approx(1.4)
    assert verdict(run, replace(check, rows=("x", "y", "z"), minus=LEVELS)) == "contradicted"


def along_knob(slope: float) -> RunRecord:
    knobs = np.linspace(0, 0.7, 8)
    lead = 3 + slope * knobs
    rows = {"mine": {"psnr": list(BASE + lead + SPREAD / 10)}, "theirs": {"psnr": list(BASE)}}
    return run_of(rows, [scene_of(i, offset=float(k)) for i, k in enumerate(knobs)])


def test_along_a_knob() -> None:
    along, knobs = Along("offset", 0.1, 0.6), np.linspace(0, 0.7, 8)
    check = check_of(along=along)
    found = judged(along_knob(4.0), check).checks[0]
    line: Any = stats.linregress(knobs, 3 + 4 * knobs + SPREAD / 10)
    half = stats.t.ppf(0.975, 6) * line.stderr * 0.5
    assert found.verdict == "reproduced"
    assert found.estimate == pytest.approx(0.5 * line.slope)
    assert found.interval == pytest.approx((0.5 * line.slope - half, 0.5 * line.slope + half))
    assert found.p_rank is None
    weak: Any = stats.linregress(knobs, 3 + 0.2 * knobs + SPREAD / 10)
    ends = judged(along_knob(0.2), check, level=1 - weak.pvalue).checks[0].interval
    assert ends is not None
    assert ends[0] == pytest.approx(0, abs=1e-9), "at the level of the p of the slope"
    assert verdict(along_knob(-4.0), check) == "contradicted"
    level = check_of("within", along=along, accepted=(-0.5, 0.5))
    assert verdict(along_knob(0.0), level) == "reproduced"
    assert verdict(along_knob(4.0), level) == "contradicted"


@pytest.mark.parametrize(
    ("knobs", "expected"),
    [
        ((0.0, 0.1, 0.26, 0.3, 0.4, 0.44, 0.6, 0.7), "reproduced"),
        ((0.0, 0.1, 0.27, 0.3, 0.4, 0.44, 0.6, 0.7), "undecided"),  # the outer thirds end at 0.267
        ((0.0, 0.1, 0.26, 0.3, 0.4, 0.43, 0.6, 0.7), "undecided"),  # and begin at 0.433
        ((0.0, 0.1, 0.2, 0.25, 0.26, 0.2, 0.1, 0.7), "undecided"),
    ],
)
def test_a_line_needs_three_scenes_in_each_outer_third(knobs: tuple[float, ...], expected: str) -> None:
    """Between 0.1 and 0.6 or beyond; the line itself is as certain in all of them."""
    lead = 3 + 40 * np.array(knobs)
    rows = {"mine": {"psnr": list(BASE + lead + SPREAD / 100)}, "theirs": {"psnr": list(BASE)}}
    run = run_of(rows, [scene_of(i, offset=k) for i, k in enumerate(knobs)])
    found = judged(run, check_of(along=Along("offset", 0.1, 0.6))).checks[0]
    line: Any = stats.linregress(knobs, lead + SPREAD / 100)
    assert found.verdict == expected
    assert found.estimate == pytest.approx(0.5 * line.slope)
    said = "a line needs 3 scenes towards either value of offset"
    assert (said in found.reason) == (expected == "undecided")
    assert (found.interval == (-math.inf, math.inf)) == (expected == "undecided")


def test_a_row_that_is_not_fitted_is_the_same_with_every_seed() -> None:
    """It is run once; beside two seeds of the other row it is as if it were run twice."""
    effects = np.stack([5 + SPREAD, 5.4 + 2 * SPREAD], axis=1)
    twice = fitted(seeded(effects))
    once = replace(
        twice, results=tuple(r for r in twice.results if r.job.method == "mine" or r.job.seed == 0)
    )
    assert len(once.results) < len(twice.results)
    found = judged(once, check_of())
    assert found == judged(twice, check_of())
    assert found.checks[0].noise_from == "2 seeds of this run"
    assert list(found.checks[0].scenes.values()) == pytest.approx(list(effects.mean(axis=1)))


def test_fitted_rows_of_unlike_numbers_of_seeds_are_compared_by_their_means() -> None:
    effects = np.stack([5 + SPREAD, 5.4 + 2 * SPREAD], axis=1)
    twice = fitted(seeded(effects), rows=("mine", "theirs"))
    uneven = replace(
        twice, results=tuple(r for r in twice.results if r.job.method == "mine" or r.job.seed == 0)
    )
    found = judged(uneven, check_of())
    assert list(found.checks[0].scenes.values()) == pytest.approx(list(effects.mean(axis=1)))
    assert (found.checks[0].noise_from, found.stability) == ("", None)
    assert found.suspended == "nobody measured how far fits of these rows differ"


def test_a_knob_that_no_scene_differs_in() -> None:
    rows = {"mine": {"psnr": values(1)}, "theirs": {"psnr": values(0)}}
    check = check_of(along=Along("offset", 0.1, 0.6))
    same = run_of(rows, [scene_of(i, offset=0.25) for i in range(8)])
    assert "scenes that differ in offset, got 0.25 in all" in judged(same, check).text
    assert "the run does not tell the knob offset of s0" in judged(run_of(rows), check).text


def test_scenes_are_chosen_by_family_and_knob() -> None:
    spread = np.concatenate([SPREAD, SPREAD])
    corridor = spread > 0
    rows = {"mine": 5 * np.sign(spread), "theirs": 0 * spread, "gray": spread}
    scenes = [
        scene_of(i, "corridor" if here else "shelf", gloss=float(here)) for i, here in enumerate(corridor)
    ]
    run = run_of({row: {"psnr": list(map(float, found))} for row, found in rows.items()}, scenes)
    assert verdict(run, check_of()) == "undecided"
    corridors = judged(run, check_of(scenes=Scenes(("corridor",)))).checks[0]
    assert (corridors.verdict, corridors.interval) == ("reproduced", (5.0, 5.0))
    assert list(corridors.scenes) == [f"s{i}" for i in range(16) if corridor[i]]
    assert verdict(run, check_of(scenes=Scenes(knobs={"gloss": (0.0, 0.5)}))) == "contradicted"
    assert corridors.trivial is not None
    assert corridors.trivial.value == pytest.approx(spread[corridor].mean())
    assert "has no psnr on scenes that this is about" in judged(run, check_of(scenes=Scenes(("lab",)))).text


@pytest.mark.parametrize("scenes", [1, 2, 5])
def test_few_scenes_leave_it_open(scenes: int) -> None:
    found = judged(even_run(scenes), check_of(paper=5.0))
    assert found.verdict == "undecided"
    assert f"(−∞ to ∞, {scenes} scenes); an interval at 95 % needs 6 scenes" in found.text
    line = check_of(along=Along("offset", 0.1, 0.6))
    places = [scene_of(i, offset=float(i)) for i in range(2)]
    two = run_of({row: {"psnr": [2.0] * 2} for row in ("mine", "theirs")}, places)
    assert "a line needs 3 scenes, got 2: s0, s1" in judged(two, line).text


@pytest.mark.parametrize(
    ("run", "reason"),
    [
        (run_with(mine=values(5)), "the run has no row theirs"),
        (run_with(mine=[*values(5)[:-1], None], theirs=values(0)), "mine psnr failed on s7 (black)"),
        (run_with(mine=values(5)[:-1], theirs=values(0)), "mine was not run on s7"),
        (run_with(mine=[math.inf] * 8, theirs=values(0)), "a score is infinite"),
        (without_metrics(against(5), "psnr"), "the run has no metric psnr"),
    ],
)
def test_what_cannot_be_tested_says_why(run: RunRecord, reason: str) -> None:
    found = judged(run, check_of(paper=5.0))
    assert found.verdict == "not testable here"
    assert reason in found.text
    assert found.checks[0].accepted == (2.5, 10)  # what it would ask for is told all the same


def test_a_job_that_failed_is_no_scene_less() -> None:
    run = against(5)
    failed = replace(run.results[-1], status="failed", reason="it ran out of memory", sheet=None)
    found = judged(replace(run, results=(*run.results[:-1], failed)), check_of())
    assert found.verdict == "not testable here"
    assert "theirs failed on s7: it ran out of memory" in found.text


def test_a_seed_that_failed_is_not_averaged_away() -> None:
    once = against(5)
    again = [result_of("mine", n, {"psnr": None if n == 3 else 30.0}, seed=1) for n in range(8)]
    found = judged(replace(once, results=(*once.results, *again)), check_of())
    assert found.verdict == "not testable here"
    assert "mine psnr failed on s3 (black)" in found.text


def test_a_score_that_others_have_there_is_missing() -> None:
    rows = {"mine": {"error": [0.1] * 4, "psnr": values(1)[:3]}, "theirs": {"psnr": values(0)[:4]}}
    found = judged(run_of(rows), check_of())
    assert found.verdict == "not testable here"
    assert "mine has no psnr on s3" in found.text


def test_scenes_that_do_not_have_the_metric_are_not_meant() -> None:
    rows = {row: {"error": [e] * 6, "psnr": values(0)} for row, e in (("mine", 0.1), ("theirs", 0.4))}
    rows["bound"] = {"error": [0.0] * 6, "psnr": values(9)}
    found = judged(run_of(rows), check_of(expects="lower", quantity=Quantity("error"))).checks[0]
    assert (found.verdict, list(found.scenes)) == ("reproduced", [f"s{i}" for i in range(6)])
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
