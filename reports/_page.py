# SPDX-License-Identifier: Apache-2.0
"""The whole content of a report, before any HTML."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import graycard as gc
from graycard.reports._comparison import Gallery, build_gallery
from graycard.reports._evidence import (
    MethodEvidence,
    SceneEvidence,
    describe_scene,
    open_method,
    open_scene,
)
from graycard.reports._facts import FactGroup, JobRow, SceneHash, fact_groups, flatten, job_rows, scene_hashes
from graycard.reports._format import count, format_date
from graycard.reports._pictures import KNEE, LEVELS, STEP
from graycard.reports._plan import Plan, build_plan
from graycard.reports._tables import (
    Leaderboard,
    MethodHead,
    MetricRow,
    Trouble,
    ViewRow,
    failures,
    leaderboard,
    metric_rows,
    metrics_of,
    view_rows,
    warnings,
)

_TRACKS = {
    "dark": "the main light is mounted on the camera and moves with it",
    "tabletop": "objects on a glossy surface, one of which is to be removed",
    "multilight": "several local lights and an environment",
}


@dataclass(frozen=True, slots=True)
class ScenePictures:
    """What the folders of a scene have to show."""

    description: str
    settings: tuple[tuple[str, str], ...]
    views: int
    """Number of test views, of which some are embedded."""
    photographs: int
    """Number of training photographs, of which some are embedded."""
    gallery: Gallery
    plan: Plan


@dataclass(frozen=True, slots=True)
class MethodFault:
    """A method of which nothing can be shown, or not all."""

    method: str
    reason: str


@dataclass(frozen=True, slots=True)
class SceneSection:
    """One scene of a track."""

    anchor: str
    name: str
    title: str
    methods: tuple[MethodHead, ...]
    pictures: ScenePictures | None
    reason: str
    """Why there are no pictures."""
    faults: tuple[MethodFault, ...]
    rows: tuple[MetricRow, ...]
    view_rows: tuple[ViewRow, ...]
    warnings: tuple[Trouble, ...]


@dataclass(frozen=True, slots=True)
class TrackSection:
    """One track: its leaderboard and its scenes."""

    anchor: str
    name: str
    about: str
    counted: str
    board: Leaderboard
    rows: tuple[MetricRow, ...]
    failures: tuple[Trouble, ...]
    scenes: tuple[SceneSection, ...]


@dataclass(frozen=True, slots=True)
class Page:
    """A report."""

    suite: str
    version: int
    date: str
    tracks: tuple[TrackSection, ...]
    counted: str
    failures: tuple[Trouble, ...]
    facts: tuple[FactGroup, ...]
    jobs: tuple[JobRow, ...]
    hashes: tuple[SceneHash, ...]
    knee: float
    step: float
    levels: int
    """Of the codes of linear light."""


def build_page(record: gc.RunRecord, run: Path) -> Page:
    """The content of the report of a run; reads the folders that the record names."""
    names = dict.fromkeys([s.track for s in record.scenes] + [r.job.track for r in record.results])
    tracks = tuple(_track(record, run, name, f"track-{i + 1}") for i, name in enumerate(names))
    parts = (
        count(len(tracks), "track"),
        count(len(record.scenes), "scene"),
        count(len(record.methods), "method"),
        count(len(record.results), "job"),
    )
    return Page(
        suite=record.suite,
        version=record.suite_version,
        date=format_date(record.started),
        tracks=tracks,
        counted=", ".join(parts),
        failures=tuple(failure for track in tracks for failure in track.failures),
        facts=fact_groups(record),
        jobs=job_rows(record),
        hashes=scene_hashes(record),
        knee=KNEE,
        step=STEP,
        levels=LEVELS,
    )


def _track(record: gc.RunRecord, run: Path, name: str, anchor: str) -> TrackSection:
    results = [r for r in record.results if r.job.track == name]
    metrics = metrics_of(record, results)
    board = leaderboard(record, results, metrics)
    scenes = [s for s in record.scenes if s.track == name]
    seeds = len({r.job.seed for r in results})
    return TrackSection(
        anchor=anchor,
        name=name,
        about=_TRACKS.get(name, ""),
        counted=count(len(scenes), "scene") + (f" × {count(seeds, 'seed')}" if seeds > 1 else ""),
        board=board,
        rows=metric_rows(results, board.methods, metrics),
        failures=failures(results, metrics),
        scenes=tuple(
            _scene(run, scene, results, board.methods, metrics, f"{anchor}-scene-{i + 1}")
            for i, scene in enumerate(scenes)
        ),
    )


def _scene(
    run: Path,
    scene: gc.SceneRecord,
    track_results: Sequence[gc.JobResult],
    methods: Sequence[MethodHead],
    metrics: Sequence[gc.MetricRecord],
    anchor: str,
) -> SceneSection:
    results = [r for r in track_results if r.job.scene == scene.scene]
    here = tuple(m for m in methods if any(r.job.method == m.name for r in results))
    competing = {m.name for m in here if not m.sees}  # that the truth is too good is no news
    pictures, reason, faults = _pictures(run, scene, results, here)
    return SceneSection(
        anchor=anchor,
        name=scene.scene,
        title=scene.title,
        methods=here,
        pictures=pictures,
        reason=reason,
        faults=faults,
        rows=metric_rows(results, here, metrics),
        view_rows=view_rows(results, here, metrics),
        warnings=warnings([r for r in results if r.job.method in competing]),
    )


def _pictures(
    run: Path, scene: gc.SceneRecord, results: Sequence[gc.JobResult], methods: Sequence[MethodHead]
) -> tuple[ScenePictures | None, str, tuple[MethodFault, ...]]:
    """The pictures of a scene, or why there are none; and which methods have nothing to show."""
    try:
        evidence = open_scene(run / scene.folder)
        by_name = [([r for r in results if r.job.method == m.name], not m.sees) for m in methods]
        shown = [open_method(run, found, evidence.shown, competes) for found, competes in by_name]
        return _scene_pictures(scene, evidence, shown), "", _faults(shown)
    except gc.GraycardError as cause:
        return None, str(cause), ()


def _scene_pictures(
    scene: gc.SceneRecord, evidence: SceneEvidence, shown: Sequence[MethodEvidence]
) -> ScenePictures:
    return ScenePictures(
        describe_scene(scene, evidence),
        flatten(evidence.settings) if evidence.settings else (),
        len(evidence.test),
        len(evidence.capture.train),
        build_gallery(evidence, shown),
        build_plan(evidence, shown),
    )


def _faults(shown: Sequence[MethodEvidence]) -> tuple[MethodFault, ...]:
    whole = [MethodFault(m.method, m.fault) for m in shown if m.fault]
    views = [MethodFault(m.method, f"{view}: {why}") for m in shown for view, why in m.faults.items()]
    lights = [MethodFault(m.method, f"lights: {m.lights_fault}") for m in shown if m.lights_fault]
    return tuple(whole + views + lights)
