# SPDX-License-Identifier: Apache-2.0
"""The tables of a track and of a scene, driven by the metric records alone."""

import math
from bisect import bisect_left
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

from graycard.records import JobResult, MetricRecord, RunRecord
from graycard.reports._format import format_value
from graycard.reports._priors import PriorBadge, prior_badges
from graycard.reports._scores import find_score
from graycard.reports.tables._cells import Cell, Reading, breakdown_text, pool, read_metric
from graycard.reports.tables._compared import Compared
from graycard.reports.tables._help import MetricHead, explain_rules, metric_head


@dataclass(frozen=True, slots=True)
class MethodHead:
    """A method as the head of a row or column."""

    name: str
    summary: str
    sees: tuple[str, ...]
    """Names of all that it is handed beyond the capture; empty for a method that competes."""
    submitted: bool = False
    """True if other code made the predictions."""
    priors: PriorBadge | None = None
    """Words on its priors; None for a row without priors."""
    variant_of: str = ""
    """The row whose method this is with settings of its own, while that stands in the same table."""


@dataclass(frozen=True, slots=True)
class Standing:
    """A row of a leaderboard."""

    method: MethodHead
    place: int | None
    """Among methods with their own settings; None for references and variants, which are never ranked."""
    cells: tuple[Cell, ...]
    quiet: tuple[Cell, ...] = ()
    """Metrics that are left out."""


@dataclass(frozen=True, slots=True)
class Leaderboard:
    """Methods against the headline metrics of a track."""

    metrics: tuple[MetricHead, ...]
    competing: tuple[Standing, ...]
    references: tuple[Standing, ...]
    axes: tuple[tuple[str, str] | None, ...] = ()
    """The ends of the axis of the interval plots, by metric."""
    left_out: tuple[MetricHead, ...] = ()
    """Headline metrics that no competing method provides: their columns are hidden."""

    @property
    def families(self) -> tuple[Standing, ...]:
        """Competing rows by place, variants below the row of their method where that competes too."""
        roots = {row.method.name for row in self.competing if not row.method.variant_of}
        under: dict[str, list[Standing]] = {}
        for row in self.competing:
            above = row.method.variant_of
            under.setdefault(above if above in roots else "", []).append(row)
        return tuple(r for own in under.get("", ()) for r in (own, *under.get(own.method.name, ())))

    @property
    def methods(self) -> tuple[MethodHead, ...]:
        """All methods in the order of the rows."""
        return tuple(s.method for s in self.families + self.references)


@dataclass(frozen=True, slots=True)
class MetricRow:
    """A row of a full table: one metric, a cell for each method."""

    metric: MetricHead
    cells: tuple[Cell, ...]
    breakdowns: tuple[tuple[str, str], ...] = ()
    """The same number by neighbouring rules, as pairs of method and text."""
    rules: str = ""
    """Words on those rules."""


@dataclass(frozen=True, slots=True)
class ViewRow:
    """A row of the table of single views."""

    metric: MetricHead
    view: str
    cells: tuple[Cell, ...]


def metrics_of(record: RunRecord, results: Sequence[JobResult]) -> tuple[MetricRecord, ...]:
    """Return the metrics that some of these jobs has a score of; all, where no job came as far as scores.

    Those of one group stand together, in the order in which the groups come first.
    """
    seen = {score.metric for result in results if result.sheet for score in result.sheet.scores}
    found = [m for m in record.metrics if m.id in seen or not seen]
    groups = list(dict.fromkeys(m.group for m in found))
    return tuple(sorted(found, key=lambda m: groups.index(m.group)))


def told_rows(
    rows: Sequence[MetricRow], methods: Sequence[MethodHead]
) -> tuple[tuple[MetricRow, ...], tuple[MetricRow, ...]]:
    """Return the rows that say something, and those of metrics that no competing method provides.

    Args:
        rows: Of a table.
        methods: Heads of its columns; where none competes, what references provide says something.
    """
    own = [not head.sees for head in methods]
    shown = own if any(own) else [True] * len(methods)
    quiet = [not any(_provides(c) for c, s in zip(r.cells, shown, strict=True) if s) for r in rows]
    pairs = [*zip(rows, quiet, strict=True)]
    return tuple(r for r, silent in pairs if not silent), tuple(r for r, silent in pairs if silent)


