# SPDX-License-Identifier: Apache-2.0
"""The tables of a track and of a scene, driven by the metric records alone."""

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

from graycard.records import HOLDS_NOISE, JobResult, MetricRecord, RunRecord
from graycard.reports._format import format_value
from graycard.reports._priors import PriorBadge, prior_badges
from graycard.reports._scores import find_score
from graycard.reports.tables._cells import Cell, breakdown_text, is_better, pool, read_metric
from graycard.reports.tables._compared import Compared
from graycard.reports.tables._help import MetricHead, explain_rules, metric_head


@dataclass(frozen=True, slots=True)
class MethodHead:
    """A method as the head of a row or column."""

    name: str
    summary: str
    sees: tuple[str, ...]
    """What it is handed beyond the capture; empty for a method that competes."""
    submitted: bool = False
    """Whether other code made the predictions."""
    priors: PriorBadge | None = None
    """What priors told it; None for a row without priors."""


@dataclass(frozen=True, slots=True)
class Standing:
    """A row of a leaderboard."""

    method: MethodHead
    place: int | None
    """None for a reference, which is never ranked."""
    cells: tuple[Cell, ...]


@dataclass(frozen=True, slots=True)
class Leaderboard:
    """Methods against the headline metrics of a track."""

    metrics: tuple[MetricHead, ...]
    competing: tuple[Standing, ...]
    references: tuple[Standing, ...]
    axes: tuple[tuple[str, str] | None, ...] = ()
    """The ends of the axis of the interval plots, by metric."""
    left_out: tuple[MetricHead, ...] = ()
    """Headline metrics that no competing method provides: they have no column."""

    @property
    def methods(self) -> tuple[MethodHead, ...]:
        """All methods in the order of the rows."""
        return tuple(s.method for s in self.competing + self.references)


@dataclass(frozen=True, slots=True)
class MetricRow:
    """A row of a full table: one metric, a cell for each method."""

    metric: MetricHead
    cells: tuple[Cell, ...]
    breakdowns: tuple[tuple[str, str], ...] = ()
    """The same number by neighbouring rules, as pairs of method and text."""
    rules: str = ""
    """What those rules are."""


@dataclass(frozen=True, slots=True)
class ViewRow:
    """A row of the table of single views."""

    metric: MetricHead
    view: str
    cells: tuple[Cell, ...]


@dataclass(frozen=True, slots=True)
class Trouble:
    """Something that failed, or that the reader should be warned of."""

    method: str
    where: str
    what: str
    reason: str


def metrics_of(record: RunRecord, results: Sequence[JobResult]) -> tuple[MetricRecord, ...]:
    """The metrics that some of these jobs has a score of; all, where no job came as far as scores.

    Those of one group stand together, in the order in which the groups come first.
    """
    seen = {score.metric for result in results if result.sheet for score in result.sheet.scores}
    found = [m for m in record.metrics if m.id in seen or not seen]
    groups = list(dict.fromkeys(m.group for m in found))
    return tuple(sorted(found, key=lambda m: groups.index(m.group)))


