# SPDX-License-Identifier: Apache-2.0
"""A made-up run of any size on disk: numbers without meaning, no scenes."""

from pathlib import Path

import numpy as np

from graycard.io import write_json
from graycard.records import (
    Job,
    JobResult,
    MethodRecord,
    MetricRecord,
    RunRecord,
    SceneRecord,
    Score,
    ScoreSheet,
)


def write_made_up(run: Path, rows: int, scenes: int, metrics: int = 30, views: int = 3) -> RunRecord:
    """Write ``run.json`` of rows in families of four, each on every scene."""
    rng = np.random.default_rng(0)
    groups = ("albedo", "novel_view", "normal", "depth", "light", "relighting")
    measured = tuple(
        MetricRecord(f"m{i}", f"Metric {i}", groups[i % 6], "dB", True, float("inf"), "as said", i < 6, 0.3)
        for i in range(metrics)
    )
    methods = tuple(
        MethodRecord(f"row-{i}", f"Row {i}, made up", (), f"row-{i - i % 4}") for i in range(rows)
    )
    records = tuple(
        SceneRecord("dark", f"scene-{i}", "made-up", i, f"dataset/dark/scene-{i}", "", f"A scene, number {i}")
        for i in range(scenes)
    )
    results = []
    for scene in records:
        for row, method in enumerate(methods):
            values = 20 + row / 10 + rng.normal(size=(metrics, views))
            scores = tuple(
                Score(
                    metric.id, "graycard-0", "scored", float(own.mean()), "dB", True, float("inf"),
                    per_view={f"view-{i}": float(value) for i, value in enumerate(own)},
                )
                for metric, own in zip(measured, values, strict=True)
            )  # fmt: skip
            sheet = ScoreSheet("dark", scene.scene, method.name, "", "", scores)
            results.append(
                JobResult(Job("dark", scene.scene, method.name, 0, {}), "", "", "done", sheet=sheet)
            )
    record = RunRecord(
        "made-up", 1, records, methods, measured, tuple(results), {}, "2026-11-26T00:00:00+00:00", 1.0
    )
    write_json(run / "run.json", record)
    return record
