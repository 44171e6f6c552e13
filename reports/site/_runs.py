# SPDX-License-Identifier: Apache-2.0
"""The content of a site that comes from run records: tables, scenes and rows."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from graycard.io import read_json
from graycard.records import (
    SUITE_FILE,
    Comparison,
    MethodRecord,
    RunRecord,
    Scale,
    SceneRecord,
    knob_text,
    read_run,
    scale_of,
)
from graycard.reports._format import count, format_date, format_seconds, format_value
from graycard.reports._priors import PriorBadge, prior_badges
from graycard.reports._tracks import headline_of, words_of
from graycard.reports.site._sources import Published
from graycard.reports.tables._cells import Cell
from graycard.reports.tables._compared import Compared, compare_track
from graycard.reports.tables._help import MetricHead
from graycard.reports.tables._tables import Standing, leaderboard, metrics_of

Compare = Callable[[RunRecord], Comparison]


@dataclass(frozen=True, slots=True)
class BoardCell:
    """A mean over scenes with its interval."""

    text: str
    interval: str
    notes: tuple[str, ...]
    """Words on jobs or scenes that are not in the mean, and on lights without a partner."""
    best: bool
    status: str


@dataclass(frozen=True, slots=True)
class BoardRow:
    """A row of a leaderboard."""

    place: str
    """Empty for a variant, and for a reference that is handed truth."""
    method: str
    notes: tuple[str, ...]
    cells: tuple[BoardCell, ...]
    variant: bool
    """True for a method with settings of its own, while it stands there as itself."""


@dataclass(frozen=True, slots=True)
class Leader:
    """The best row by one metric, in words."""

    title: str
    best: str
    value: str
    verdict: str
    kind: str
    lead: str


@dataclass(frozen=True, slots=True)
class Board:
    """The leaderboard of one track of one run."""

    anchor: str
    track: str
    about: str
    scenes: str
    heads: tuple[MetricHead, ...]
    leaders: tuple[Leader, ...]
    rows: tuple[BoardRow, ...]
    left_out: tuple[str, ...]
    """Titles of metrics that no competing method provides."""


@dataclass(frozen=True, slots=True)
class SceneLine:
    """A scene in a table."""

    track: str
    scene: str
    family: str
    seed: str
    title: str
    knobs: str


@dataclass(frozen=True, slots=True)
class MethodLine:
    """A row of a run in a table."""

    name: str
    summary: str
    """With its settings, where a ledger tells them."""
    handed: str
    """Parts of the truth that it is handed, and what its priors tell of it; empty for photographs alone."""
    entry: str


@dataclass(frozen=True, slots=True)
class SiteRun:
    """One published run."""

    name: str
    anchor: str
    """Name of its place in a page."""
    suite: str
    version: int
    title: str
    """Title of its suite; empty where that is not told."""
    date: str
    commit: str
    wall: str
    counted: str
    pictures: str
    """Size and number of its pictures; empty where that is not told."""
    edition: str
    boards: tuple[Board, ...]
    scenes: tuple[SceneLine, ...]
    methods: tuple[MethodLine, ...]


def site_run(run: Published, compare: Compare) -> SiteRun:
    """Return what a site tells of a published run.

    Raises:
        RecordError: A record is damaged.
    """
    record = read_run(run.folder)
    comparison = compare(record)
    suite = _suite(run)
    names = dict.fromkeys([s.track for s in record.scenes] + [r.job.track for r in record.results])
    told, badges = run.ledger.methods if run.ledger else {}, prior_badges(record)
    return SiteRun(
        name=run.name,
        anchor=run.anchor,
        suite=record.suite,
        version=record.suite_version,
        title=str(suite.get("title", "")),
        date=format_date(record.started),
        commit=str(record.environment.get("git_commit") or ""),
        wall=format_seconds(record.wall_s),
        counted=", ".join(
            count(number, noun)
            for number, noun in (
                (len(record.scenes), "scene"),
                (len(record.methods), "row"),
                (len(record.results), "job"),
            )
        ),
        pictures=_pictures(scale_of(suite, record.size)),
        edition=record.edition.tag if record.edition else "",
        boards=tuple(_board(record, comparison, track, f"{run.anchor}--{track}") for track in names),
        scenes=tuple(map(_scene, record.scenes)),
        methods=tuple(_method(m, told.get(m.name, ""), badges.get(m.name)) for m in record.methods),
    )


def _scene(scene: SceneRecord) -> SceneLine:
    seed = "secret seed" if scene.seed is None else f"seed {scene.seed}"
    return SceneLine(scene.track, scene.scene, scene.family, seed, scene.title, knobs_in_words(scene.knobs))


def _method(method: MethodRecord, told: str, priors: PriorBadge | None) -> MethodLine:
    code = "other code" if method.predictions else method.entry
    handed = [*method.sees, *([f"priors: {priors.answers}"] if priors else [])]
    return MethodLine(method.name, told or method.summary, ", ".join(handed), code)


def _suite(run: Published) -> Mapping[str, Any]:
    path = run.folder / SUITE_FILE
    found = read_json(path) if path.is_file() else {}
    return found if isinstance(found, dict) else {}


def _pictures(scale: Scale | None) -> str:
    """Return size and number of pictures, as far as the suite tells them."""
    if scale is None:
        return ""
    views = f"{scale.train_views} photographs, {scale.test_views} held-out views"
    factor = f", {scale.surfels:g} times the surfels" if scale.surfels != 1 else ""
    return f"{scale.width} × {scale.height} pixels, {views}{factor}"


def knobs_in_words(knobs: Mapping[str, Any]) -> str:
    """Return knobs in one line, numbers short and with units."""
    shown = ((k, f"{v:.3g}" if isinstance(v, float) else v) for k, v in knobs.items())
    return ", ".join(f"{name.replace('_', ' ')} {knob_text(name, str(value))}" for name, value in shown)


def _board(record: RunRecord, comparison: Comparison, track: str, anchor: str) -> Board:
    results = [r for r in record.results if r.job.track == track]
    metrics = headline_of(track, metrics_of(record, results))
    compared = compare_track(comparison, record, track, metrics)
    board = leaderboard(record, results, metrics, compared)
    units = {metric.id: metric.unit for metric in metrics}
    return Board(
        anchor,
        track,
        words_of(track).about,
        count(sum(scene.track == track for scene in record.scenes), "scene"),
        board.metrics,
        tuple(_leader(head, compared) for head in board.metrics),
        tuple(_row(s, board.metrics, compared, units) for s in (*board.families, *board.references)),
        tuple(head.title for head in board.left_out),
    )


def _leader(head: MetricHead, compared: Compared) -> Leader:
    found = compared.verdicts[head.id]
    return Leader(
        head.title, found.leader, f"{found.value} {head.unit}".strip(), found.words, found.kind, found.lead
    )


def _notes(cell: Cell) -> tuple[str, ...]:
    """Return what a reader has to know of a mean."""
    return (*cell.lacks, *([cell.unpaired] if cell.unpaired else []))


def _row(
    standing: Standing, heads: tuple[MetricHead, ...], compared: Compared, units: Mapping[str, str]
) -> BoardRow:
    method = standing.method
    notes = [f"is handed {', '.join(method.sees)}"] if method.sees else []
    notes += [f"priors: {method.priors.text}"] if method.priors else []
    notes += ["made by other code"] if method.submitted else []
    notes += [f"{method.variant_of} with settings of its own"] if method.variant_of else []
    cells = []
    for head, cell in zip(heads, standing.cells, strict=True):
        known = compared.standings.get((head.id, method.name))
        ends = known.interval if known and cell.status == "scored" else None
        interval = " to ".join(format_value(end, units[head.id]) for end in ends) if ends else ""
        cells.append(BoardCell(cell.text, interval, _notes(cell), cell.best, cell.status))
    place = "" if standing.place is None else str(standing.place)
    return BoardRow(place, method.name, tuple(notes), tuple(cells), bool(method.variant_of))
