# SPDX-License-Identifier: Apache-2.0
"""The arithmetic of the gate; tests/benchmarks/test_bench.py runs it on real run folders."""

import math
from dataclasses import replace
from pathlib import Path

import pytest

from graycard import RecordError
from graycard.benchmarks import judge, make_baseline, read_baseline, write_baseline
from graycard.io import write_json
from graycard.records import Job, JobResult, MethodRecord, MetricRecord, RunRecord, Score, ScoreSheet

METRICS = (
    MetricRecord("psnr", "PSNR", "novel view", "dB", True, math.inf, "", True, 0.5),
    MetricRecord("angle", "Angle", "normal", "°", False, 0.0, "", True, 0.2),
)


def make_run(psnr: float | None = 30.0, angle: float | None = 10.0, status: str = "scored") -> RunRecord:
    scores = (
        Score("psnr", "graycard-0", status if psnr is None else "scored", psnr, "dB", True, math.inf),  # pyright: ignore
        Score("angle", "graycard-0", status if angle is None else "scored", angle, "°", False, 0.0),  # pyright: ignore
    )
    sheet = ScoreSheet("dark", "s", "m", "", "", scores)
    result = JobResult(Job("dark", "s", "m", 0, {}), "h", "jobs/x", "done", sheet=sheet)
    return RunRecord("demo", 1, (), (), METRICS, (result,), {}, "2026-01-01T00:00:00+00:00", 1.0)


def test_a_run_that_does_not_say_what_its_metrics_are_makes_no_baseline():
    run = replace(make_run(), metrics=METRICS[:1])
    with pytest.raises(RecordError, match="expected a run that says what its metrics are, got none of angle"):
        make_baseline(run)


@pytest.mark.parametrize(
    ("psnr", "angle", "code", "worse", "better"),
    [
        (30.0, 10.0, 0, [], []),
        (29.6, 10.1, 0, [], []),  # within tolerance
        (29.4, 10.0, 1, ["psnr"], []),
        (31.0, 10.3, 1, ["angle"], ["psnr"]),
        (math.inf, 0.0, 0, [], ["psnr", "angle"]),
        (math.nan, 10.0, 2, [], []),
    ],
)
def test_worse_is_a_matter_of_direction(
    psnr: float, angle: float, code: int, worse: list[str], better: list[str]
):
    verdict = judge(make_run(psnr, angle), make_baseline(make_run()))
    assert verdict.exit_code == code
    assert [c.expected.metric for c in verdict.worse] == worse
    assert [c.expected.metric for c in verdict.better] == better


def test_a_method_may_be_given_slack():
    methods = (MethodRecord("m", "", (), slack=4.0),)
    slack = make_baseline(replace(make_run(), methods=methods))
    assert judge(make_run(28.1, 10.7), slack).exit_code == 0
    assert [c.expected.metric for c in judge(make_run(27.9, 10.7), slack).worse] == ["psnr"]


def test_an_infinite_score_must_stay_infinite():
    baseline = make_baseline(make_run(math.inf, 0.0))
    assert judge(make_run(math.inf, 0.0), baseline).exit_code == 0
    assert judge(make_run(120.0, 0.0), baseline).exit_code == 1


@pytest.mark.parametrize("status", ["failed", "not provided"])
def test_a_score_that_is_gone_is_missing_not_fine(status: str):
    verdict = judge(make_run(None, 10.0, status), make_baseline(make_run()))
    assert verdict.exit_code == 2
    assert str(verdict.missing[0]) == f"dark/s m psnr: expected 30, got no score ({status})"


def test_a_run_without_results_measured_nothing():
    empty = replace(make_run(), results=())
    verdict = judge(empty, make_baseline(make_run()))
    assert (verdict.exit_code, verdict.compared) == (2, 0)
    assert judge(make_run(), replace(make_baseline(make_run()), scores=())).exit_code == 2
    with pytest.raises(RecordError, match="expected a run with scores to make a baseline of"):
        make_baseline(empty)


def test_a_baseline_of_another_suite_is_refused():
    for other in (replace(make_run(), suite="smoke"), replace(make_run(), suite_version=2)):
        with pytest.raises(RecordError, match="expected a run of suite 'demo' version 1"):
            judge(other, make_baseline(make_run()))


def test_both_values_are_named():
    verdict = judge(make_run(20.0, 10.0), make_baseline(make_run()))
    assert str(verdict.worse[0]) == "dark/s m psnr: expected 30 dB (tolerance 0.5), got 20, -10 dB"


def test_round_trip_and_bad_baselines(tmp_path: Path):
    baseline = make_baseline(make_run(math.inf))
    write_baseline(tmp_path / "b.json", baseline)
    assert read_baseline(tmp_path / "b.json") == baseline
    write_json(tmp_path / "b.json", replace(baseline, format_version=9))
    with pytest.raises(RecordError, match="Install a newer graycard"):
        read_baseline(tmp_path / "b.json")
    for change in ({"value": math.nan}, {"tolerance": math.nan}, {"tolerance": -1.0}):
        spoilt = replace(baseline, scores=(replace(baseline.scores[0], **change),))
        write_json(tmp_path / "b.json", spoilt)
        with pytest.raises(RecordError, match="expected a value and a tolerance of 0 or more for m psnr"):
            read_baseline(tmp_path / "b.json")
    write_json(tmp_path / "b.json", {"suite": "demo", "suite_version": 1, "scors": []})
    with pytest.raises(RecordError, match="scors"):
        read_baseline(tmp_path / "b.json")
    with pytest.raises(RecordError, match="expected a JSON file at"):
        read_baseline(tmp_path / "none.json")
