# SPDX-License-Identifier: Apache-2.0
"""Comparison of one track, as its tables show it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from graycard.records import Comparison, MethodStanding, MetricComparison, MetricRecord, RunRecord
from graycard.reports._format import format_value
from graycard.reports.tables._cells import Cell, mean_over_scenes, read_metric
from graycard.reports.tables._intervals import Axis, axis_of_standings, interval_plot
from graycard.reports.tables._verdicts import LeaderVerdict, judge, judge_without_intervals, standing_note


@dataclass(frozen=True, slots=True)
class Compared:
    """The methods of a track by each metric."""

    verdicts: Mapping[str, LeaderVerdict]
    """By metric."""
    standings: Mapping[tuple[str, str], MethodStanding]
    """By metric and method."""
    axes: Mapping[str, Axis | None]
    """By metric: of its interval plots. Variants may lie beyond."""
    units: Mapping[str, str]
    """By metric."""

    def dress(self, cell: Cell, metric: str, method: str) -> Cell:
        """Return a cell with its interval plot, and with the verdict in words where it concerns
        this method.
        """
        standing = self.standings.get((metric, method))
        if standing is None or cell.status != "scored":
            return cell
        note = standing_note(standing, self.verdicts[metric])
        notes = (note, *cell.notes) if note else cell.notes
        plot = interval_plot(standing, self.axes[metric])
        return replace(self.bound(cell, metric, method), notes=notes, standing=note, plot=plot)

    def bound(self, cell: Cell, metric: str, method: str) -> Cell:
        """Return a cell of a mean with the ends of its interval, where that is known."""
        standing = self.standings.get((metric, method))
        if standing is None or standing.interval is None or cell.status != "scored":
            return cell
        low, high = (format_value(end, self.units[metric]) for end in standing.interval)
        return replace(cell, interval=(low, high))


def compare_track(
    comparison: Comparison | None,
    record: RunRecord,
    track: str,
    metrics: Sequence[MetricRecord],
) -> Compared:
    """Return the methods of a track by each of some metrics.

    A run that an older graycard made has no comparison: then there are means, and no intervals.
    """
    verdicts: dict[str, LeaderVerdict] = {}
    standings: dict[tuple[str, str], MethodStanding] = {}
    axes: dict[str, Axis | None] = {}
    variants = record.variants_on(track)
    for metric in metrics:
        found = _find(comparison, track, metric.id)
        methods = found.methods if found else _bare_standings(record, track, metric.id)
        standings |= {(metric.id, m.method): m for m in methods}
        own = [m for m in methods if m.method not in variants]
        axes[metric.id] = axis_of_standings(own, metric.unit) or axis_of_standings(methods, metric.unit)
        verdicts[metric.id] = (
            judge(metric, found, comparison, variants)
            if found and comparison
            else judge_without_intervals(metric, methods, variants)
        )
    return Compared(verdicts, standings, axes, {metric.id: metric.unit for metric in metrics})


def _find(comparison: Comparison | None, track: str, metric: str) -> MetricComparison | None:
    for found in comparison.metrics if comparison else ():
        if (found.track, found.metric) == (track, metric):
            return found
    return None


def _bare_standings(record: RunRecord, track: str, metric: str) -> list[MethodStanding]:
    """Means without intervals, of methods that have a score."""
    competes = {m.name: not m.sees for m in record.methods}
    results = [r for r in record.results if r.job.track == track]
    found = []
    for method in dict.fromkeys(r.job.method for r in results):
        readings = [read_metric(r, metric) for r in results if r.job.method == method]
        scored = [(r.scene, r.value) for r in readings if r.status == "scored" and r.value is not None]
        if not scored:
            continue
        ceilings = [(r.scene, r.noise_ceiling) for r in readings if r.noise_ceiling is not None]
        whole = {r.scene for r in readings} - {r.scene for r in readings if r.status != "scored"}
        found.append(
            MethodStanding(
                method,
                competes.get(method, True),
                scenes=len(whole),
                expected=len({r.job.scene for r in results}),
                seeds=1,
                mean=mean_over_scenes(scored),
                ceiling=mean_over_scenes(ceilings) if ceilings else None,
            )
        )
    return found
