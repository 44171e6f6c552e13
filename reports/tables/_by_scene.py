# SPDX-License-Identifier: Apache-2.0
"""One metric by method and scene: where each method is worst."""

from collections.abc import Sequence
from dataclasses import dataclass

from graycard.records import JobResult, MetricRecord
from graycard.reports.tables._cells import Cell, pool, read_metric
from graycard.reports.tables._help import MetricHead, metric_head
from graycard.reports.tables._tables import MethodHead


@dataclass(frozen=True, slots=True)
class SceneCells:
    """One method in every scene."""

    method: MethodHead
    cells: tuple[Cell, ...]
    worst: int
    """Index of its worst scene; −1 where no two scenes differ as they are shown."""


@dataclass(frozen=True, slots=True)
class SceneTable:
    """One metric."""

    metric: MetricHead
    rows: tuple[SceneCells, ...]


def scene_tables(
    results: Sequence[JobResult],
    scenes: Sequence[str],
    methods: Sequence[MethodHead],
    metrics: Sequence[MetricRecord],
) -> tuple[SceneTable, ...]:
    """Return a table for each metric: a row a method, a column a scene, the mean over seeds in a cell."""
    found: dict[tuple[str, str], list[JobResult]] = {}
    for result in results:
        found.setdefault((result.job.method, result.job.scene), []).append(result)
    return tuple(
        SceneTable(
            metric_head(metric),
            tuple(
                _row(head, [found.get((head.name, scene), []) for scene in scenes], metric)
                for head in methods
            ),
        )
        for metric in metrics
    )


def _row(head: MethodHead, jobs: Sequence[Sequence[JobResult]], metric: MetricRecord) -> SceneCells:
    cells = tuple(pool([read_metric(r, metric.id) for r in own], metric.unit) for own in jobs)
    values = [(cell.value, i) for i, cell in enumerate(cells) if cell.value is not None]
    pick = min if metric.higher_is_better else max
    differ = len({cell.text for cell in cells if cell.value is not None}) > 1
    return SceneCells(head, cells, pick(values)[1] if differ else -1)