def told_rows(rows: Sequence[MetricRow]) -> tuple[tuple[MetricRow, ...], str]:
    """The rows that say something, and the titles of those that no method provides."""
    quiet = [r for r in rows if not any(map(_provides, r.cells))]
    return tuple(r for r in rows if r not in quiet), ", ".join(r.metric.title for r in quiet)


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
    """
    heads = _heads(record, results)
    rivals = [h for h in heads if not h.sees]
    shown = [m for m in headline if not _is_silent(results, rivals, m)]
    columns = {m: {h: compared.dress(_cell(results, h.name, m), m.id, h.name) for h in heads} for m in shown}
    rows = {h: tuple(columns[m][h] for m in shown) for h in heads}
    competing = {h: rows[h] for h in rivals}
    counted = [sum(_provides(columns[m][h]) for h in rivals) > 1 for m in shown]
    order = {h: _mean_place(h, competing, shown, counted) for h in competing}
    ranked = sorted(competing, key=lambda h: order[h])
    return Leaderboard(
        tuple(
            replace(metric_head(m), here=_range_of(columns[m], m.higher_is_better), counts=counts)
            for m, counts in zip(shown, counted, strict=True)
        ),
        tuple(Standing(h, _rank(order[h], order.values()), _mark_best(competing, h, shown)) for h in ranked),
        tuple(Standing(h, None, cells) for h, cells in rows.items() if h.sees),
        tuple(axis.ends if (axis := compared.axes.get(m.id)) else None for m in shown),
        tuple(metric_head(m) for m in headline if m not in shown),
    )


def metric_rows(
    results: Sequence[JobResult], methods: Sequence[MethodHead], metrics: Sequence[MetricRecord]
) -> tuple[MetricRow, ...]:
    """Every metric against every method, the best competing value marked."""
    rows = []
    for metric in metrics:
        cells = {method: _cell(results, method.name, metric, detailed=True) for method in methods}
        competing = {h: (cell,) for h, cell in cells.items() if not h.sees}
        marked = {h: _mark_best(competing, h, [metric])[0] for h in competing}
        parts, rules = _breakdowns(results, methods, metric)
        head = replace(metric_head(metric), here=_range_of(cells, metric.higher_is_better))
        rows.append(MetricRow(head, tuple((cells | marked).values()), parts, rules))
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
        found = {h: _values_by_view(results, h.name, metric.id) for h in methods}
        whole = {h: _cell(results, h.name, metric) for h in methods}
        for view in sorted({view for values in found.values() for view in values}):
            cells = tuple(_view_cell(found[h].get(view, []), whole[h], metric.unit) for h in methods)
            rows.append(ViewRow(metric_head(metric), view, cells))
    return tuple(rows)


def failures(results: Sequence[JobResult], metrics: Sequence[MetricRecord]) -> tuple[Trouble, ...]:
    """Everything that failed, the metrics that failed for one reason in one line."""
    found = []
    for result in results:
        where = f"{result.job.scene}, seed {result.job.seed}"
        if result.sheet is None:
            reason = result.reason or "expected scores of this job, got none"
            found.append(Trouble(result.job.method, where, "the whole job", reason))
            continue
        readings = [(m, read_metric(result, m.id)) for m in metrics]
        failed = [(m.title, r.reason) for m, r in readings if r.status == "failed"]
        for reason in dict.fromkeys(reason for _, reason in failed):
            titles = ", ".join(title for title, why in failed if why == reason)
            found.append(Trouble(result.job.method, where, titles, reason or "no reason given"))
    return tuple(found)


def warnings(results: Sequence[JobResult], handed: Collection[str] = ()) -> tuple[Trouble, ...]:
    """Return everything that the scores of these jobs warn of, the metrics of one warning in one line.

    Args:
        results: Of the jobs.
        handed: Names of methods that are handed truth: that they are too good is no news, and left out.
    """
    found: dict[tuple[str, str, str], list[str]] = {}
    for result in (r for r in results if r.sheet):
        assert result.sheet is not None
        where = f"{result.job.scene}, seed {result.job.seed}"
        told = [("the whole folder", warning) for warning in result.sheet.warnings]
        told += [(s.metric, warning) for s in result.sheet.scores for warning in dict.fromkeys(s.warnings)]
        for what, warning in told:
            if not (warning.endswith(HOLDS_NOISE) and result.job.method in handed):
                found.setdefault((result.job.method, where, warning), []).append(what)
    return tuple(Trouble(name, where, ", ".join(ids), why) for (name, where, why), ids in found.items())


def _cell(results: Sequence[JobResult], method: str, metric: MetricRecord, detailed: bool = False) -> Cell:
    """One method by one metric over the scenes that have it; a scene that it was not run on is missing."""
    scenes = {r.job.scene for r in results if find_score(r, metric.id)}
    here = [r for r in results if r.job.scene in scenes] or list(results)
    own = [r for r in here if r.job.method == method]
    cell = pool([read_metric(r, metric.id) for r in own], metric.unit, detailed)
    run, every = len({r.job.scene for r in own}), len({r.job.scene for r in here})
    if run == every or cell.status != "scored":
        return cell
    return replace(cell, complete=False, notes=(f"run on {run} of {every} scenes", *cell.notes))


def _heads(record: RunRecord, results: Sequence[JobResult]) -> list[MethodHead]:
    """The methods with a job among the results, in the order of the run."""
    present, badges = {r.job.method for r in results}, prior_badges(record)
    return [
        MethodHead(m.name, m.summary, m.sees, bool(m.predictions), badges.get(m.name))
        for m in record.methods
        if m.name in present
    ]


def _is_silent(results: Sequence[JobResult], methods: Sequence[MethodHead], metric: MetricRecord) -> bool:
    """Whether these methods have said that they do not provide it, and nothing else.

    A job that failed as a whole says nothing of single metrics.
    """
    names = {head.name for head in methods}
    scores = [find_score(r, metric.id) for r in results if r.job.method in names]
    return {score.status for score in scores if score} == {"not provided"}


def _provides(cell: Cell) -> bool:
    """Whether a method has tried it: to fail is no way out of a comparison."""
    return cell.status in ("scored", "failed")


def _range_of(cells: Mapping[MethodHead, Cell], higher_is_better: bool) -> str:
    """The worst and the best value of a table with their methods: what is good, and what is not."""
    found = [(cell.value, cell.text, head.name) for head, cell in cells.items() if cell.value is not None]
    if len(found) < 2:
        return ""
    worst, *_, best = sorted(found, key=lambda f: f[0], reverse=not higher_is_better)
    return f"from {worst[1]} ({worst[2]}) to {best[1]} ({best[2]})"


def _breakdowns(
    results: Sequence[JobResult], methods: Sequence[MethodHead], metric: MetricRecord
) -> tuple[tuple[tuple[str, str], ...], str]:
    """Each method's breakdown as a text, and what its rules are."""
    found = {h.name: [read_metric(r, metric.id) for r in results if r.job.method == h.name] for h in methods}
    texts = {name: breakdown_text(readings, metric.unit) for name, readings in found.items()}
    rules = explain_rules(rule for readings in found.values() for r in readings for rule in r.breakdown)
    return tuple((name, text) for name, text in texts.items() if text), rules


