# SPDX-License-Identifier: Apache-2.0
"""Run records whose numbers are written down, so that what is true of them is known."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

from graycard.records import (
    Cost,
    Job,
    JobResult,
    MethodRecord,
    MetricRecord,
    RunRecord,
    SceneRecord,
    Score,
    ScoreSheet,
)

METRICS = (
    MetricRecord("psnr", "PSNR", "novel_view", "dB", True, math.inf, "", True, 0.3),
    MetricRecord("train", "Training PSNR", "training_view", "dB", True, math.inf, "", False, 0.3),
    MetricRecord("error", "Error", "depth", "1", False, 0.0, "", False, 0.01),
)

Values = Sequence[float | None]
Table = Mapping[str, Mapping[str, Values]]
"""By row and metric: a value a scene; None has failed."""


def scene_of(number: int, family: str = "corridor", **knobs: float) -> SceneRecord:
    return SceneRecord("dark", f"s{number}", family, number, "", "", "", knobs)


def score_of(metric: MetricRecord, value: float | None) -> Score:
    status, reason = ("scored", "") if value is not None else ("failed", "black")
    facts = metric.unit, metric.higher_is_better, metric.optimum
    return Score(metric.id, "graycard-1", status, value, *facts, reason=reason)  # pyright: ignore


def result_of(
    row: str, scene: int, values: Mapping[str, float | None], seed: int = 0, cost: Cost | None = None
) -> JobResult:
    by_id = {metric.id: metric for metric in METRICS}
    scores = tuple(score_of(by_id[name], value) for name, value in values.items())
    sheet = ScoreSheet("dark", f"s{scene}", row, "", "", scores)
    job = Job("dark", f"s{scene}", row, seed, {})
    return JobResult(job, "", "", "done", sheet=sheet, cost=cost)


def run_of(
    table: Table,
    scenes: Sequence[SceneRecord] | None = None,
    costs: Mapping[str, Cost] | None = None,
) -> RunRecord:
    """A run of one seed; scenes are named s0, s1, ... in the order of the values."""
    results = []
    for row, metrics in table.items():
        count = max(len(values) for values in metrics.values())
        for number in range(count):
            here = {name: values[number] for name, values in metrics.items() if number < len(values)}
            results.append(result_of(row, number, here, cost=(costs or {}).get(row)))
    places = sorted({result.job.scene for result in results}, key=lambda name: int(name[1:]))
    return RunRecord(
        "hand",
        1,
        tuple(scenes) if scenes else tuple(scene_of(int(name[1:])) for name in places),
        tuple(MethodRecord(row, f"what {row} is", ()) for row in table),
        METRICS,
        tuple(results),
        {},
        "2026-11-21T09:47:14+00:00",
        1.0,
    )


def without_metrics(run: RunRecord, *names: str) -> RunRecord:
    """The run of a graycard that does not have some metrics."""
    return replace(run, metrics=tuple(m for m in run.metrics if m.id not in names))
