# SPDX-License-Identifier: Apache-2.0
"""Best methods of a run, track by track, for the end of a bench."""

from __future__ import annotations

from pathlib import Path

from rich.table import Table

from graycard._errors import RecordError
from graycard.cli._terminal import Terminal, new_table
from graycard.records import MetricComparison, MetricRecord, RunRecord, read_comparison

MOST_ROWS, MOST_METRICS = 8, 5
"""Rows and columns of a table: the first screen answers, `graycard compare` has all."""


def show_standings(run: Path, record: RunRecord, terminal: Terminal) -> None:
    """Print a table for each track: competing methods by the headline metrics, the best first.

    A run without a comparison that can be read has none.
    """
    try:
        comparison = read_comparison(run)
    except RecordError:
        return
    if comparison is None:
        return
    tables, least = comparison.metrics, comparison.least_scenes
    by_id = {metric.id: metric for metric in record.metrics if metric.headline}
    for track in dict.fromkeys(scene.track for scene in record.scenes):
        of_track = [t for t in tables if t.track == track and t.metric in by_id and _means(t)]
        if of_track:
            terminal.out.print(standings(track, of_track[:MOST_METRICS], by_id))
    few = {track for track in (s.track for s in record.scenes) if _scenes(record, track) < least}
    if few and tables:
        where = ", ".join(sorted(few))
        terminal.out.print(
            f"best first, * best of a column; {where}: fewer than {least} scenes decide nothing"
        )


def standings(track: str, tables: list[MetricComparison], metrics: dict[str, MetricRecord]) -> Table:
    """Return one track's table, ordered by the mean place over its columns."""
    means = {table.metric: _means(table) for table in tables}
    places: dict[str, list[int]] = {}
    for name, found in means.items():
        for place, row in enumerate(_ordered(found, metrics[name])):
            places.setdefault(row, []).append(place)
    order = sorted(places, key=lambda row: (sum(places[row]) / len(places[row]), -len(places[row])))
    shown = new_table(track, *(_head(metrics[name]) for name in means))
    for row in order[:MOST_ROWS]:
        shown.add_row(row, *(_cell(row, found, metrics[name]) for name, found in means.items()))
    if len(order) > MOST_ROWS:
        shown.add_row(f"and {len(order) - MOST_ROWS} more", *[""] * len(means))
    return shown


def _head(metric: MetricRecord) -> str:
    """Return the title up to its first comma, and the unit in short."""
    return f"{metric.title.partition(',')[0]}, {metric.unit.partition(' of ')[0]}"


def _means(table: MetricComparison) -> dict[str, float]:
    """Return the means of the methods that compete and have one."""
    return {row.method: row.mean for row in table.methods if row.competes and row.mean is not None}


def _ordered(means: dict[str, float], metric: MetricRecord) -> list[str]:
    return sorted(means, key=means.__getitem__, reverse=metric.higher_is_better)


def _cell(row: str, means: dict[str, float], metric: MetricRecord) -> str:
    if row not in means:
        return ""
    best = _ordered(means, metric)[0] == row and len(means) > 1
    return f"{means[row]:.4g}{' *' * best}"


def _scenes(record: RunRecord, track: str) -> int:
    return sum(scene.track == track for scene in record.scenes)