def _mark_best(
    competing: dict[MethodHead, tuple[Cell, ...]], method: MethodHead, metrics: Sequence[MetricRecord]
) -> tuple[Cell, ...]:
    cells = competing[method]
    places = [_place(method, competing, i, m.higher_is_better) for i, m in enumerate(metrics)]
    return tuple(
        replace(cell, best=cell.complete and place == 1) for cell, place in zip(cells, places, strict=True)
    )


def _mean_place(
    method: MethodHead,
    competing: dict[MethodHead, tuple[Cell, ...]],
    metrics: Sequence[MetricRecord],
    counted: Sequence[bool],
) -> float:
    places = [_place(method, competing, i, m.higher_is_better) for i, m in enumerate(metrics) if counted[i]]
    return sum(places) / max(len(places), 1)


def _place(
    method: MethodHead, competing: dict[MethodHead, tuple[Cell, ...]], column: int, higher_is_better: bool
) -> int:
    own = competing[method][column]
    if own.value is None or not own.complete:
        return len(competing)
    others = [cells[column] for cells in competing.values()]
    values = [c.value for c in others if c.value is not None and c.complete]
    return 1 + sum(is_better(v, own.value, higher_is_better) for v in values)


def _rank(own: float, mean_places: Iterable[float]) -> int:
    return 1 + sum(other < own for other in mean_places)


def _values_by_view(results: Sequence[JobResult], method: str, metric: str) -> dict[str, list[float]]:
    found: dict[str, list[float]] = {}
    scores = [find_score(result, metric) for result in results if result.job.method == method]
    for score in scores:
        for view, value in score.per_view.items() if score else ():
            found.setdefault(view, []).append(value)
    return found


def _view_cell(values: Sequence[float], whole: Cell, unit: str) -> Cell:
    if values:
        value = sum(values) / len(values)
        return Cell("scored", format_value(value, unit), value)
    if whole.status == "scored":
        return Cell("not provided", "–", reason="no value for this view")
    return Cell(whole.status, whole.text, reason=whole.reason)
