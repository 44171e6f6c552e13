# SPDX-License-Identifier: Apache-2.0
"""Scores by held-out photographs as a table: a row for each method, a column for each metric."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

from graycard.records import MetricRecord, PhotographSheet, Score
from graycard.reports._format import format_value


@dataclass(frozen=True, slots=True)
class ScoreCell:
    """One number, or the word that stands there instead."""

    text: str
    status: str
    reason: str = ""
    note: str = ""
    best: bool = False
    """True if no other method has a better one; of a single method never."""


@dataclass(frozen=True, slots=True)
class ScoreHead:
    """A metric."""

    title: str
    unit: str
    arrow: str
    formula: str


@dataclass(frozen=True, slots=True)
class ScoreRow:
    """All numbers of one method, for all held-out views or one of them."""

    method: str
    view: str
    """Empty for all of them."""
    cells: tuple[ScoreCell, ...]


@dataclass(frozen=True, slots=True)
class ScoreTable:
    """The methods by all metrics."""

    heads: tuple[ScoreHead, ...]
    rows: tuple[ScoreRow, ...]
    by_view: tuple[ScoreRow, ...]


def score_table(named: Sequence[tuple[str, PhotographSheet]]) -> ScoreTable:
    """Return the table of methods, each with its scores by the same photographs."""
    metrics = named[0][1].metrics
    columns = [
        _marked([_cell(_score_of(sheet, m.id), m.unit) for _, sheet in named], named, m) for m in metrics
    ]
    rows = zip((name for name, _ in named), zip(*columns, strict=True), strict=True) if columns else ()
    return ScoreTable(
        tuple(map(_head, metrics)),
        tuple(ScoreRow(name, "", cells) for name, cells in rows),
        tuple(
            ScoreRow(name, view, tuple(_view_cell(_score_of(sheet, m.id), view, m.unit) for m in metrics))
            for name, sheet in named
            for view in dict.fromkeys(view for score in sheet.scores for view in score.per_view)
        ),
    )


def _head(metric: MetricRecord) -> ScoreHead:
    title = metric.title.removeprefix("Photographs ")  # the caption says so
    unit = "" if metric.unit == "1" else metric.unit
    return ScoreHead(title, unit, "↑" if metric.higher_is_better else "↓", metric.formula)


def _marked(
    cells: list[ScoreCell], named: Sequence[tuple[str, PhotographSheet]], metric: MetricRecord
) -> list[ScoreCell]:
    """Mark the best of several methods, all that are level with it."""
    scores = [_score_of(sheet, metric.id) for _, sheet in named]
    known = [score.value for score in scores if score and score.value is not None]
    if len(known) < 2:
        return cells
    best = max(known) if metric.higher_is_better else min(known)
    values = [score.value if score else None for score in scores]
    return [replace(cell, best=value == best) for cell, value in zip(cells, values, strict=True)]


def _score_of(sheet: PhotographSheet, metric: str) -> Score | None:
    return next((score for score in sheet.scores if score.metric == metric), None)


def _cell(score: Score | None, unit: str) -> ScoreCell:
    if score is None:
        return ScoreCell("–", "not provided")
    if score.value is None:
        return ScoreCell("–" if score.status == "not provided" else "failed", score.status, score.reason)
    text, taken = format_value(score.value, unit), score.breakdown.get("as_taken")
    as_taken = "" if taken is None else format_value(taken, unit)
    return ScoreCell(text, "scored", note=f"as taken {as_taken}" if as_taken not in ("", text) else "")


def _view_cell(score: Score | None, view: str, unit: str) -> ScoreCell:
    value = score.per_view.get(view) if score else None
    if value is None:
        return ScoreCell("–", "not provided")
    return ScoreCell(format_value(value, unit), "scored")
