# SPDX-License-Identifier: Apache-2.0
"""The first screen: for each part of a decomposition and each track who is best, by how much, how surely."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

from graycard.records import MetricRecord
from graycard.reports._format import format_name
from graycard.reports._tracks import words_of
from graycard.reports.tables._help import MetricHead, metric_head
from graycard.reports.tables._verdicts import LeaderVerdict

_PARTS = {"counterfactual": "Removal", "normal": "Geometry (normals)", "depth": "Geometry (depth)"}


@dataclass(frozen=True, slots=True)
class SummaryCell:
    """The best method of one part on one track."""

    track: str
    anchor: str
    """Anchor of its leaderboard."""
    verdict: LeaderVerdict | None
    """None where the track has no such part."""


@dataclass(frozen=True, slots=True)
class SummaryRow:
    """One part of a decomposition by its metric."""

    part: str
    metric: MetricHead
    cells: tuple[SummaryCell, ...]


def part_of(group: str) -> str:
    """Return the part of a decomposition that a group of metrics judges, in words."""
    return _PARTS.get(group, format_name(group))


def summary_rows(
    metrics: Sequence[MetricRecord],
    verdicts: Mapping[tuple[str, str], LeaderVerdict],
    tracks: Sequence[tuple[str, str]],
    left_out: Collection[tuple[str, str]] = (),
) -> tuple[tuple[SummaryRow, ...], str]:
    """Return a row for each group of metrics that has a headline metric, and for each that a track asks for
    itself.

    Where no metric is a headline, each group has a row.

    Args:
        metrics: Of the run.
        verdicts: By track and id of the metric.
        tracks: Names and anchors.
        left_out: Tracks and metrics that no competing method provides there.

    Returns:
        The rows, and the titles of the metrics that have none as they are left out on all tracks.
    """
    own = {name: part for track, _ in tracks for name, part in words_of(track).headline.items()}
    told: list[SummaryRow] = []
    silent: list[str] = []
    for metric in _chosen(metrics, {name for _, name in verdicts}, own):
        found = {track: verdicts.get((track, metric.id)) for track, _ in tracks}
        if all((track, metric.id) in left_out for track, verdict in found.items() if verdict):
            silent.append(metric.title)
            continue
        cells = tuple(SummaryCell(track, anchor, found[track]) for track, anchor in tracks)
        told.append(SummaryRow(own.get(metric.id, part_of(metric.group)), metric_head(metric), cells))
    return tuple(told), "; ".join(silent)  # titles have commas


def _chosen(
    metrics: Sequence[MetricRecord], judged: Collection[str], own: Collection[str]
) -> list[MetricRecord]:
    """Return for each group its first headline metric, then those that a track asks for itself."""
    seen = [m for m in metrics if m.id in judged]
    general = [m for m in seen if m.headline] or seen
    first = {m.group: m for m in reversed(general)}
    more = [m for m in seen if m.id in own and m is not first.get(m.group)]
    groups = dict.fromkeys(m.group for m in [*general, *more])
    return [m for g in groups for m in ([first[g]] if g in first else []) + [n for n in more if n.group == g]]
