# SPDX-License-Identifier: Apache-2.0
"""The first screen: for each part of a decomposition and each track who is best, by how much, how surely."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import graycard as gc
from graycard.reports._format import format_name
from graycard.reports._help import MetricHead, metric_head
from graycard.reports._verdicts import Verdict

_PARTS = {"counterfactual": "Removal", "normal": "Geometry (normals)", "depth": "Geometry (depth)"}


@dataclass(frozen=True, slots=True)
class SummaryCell:
    """The best method of one part on one track."""

    track: str
    anchor: str
    """Where its leaderboard stands."""
    verdict: Verdict | None
    """None where the track has no such part."""


@dataclass(frozen=True, slots=True)
class SummaryRow:
    """One part of a decomposition by its metric."""

    part: str
    metric: MetricHead
    cells: tuple[SummaryCell, ...]


def part_of(group: str) -> str:
    """The part of a decomposition that a group of metrics judges, in words."""
    return _PARTS.get(group, format_name(group))


def summary_rows(
    metrics: Sequence[gc.MetricRecord],
    verdicts: Mapping[tuple[str, str], Verdict],
    tracks: Sequence[tuple[str, str]],
) -> tuple[SummaryRow, ...]:
    """A row for each group of metrics that has a headline metric; for each group, where none is a headline.

    Args:
        metrics: Of the run.
        verdicts: By track and id of the metric.
        tracks: Names and anchors.
    """
    seen = [m for m in metrics if any((track, m.id) in verdicts for track, _ in tracks)]
    seen = [m for m in seen if m.headline] or seen
    rows = []
    for group in dict.fromkeys(m.group for m in seen):
        chosen = next(m for m in seen if m.group == group)
        cells = tuple(SummaryCell(t, anchor, verdicts.get((t, chosen.id))) for t, anchor in tracks)
        rows.append(SummaryRow(part_of(group), metric_head(chosen), cells))
    return tuple(rows)
