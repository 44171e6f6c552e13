# SPDX-License-Identifier: Apache-2.0
"""The whole content of a report, before any HTML."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from graycard import GraycardError
from graycard.records import COMPARISON, AboveCeiling, Comparison, RunRecord, read_comparison
from graycard.reports._claims import ClaimsSection, claims_section
from graycard.reports._facts import FactGroup, JobRow, SceneHash, fact_groups, job_rows, scene_hashes
from graycard.reports._format import count, format_date
from graycard.reports._priors import PriorBadge, prior_badges
from graycard.reports._scene_section import ALL, FoundPictures, SceneSection, Shown, scene_section
from graycard.reports._tracks import headline_of, words_of
from graycard.reports.opening._strips import Opening, open_track
from graycard.reports.parts._kept import Kept
from graycard.reports.tables._by_scene import SceneTable, scene_tables
from graycard.reports.tables._compared import Compared, compare_track
from graycard.reports.tables._summary import SummaryRow, summary_rows
from graycard.reports.tables._tables import (
    Leaderboard,
    MetricRow,
    leaderboard,
    metric_rows,
    metrics_of,
    told_rows,
)
from graycard.reports.tables._troubles import Trouble, failures


@dataclass(frozen=True, slots=True)
class TrackSection:
    """One track: its leaderboard and its scenes."""

    anchor: str
    name: str
    about: str
    counted: str
    opening: Opening | None
    """None where no competing method leads in anything."""
    board: Leaderboard
    by_scene: tuple[SceneTable, ...]
    """Metrics of the leaderboard."""
    compared: Compared
    rows: tuple[MetricRow, ...]
    quiet: tuple[MetricRow, ...]
    """Metrics that no competing method provides."""
    failures: tuple[Trouble, ...]
    scenes: tuple[SceneSection, ...]


@dataclass(frozen=True, slots=True)
class Page:
    """A report."""

    suite: str
    version: int
    date: str
    tracks: tuple[TrackSection, ...]
    summary: tuple[SummaryRow, ...]
    silent: str
    """Titles of the metrics that no competing method provides on any track."""
    comparison: Comparison | None
    comparison_fault: str
    """Why there are no intervals; empty where there are."""
    leaks: tuple[AboveCeiling, ...]
    """Scores above their ceiling of methods that were handed nothing."""
    handed_above: str
    """Note: how many scores of references are above theirs; empty for none."""
    submitted: tuple[str, ...]
    """Rows of predictions of other code."""
    priors: Mapping[str, PriorBadge]
    """Words on the priors of a row, by its name; rows without priors are not in it."""
    claims: ClaimsSection | None
    """Claims of papers; None where that was not judged."""
    counted: str
    failures: tuple[Trouble, ...]
    facts: tuple[FactGroup, ...]
    jobs: tuple[JobRow, ...]
    hashes: tuple[SceneHash, ...]
    variants: int
    """Number of rows that are a method with settings of its own."""


def build_page(
    record: RunRecord,
    run: Path,
    shown: Shown = ALL,
    comparison: Comparison | None = None,
    kept: Kept | None = None,
) -> Page:
    """Return the content of the report of a run; reads the folders that the record names.

    Args:
        record: The run.
        run: Its folder.
        shown: Methods and scenes whose pictures are embedded.
        comparison: Of its methods; None for that in the folder.
        kept: Pictures of a page that was made before; None to read the folders.
    """
    comparison, fault = (comparison, "") if comparison else _read_comparison(run)
    names = dict.fromkeys([s.track for s in record.scenes] + [r.job.track for r in record.results])
    tracks = tuple(
        _track(record, run, name, f"track-{i + 1}", _Sources(comparison, shown, kept or {}))
        for i, name in enumerate(names)
    )
    above = comparison.above_ceiling if comparison else ()
    handed = sum(bool(score.handed) for score in above)
    verdicts = {(t.name, metric): v for t in tracks for metric, v in t.compared.verdicts.items()}
    left_out = {(t.name, head.id) for t in tracks for head in t.board.left_out}
    summary, silent = summary_rows(record.metrics, verdicts, [(t.name, t.anchor) for t in tracks], left_out)
    parts = (
        count(len(tracks), "track"),
        count(len(record.scenes), "scene"),
        count(len(record.methods), "row"),
        count(len(record.results), "job"),
        *([f"at {record.departs}"] if record.departs else []),
        *([f"sealed scenes of {record.edition.tag}"] if record.edition else []),
    )
    return Page(
        suite=record.suite,
        version=record.suite_version,
        date=format_date(record.started),
        tracks=tracks,
        summary=summary,
        silent=silent,
        comparison=comparison,
        comparison_fault=fault,
        leaks=tuple(score for score in above if not score.handed),
        handed_above=count(handed, "score") if handed else "",
        submitted=record.submitted,
        priors=prior_badges(record),
        claims=claims_section(run),
        counted=", ".join(parts),
        failures=tuple(failure for track in tracks for failure in track.failures),
        facts=fact_groups(record),
        jobs=job_rows(record),
        hashes=scene_hashes(record),
        variants=len({m.name for track in tracks for m in track.board.methods if m.variant_of}),
    )


def _read_comparison(run: Path) -> tuple[Comparison | None, str]:
    """Return the comparison of a run, or why there is none."""
    try:
        found = read_comparison(run)
    except GraycardError as cause:
        return None, str(cause)
    return found, "" if found else f"the run has no {COMPARISON}; `graycard bench` writes it"


@dataclass(frozen=True, slots=True)
class _Sources:
    """Parts of a page beside its run."""

    comparison: Comparison | None
    shown: Shown
    kept: Kept


def _track(record: RunRecord, run: Path, name: str, anchor: str, sources: _Sources) -> TrackSection:
    results = [r for r in record.results if r.job.track == name]
    metrics = metrics_of(record, results)
    compared = compare_track(sources.comparison, record, name, metrics)
    board = leaderboard(record, results, headline_of(name, metrics), compared)
    rows, quiet = told_rows(metric_rows(results, board.methods, metrics, compared), board.methods)
    seeds = len({r.job.seed for r in results})
    scenes = tuple(
        scene_section(
            run,
            scene,
            results,
            board.methods,
            metrics,
            f"{anchor}-scene-{i}",
            shown=sources.shown,
            kept=_kept(sources.kept, name, scene.scene),
        )
        for i, scene in enumerate((s for s in record.scenes if s.track == name), 1)
    )
    told = {head.id for head in board.metrics}
    return TrackSection(
        anchor=anchor,
        name=name,
        about=words_of(name).about,
        counted=count(len(scenes), "scene") + (f" × {count(seeds, 'seed')}" if seeds > 1 else ""),
        opening=open_track(name, results, metrics, compared, scenes, record.variants_on(name)),
        board=board,
        by_scene=scene_tables(
            results, [s.name for s in scenes], board.methods, [m for m in metrics if m.id in told]
        ),
        compared=compared,
        rows=rows,
        quiet=quiet,
        failures=failures(results, metrics),
        scenes=scenes,
    )


def _kept(kept: Kept, track: str, scene: str) -> FoundPictures | None:
    found = kept.get((track, scene))
    return (found.pictures, found.reason, found.faults) if found else None
