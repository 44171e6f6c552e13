# SPDX-License-Identifier: Apache-2.0
"""All that a report says of one scene."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from pathlib import Path

from graycard import GraycardError
from graycard.records import JobResult, MetricRecord, SceneRecord
from graycard.reports._comparison import Gallery, build_gallery
from graycard.reports._evidence import (
    MethodEvidence,
    SceneEvidence,
    describe_scene,
    open_method,
    open_scene,
)
from graycard.reports._facts import flatten
from graycard.reports._spread import Spread, protocol_spreads
from graycard.reports.pictures._worst_tile import MethodTiles, find_worst_tiles
from graycard.reports.plan._plan import Plan, build_plan
from graycard.reports.tables._tables import (
    MethodHead,
    MetricRow,
    ViewRow,
    metric_rows,
    told_rows,
    view_rows,
)
from graycard.reports.tables._troubles import Trouble, warnings


@dataclass(frozen=True, slots=True)
class Shown:
    """Rows and scenes whose pictures and single views a page shows; None: all of them.

    Tables have all in any case.
    """

    methods: Collection[str] | None = None
    """Names of rows."""
    scenes: Collection[str] | None = None
    """Names ``track/scene``."""


ALL = Shown()


@dataclass(frozen=True, slots=True)
class ScenePictures:
    """Contents of the folders of a scene."""

    description: str
    settings: tuple[tuple[str, str], ...]
    methods: tuple[str, ...]
    """Those whose pictures are embedded."""
    views: int
    """Number of test views, of which some are embedded."""
    photographs: int
    """Number of training photographs, of which some are embedded."""
    gallery: Gallery
    worst: tuple[MethodTiles, ...]
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
    left_out: bool
    """True if they were not asked for."""
    faults: tuple[MethodFault, ...]
    rows: tuple[MetricRow, ...]
    quiet: tuple[MetricRow, ...]
    """Metrics that no competing method provides."""
    spreads: tuple[Spread, ...]
    """Spread of base colour over published protocols; empty where none was asked for."""
    viewed: tuple[MethodHead, ...]
    """Those of whose single views all values are told: those with pictures."""
    view_rows: tuple[ViewRow, ...]
    warnings: tuple[Trouble, ...]


FoundPictures = tuple[ScenePictures | None, str, tuple[MethodFault, ...]]
"""Pictures, why there are none, and methods of which something cannot be shown."""

LEFT_OUT = "this page is kept small: it has pictures of some scenes only"
"""Reason why a scene that was not chosen has no pictures; published pages are known by these very words."""


def scene_section(
    run: Path,
    scene: SceneRecord,
    track_results: Sequence[JobResult],
    methods: Sequence[MethodHead],
    metrics: Sequence[MetricRecord],
    anchor: str,
    *,
    shown: Shown = ALL,
    kept: FoundPictures | None = None,
) -> SceneSection:
    """Return a scene with what its folders have to show; what is missing or broken is said in its place.

    Args:
        run: The run folder.
        scene: The scene.
        track_results: Of the jobs of its track.
        methods: All of them.
        metrics: All of them.
        anchor: Of the section.
        shown: Methods and scenes whose pictures and single views are shown.
        kept: Pictures of a page that was made before; None to read the folders of the scene.
    """
    results = [r for r in track_results if r.job.scene == scene.scene]
    here = tuple(m for m in methods if any(r.job.method == m.name for r in results))
    competing = {m.name for m in here if not m.sees}
    asked = shown.scenes is None or f"{scene.track}/{scene.scene}" in shown.scenes
    left_out = kept[1] == LEFT_OUT if kept else not asked
    names = () if left_out else shown.methods
    if kept is not None and kept[0] is not None:
        names = kept[0].methods
    drawn = tuple(m for m in here if names is None or m.name in names)
    none: FoundPictures | None = (None, LEFT_OUT, ()) if left_out else None
    pictures, reason, faults = kept or none or _pictures(run, scene, results, drawn)
    rows, quiet = told_rows(metric_rows(results, here, metrics), here)
    return SceneSection(
        anchor=anchor,
        name=scene.scene,
        title=scene.title,
        methods=here,
        pictures=pictures,
        reason=reason,
        left_out=left_out,
        faults=faults,
        rows=rows,
        quiet=quiet,
        spreads=protocol_spreads(results, [m.name for m in here if m.name in competing]),
        viewed=drawn,
        view_rows=view_rows(results, drawn, metrics),
        warnings=warnings(results, {m.name for m in here if m.sees}),
    )


def _pictures(
    run: Path, scene: SceneRecord, results: Sequence[JobResult], methods: Sequence[MethodHead]
) -> FoundPictures:
    """Return the pictures of a scene, or why there are none; and which methods have nothing to show."""
    try:
        evidence = open_scene(run / scene.folder)
        by_name = [([r for r in results if r.job.method == m.name], not m.sees) for m in methods]
        shown = [open_method(run, found, evidence.shown, competes) for found, competes in by_name]
        return _scene_pictures(scene, evidence, methods, shown), "", _faults(shown)
    except GraycardError as cause:
        return None, str(cause), ()


def _scene_pictures(
    scene: SceneRecord,
    evidence: SceneEvidence,
    methods: Sequence[MethodHead],
    shown: Sequence[MethodEvidence],
) -> ScenePictures:
    return ScenePictures(
        describe_scene(scene, evidence),
        flatten(evidence.settings) if evidence.settings else (),
        tuple(method.name for method in methods),
        len(evidence.test),
        len(evidence.capture.train),
        build_gallery(evidence, shown),
        find_worst_tiles(evidence, shown),
        build_plan(evidence, shown),
    )


def _faults(shown: Sequence[MethodEvidence]) -> tuple[MethodFault, ...]:
    whole = [MethodFault(m.method, m.fault) for m in shown if m.fault]
    views = [MethodFault(m.method, f"{view}: {why}") for m in shown for view, why in m.faults.items()]
    lights = [MethodFault(m.method, f"lights: {m.lights_fault}") for m in shown if m.lights_fault]
    return tuple(whole + views + lights)
