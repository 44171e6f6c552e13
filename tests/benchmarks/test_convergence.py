# SPDX-License-Identifier: Apache-2.0
"""Curves over a budget: which rows belong to one, what a doubling gains, and where it no longer counts."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import pytest

from graycard import RecordError
from graycard.benchmarks.convergence import ENOUGH, Curve, convergence_plot, curves_of
from graycard.cli import main
from graycard.io import read_json, write_json
from graycard.records import Cost, Job, JobResult, MethodRecord, MetricRecord, RunRecord, ScoreSheet
from runs_by_hand import scene_of, score_of

VIEWS, ALBEDO = "novel_view.psnr", "albedo.psnr.channel"
METRICS = tuple(MetricRecord(name, name, "", "dB", True, math.inf, "", True, 0.3) for name in (VIEWS, ALBEDO))
BY_ID = {metric.id: metric for metric in METRICS}


def fitted(
    scene: int, settings: Mapping[str, int], values: Mapping[str, float | None], seed: int = 0
) -> JobResult:
    row = f"mine-{settings}"
    scores = tuple(score_of(BY_ID[name], value) for name, value in values.items())
    job = Job("dark", f"s{scene}", row, seed, dict(settings), "mine", {"source": "none"})
    sheet = ScoreSheet("dark", job.scene, row, "", "", scores)
    return JobResult(job, "", "", "done", sheet=sheet, cost=Cost(settings["iterations"] / 10, 1.0))


def run_of(*results: JobResult) -> RunRecord:
    rows = tuple(MethodRecord(row, "", ()) for row in dict.fromkeys(r.job.method for r in results))
    scenes = tuple(scene_of(n) for n in range(2))
    return RunRecord("hand", 1, scenes, rows, METRICS, results, {}, "2026-11-25T00:00:00+00:00", 1.0)


def over_steps(views: Sequence[float], scenes: int = 2) -> list[JobResult]:
    """Return fits with 500, 1000, 2000, ... steps; the second scene is 10 dB easier."""
    return [
        fitted(scene, {"iterations": 500 * 2**number, "surfels": 5000}, {VIEWS: value + 10 * scene})
        for number, value in enumerate(views)
        for scene in range(scenes)
    ]


def only_curve(*results: JobResult) -> Curve:
    (curve,) = curves_of(run_of(*results))
    return curve


def test_rows_that_differ_in_one_budget_are_one_curve():
    more = [fitted(0, {"iterations": 500, "surfels": 10000}, {VIEWS: 22.0})]
    steps, surfels = curves_of(run_of(*over_steps([20.0, 21.0], scenes=1), *more))
    assert (steps.axis, steps.fixed, [p.budget for p in steps.points]) == (
        "iterations",
        {"surfels": 5000},
        [500, 1000],
    )
    assert (surfels.axis, surfels.fixed, [p.budget for p in surfels.points]) == (
        "surfels",
        {"iterations": 500},
        [5000, 10000],
    )


def test_rows_with_other_priors_are_another_curve():
    results = over_steps([20.0, 21.0])
    other = [replace(r, job=replace(r.job, priors={"source": "oracle"})) for r in over_steps([30.0, 31.0])]
    curves = curves_of(run_of(*results, *other))
    assert [curve.points[0].mean(VIEWS) for curve in curves] == [25.0, 35.0]


def test_gains_are_paired_by_scene_and_counted_a_doubling():
    results = over_steps([20.0, 21.0])
    (gain,) = only_curve(*results).gains(VIEWS)
    assert (gain.mean, gain.error, gain.scenes) == (1.0, 0.0, 2)
    fourfold = [
        replace(r, job=replace(r.job, settings={"iterations": 4 * r.job.settings["iterations"]}))
        for r in results
        if r.job.settings["iterations"] == 1000
    ]
    first = [
        replace(r, job=replace(r.job, settings={"iterations": 500}))
        for r in results
        if r.job.settings["iterations"] == 500
    ]
    (gain,) = only_curve(*first, *fourfold).gains(VIEWS)
    assert gain.mean == pytest.approx(1 / 3), "4000 of 500 are three doublings"


@pytest.mark.parametrize(
    ("views", "budget"),
    [
        ((20.0, 21.0, 21.1, 21.1), 1000),
        ((20.0, 20.1, 21.1, 21.1), 2000),
        ((20.0, 21.0, 22.0, 23.0), None),
        ((20.0, 20.1, 20.2, 20.3), 500),
        ((20.0, 21.0, 20.5, 20.0), 1000),
    ],
    ids=["flat from 1000", "a late rise counts", "still rises", "flat from the start", "gets worse"],
)
def test_a_curve_has_converged_where_no_later_doubling_counts(views: tuple[float, ...], budget: int | None):
    assert only_curve(*over_steps(views)).converged_at == budget


def test_albedo_has_to_converge_as_well():
    values = ((20.0, 18.0), (20.1, 18.5), (20.1, 18.6))
    results = [
        fitted(0, {"iterations": 500 * 2**n}, {VIEWS: views, ALBEDO: albedo})
        for n, (views, albedo) in enumerate(values)
    ]
    curve = only_curve(*results)
    assert curve.converged_at == 1000
    last = curve.slope(ALBEDO)
    assert last is not None
    assert last.mean == pytest.approx(0.1)
    assert last.is_small
    assert ENOUGH[ALBEDO] == 0.3


def test_a_scene_that_failed_at_one_budget_counts_at_none():
    results = over_steps([20.0, 21.0])
    broken = [replace(r, status="failed", sheet=None) if r.job.scene == "s1" else r for r in results[2:]]
    curve = only_curve(*results[:2], *broken)
    assert [point.mean(VIEWS) for point in curve.points] == [20.0, 21.0]


def test_seeds_of_a_scene_are_averaged_first():
    budgets = (500, 1000)
    first = [fitted(0, {"iterations": b}, {VIEWS: 20.0}) for b in budgets]
    second = [fitted(0, {"iterations": b}, {VIEWS: 24.0}, seed=1) for b in budgets]
    other = [fitted(1, {"iterations": b}, {VIEWS: 30.0}) for b in budgets]
    assert only_curve(*first, *second, *other).points[0].mean(VIEWS) == 26.0


def test_a_score_that_is_missing_is_no_gain():
    results = [fitted(0, {"iterations": b}, {VIEWS: 20.0, ALBEDO: a}) for b, a in ((500, None), (1000, 20.0))]
    assert only_curve(*results).gains(ALBEDO) == []


def test_a_run_without_a_curve_is_refused():
    with pytest.raises(RecordError, match="expected rows of run 'hand' that differ in .* alone, got none"):
        curves_of(run_of(*over_steps([20.0])))


@pytest.fixture
def run(tmp_path: Path) -> Path:
    write_json(tmp_path / "run" / "run.json", run_of(*over_steps([20.0, 21.0, 21.1])))
    return tmp_path / "run"


def test_the_verb_shows_gains_and_where_a_curve_has_converged(
    run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    assert main(["convergence", str(run), "--json", str(tmp_path / "c.json")]) == 0
    shown = capsys.readouterr().out
    assert "+1.00 ± 0.00" in shown
    assert "converged from 1000 iterations on" in shown
    (curve,) = read_json(tmp_path / "c.json")["result"]
    assert [point["budget"] for point in curve["points"]] == [500, 1000, 2000]


def test_the_verb_says_with_which_slope_a_curve_has_not_converged(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    write_json(tmp_path / "run.json", run_of(*over_steps([20.0, 21.5])))
    assert main(["convergence", str(tmp_path)]) == 0
    assert "not converged at 1000 iterations; the last doubling gains +1.50" in capsys.readouterr().out


def test_the_picture_has_a_line_for_each_curve(run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    picture = tmp_path / "c.svg"
    assert main(["convergence", str(run), "--plot", str(picture)]) == 0
    assert any("mine" in str(e.text) for e in ElementTree.parse(picture).iter())
    assert main(["convergence", str(run), "--plot", str(tmp_path / "c.png")]) == 2
    assert "expected --plot with a name that ends in .svg" in capsys.readouterr().err
    record = run_of(*over_steps([20.0, 21.0]))
    assert convergence_plot(curves_of(record), METRICS) == convergence_plot(curves_of(record), METRICS)