def leaderboard(
    record: RunRecord,
    results: Sequence[JobResult],
    headline: Sequence[MetricRecord],
    compared: Compared,
) -> Leaderboard:
    """Methods in the order of their mean place over the headline metrics; references apart.

    Only methods with a job among ``results`` have a row. A cell without the whole count of scenes
    takes the last place: to fail a hard scene must not pay. A column that one method alone provides does
    not count: it would give that method a first place without a rival, and all others the last.
    Variants have no place and are never marked as best, as they lead in no verdict: another setting of one
    method must not push the others down. Below their method they stand by their mean place among all rows.
    """
    heads = _heads(record, results)
    rivals = [h for h in heads if not h.sees]
    shown = [m for m in headline if not _is_silent(results, rivals, m)]
    read = {m: _readings(results, m) for m in shown}
    plain = {m: _column(read[m], heads, m) for m in shown}
    columns = {m: {h: compared.dress(c, m.id, h.name) for h, c in plain[m].items()} for m in shown}
    rows = {h: tuple(columns[m][h] for m in shown) for h in heads}
    left_out = [m for m in headline if m not in shown]
    silent = [_column(_readings(results, m), heads, m) for m in left_out]
    quiet = {h: tuple(column[h] for column in silent) for h in heads}
    own = [h for h in rivals if not h.variant_of]
    counted = [sum(_provides(columns[m][h]) for h in own) > 1 for m in shown]
    best = {m: _best(columns[m], m.higher_is_better) for m in shown}
    told = {m: columns[m] for m, counts in zip(shown, counted, strict=True) if counts}
    among_all, order = _mean_places(told, rivals), _mean_places(told, own)
    ranked = sorted(rivals, key=lambda h: order.get(h, among_all[h]))
    return Leaderboard(
        tuple(
            replace(
                metric_head(m),
                here=_range_of(columns[m], m.higher_is_better),
                counts=counts,
                scenes=read[m].words,
            )
            for m, counts in zip(shown, counted, strict=True)
        ),
        tuple(
            Standing(
                h,
                _rank(order[h], order.values()) if h in order else None,
                tuple(replace(columns[m][h], best=h in best[m]) for m in shown),
                quiet[h],
            )
            for h in ranked
        ),
        tuple(Standing(h, None, cells, quiet[h]) for h, cells in rows.items() if h.sees),
        tuple(axis.ends if (axis := compared.axes.get(m.id)) else None for m in shown),
        tuple(replace(metric_head(m), counts=False) for m in left_out),
    )


def metric_rows(
    results: Sequence[JobResult],
    methods: Sequence[MethodHead],
    metrics: Sequence[MetricRecord],
    compared: Compared | None = None,
) -> tuple[MetricRow, ...]:
    """Every metric against every method, the best competing value marked.

    Args:
        results: Of the jobs.
        methods: All of them.
        metrics: All of them.
        compared: Methods over the scenes of a track, whose means have intervals; None for a single scene.
    """
    rows = []
    for metric in metrics:
        readings = _readings(results, metric)
        cells = _column(readings, methods, metric, detailed=True)
        if compared:
            cells = {h: compared.bound(cell, metric.id, h.name) for h, cell in cells.items()}
        best = _best(cells, metric.higher_is_better)
        parts, rules = _breakdowns(readings, methods, metric)
        here = _range_of(cells, metric.higher_is_better)
        head = replace(metric_head(metric), here=here, scenes=readings.words)
        marked = tuple(replace(cell, best=h in best) for h, cell in cells.items())
        rows.append(MetricRow(head, marked, parts, rules))
    return tuple(rows)


def view_rows(
    results: Sequence[JobResult], methods: Sequence[MethodHead], metrics: Sequence[MetricRecord]
) -> tuple[ViewRow, ...]:
    """Every metric in every test view; of several seeds the mean.

    Where a view has no value, the cell says what the method did in the whole scene: it failed, or it
    does not provide this.
    """
    rows = []
    for metric in metrics:
        found = _values_by_view(results, metric.id)
        views = sorted({view for head in methods for view in found.get(head.name, ())})
        if not views:
            continue
        head, whole = metric_head(metric), _column(_readings(results, metric), methods, metric)
        for view in views:
            values = {h: found.get(h.name, {}).get(view, []) for h in methods}
            cells = tuple(_view_cell(own, whole[h], metric.unit) for h, own in values.items())
            rows.append(ViewRow(head, view, cells))
    return tuple(rows)


@dataclass(frozen=True, slots=True)
class _Readings:
    """Scores of all jobs by one metric."""

    by_method: Mapping[str, Sequence[Reading]]
    scenes: frozenset[str]
    """Those that have a score by it; all, where none has."""
    every: frozenset[str]

    @property
    def words(self) -> str:
        """Return the number of scenes that have a score by it, and of all; empty where all have."""
        return "" if self.scenes == self.every else f"{len(self.scenes)} of {len(self.every)} scenes"


def _readings(results: Sequence[JobResult], metric: MetricRecord) -> _Readings:
    found: dict[str, list[Reading]] = {}
    for result in results:
        found.setdefault(result.job.method, []).append(read_metric(result, metric.id))
    scenes = {r.job.scene for r in results if find_score(r, metric.id)}
    every = frozenset(r.job.scene for r in results)
    return _Readings(found, frozenset(scenes) or every, every)


def _column(
    readings: _Readings, methods: Iterable[MethodHead], metric: MetricRecord, *, detailed: bool = False
) -> dict[MethodHead, Cell]:
    """Return the cell of each method by one metric over the scenes that have it."""
    return {head: _cell(readings, head.name, metric, detailed) for head in methods}


def _cell(readings: _Readings, method: str, metric: MetricRecord, detailed: bool) -> Cell:
    """Return one method by one metric; a scene that it was not run on is missing."""
    own = [r for r in readings.by_method.get(method, ()) if r.scene in readings.scenes]
    cell = pool(own, metric.unit, detailed)
    run, every = len({r.scene for r in own}), len(readings.scenes)
    if run == every or cell.status != "scored":
        return cell
    told = f"run on {run} of {every} scenes"
    return replace(cell, complete=False, notes=(told, *cell.notes), lacks=(told, *cell.lacks))


def _heads(record: RunRecord, results: Sequence[JobResult]) -> list[MethodHead]:
    """Return the methods with a job among the results, in the order of the run."""
    present, badges = {r.job.method for r in results}, prior_badges(record)
    variants = {name for track in {r.job.track for r in results} for name in record.variants_on(track)}
    return [
        MethodHead(
            m.name,
            m.summary,
            m.sees,
            bool(m.predictions),
            badges.get(m.name),
            m.entry if m.name in variants else "",
        )
        for m in record.methods
        if m.name in present
    ]


def _is_silent(results: Sequence[JobResult], methods: Sequence[MethodHead], metric: MetricRecord) -> bool:
    """Return whether these methods have said that they do not provide it, and nothing else.

    A job that failed as a whole says nothing of single metrics.
    """
    names = {head.name for head in methods}
    scores = [find_score(r, metric.id) for r in results if r.job.method in names]
    return {score.status for score in scores if score} == {"not provided"}


def _provides(cell: Cell) -> bool:
    """Return whether a method has tried it: to fail is no way out of a comparison."""
    return cell.status in ("scored", "failed")


def _range_of(cells: Mapping[MethodHead, Cell], higher_is_better: bool) -> str:
    """Return the worst and the best value of a table with their methods: what is good, and what is not."""
    found = [(cell.value, cell.text, head.name) for head, cell in cells.items() if cell.value is not None]
    if len(found) < 2:
        return ""
    worst, *_, best = sorted(found, key=lambda f: f[0], reverse=not higher_is_better)
    return f"from {worst[1]} ({worst[2]}) to {best[1]} ({best[2]})"


def _breakdowns(
    readings: _Readings, methods: Sequence[MethodHead], metric: MetricRecord
) -> tuple[tuple[tuple[str, str], ...], str]:
    """Each method's breakdown as a text, and what its rules are."""
    found = {h.name: readings.by_method.get(h.name, ()) for h in methods}
    texts = {name: breakdown_text(own, metric.unit) for name, own in found.items()}
    rules = explain_rules(rule for own in found.values() for r in own for rule in r.breakdown)
    return tuple((name, text) for name, text in texts.items() if text), rules


def _best(column: Mapping[MethodHead, Cell], higher_is_better: bool) -> set[MethodHead]:
    """Return the methods with the best whole mean of a column, no reference and no variant among them."""
    own = {h: c for h, c in column.items() if not h.sees and not h.variant_of}
    return {h for h, place in _places(own, higher_is_better).items() if place == 1 and own[h].complete}


def _mean_places(
    columns: Mapping[MetricRecord, Mapping[MethodHead, Cell]], heads: Sequence[MethodHead]
) -> dict[MethodHead, float]:
    """Return the mean place of each of some methods over columns, among themselves."""
    places = [_places({h: cells[h] for h in heads}, m.higher_is_better) for m, cells in columns.items()]
    return {h: sum(found[h] for found in places) / max(len(places), 1) for h in heads}


def _places(column: Mapping[MethodHead, Cell], higher_is_better: bool) -> dict[MethodHead, int]:
    """Return the place of each competing method in a column; the last for one that lacks a scene."""
    sign = -1 if higher_is_better else 1
    known = {h: sign * c.value for h, c in column.items() if c.value is not None and c.complete}
    whole = {h: value for h, value in known.items() if not math.isnan(value)}
    ordered = sorted(whole.values())
    return {h: 1 + bisect_left(ordered, whole[h]) if h in whole else len(column) for h in column}


def _rank(own: float, mean_places: Iterable[float]) -> int:
    return 1 + sum(other < own for other in mean_places)


def _values_by_view(results: Sequence[JobResult], metric: str) -> dict[str, dict[str, list[float]]]:
    """Return values by method and view, one for each seed."""
    found: dict[str, dict[str, list[float]]] = {}
    for result in results:
        own = found.setdefault(result.job.method, {})
        score = find_score(result, metric)
        for view, value in score.per_view.items() if score else ():
            own.setdefault(view, []).append(value)
    return found


def _view_cell(values: Sequence[float], whole: Cell, unit: str) -> Cell:
    if values:
        value = sum(values) / len(values)
        return Cell("scored", format_value(value, unit), value)
    if whole.status == "scored":
        return Cell("not provided", "–", reason="no value for this view")
    return Cell(whole.status, whole.text, reason=whole.reason)
