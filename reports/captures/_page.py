# SPDX-License-Identifier: Apache-2.0
"""The content of the page of an imported capture, before any HTML."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from graycard import Truth, View
from graycard.dataset import HeldOut, open_held_out
from graycard.records import MetricRecord, PhotographSheet, Score
from graycard.reports._comparison import THUMBNAIL_SIDE, Gallery, ViewPictures
from graycard.reports._evidence import MethodEvidence, SceneEvidence, handed_in
from graycard.reports._format import count, format_value
from graycard.reports.pictures._layer_rows import LayerRow, bare_row, judged_layer, layer_row
from graycard.reports.pictures._pictures import PagePicture, light_picture, shrink

MAX_VIEWS = 3
"""Held-out views whose pictures are embedded: first, middle and last."""
MAX_THUMBNAILS = 12
_LAYERS = (
    "base_color", "normal", "depth", "roughness", "metallic", "f0", "diffuse", "specular", "shading",
    "counterfactual.radiance",
)  # fmt: skip
"""Layers of a decomposition that are shown where a method has them, without truth."""


@dataclass(frozen=True, slots=True)
class CaptureRow:
    """Predictions of one method, scored by the photographs."""

    name: str
    predictions: Path
    sheet: PhotographSheet


@dataclass(frozen=True, slots=True)
class ScoreCell:
    """One number, or the word that stands there instead."""

    text: str
    status: str
    reason: str = ""
    note: str = ""


@dataclass(frozen=True, slots=True)
class MetricLine:
    """One metric of all methods."""

    title: str
    unit: str
    arrow: str
    formula: str
    cells: tuple[ScoreCell, ...]
    views: tuple[tuple[str, tuple[ScoreCell, ...]], ...]
    """By held-out view: the same of each method."""


@dataclass(frozen=True, slots=True)
class ViewGallery:
    """One held-out view: its photograph beside what methods made of it, then their layers."""

    name: str
    picture: LayerRow
    layers: tuple[LayerRow, ...]


@dataclass(frozen=True, slots=True)
class CapturePage:
    """The page."""

    name: str
    track: str
    kind: str
    described: str
    methods: tuple[str, ...]
    lines: tuple[MetricLine, ...]
    views: tuple[ViewGallery, ...]
    held_out: int
    lacking: tuple[str, ...]
    thumbnails: tuple[PagePicture, ...]
    faults: tuple[tuple[str, str], ...]
    warnings: tuple[tuple[str, str], ...]

    @property
    def gallery(self) -> Gallery:
        """Return all pictures."""
        shown = (ViewPictures(view.name, (view.picture, *view.layers)) for view in self.views)
        return Gallery(self.thumbnails, tuple(shown))


def capture_page(scene: Path, rows: Sequence[CaptureRow]) -> CapturePage:
    """Return the content of the page of a capture.

    Args:
        scene: ``DATASET/<track>/<scene>`` of an imported capture.
        rows: A column each, in this order.

    Raises:
        DatasetError: The photographs are missing or damaged.
    """
    held = open_held_out(scene, check=False)
    shown = _spread(held.views, MAX_VIEWS)
    methods = [_exposed(handed_in(row.name, row.predictions, shown), held, shown) for row in rows]
    evidence = _evidence(held, shown)
    radiance = judged_layer("radiance", evidence, methods)
    capture = held.capture
    return CapturePage(
        capture.scene,
        capture.track,
        rows[0].sheet.kind,
        _described(held),
        tuple(row.name for row in rows),
        tuple(_line(record, rows) for record in rows[0].sheet.metrics),
        tuple(
            ViewGallery(view.name, layer_row(radiance, view, evidence, methods), _layers(held, view, methods))
            for view in shown
        ),
        len(held.views),
        tuple(view.name for view in held.lacking),
        tuple(_thumbnail(held, view) for view in _spread(capture.train, MAX_THUMBNAILS)),
        tuple(_faults(methods)),
        tuple((row.name, says) for row in rows for score in row.sheet.scores for says in score.warnings),
    )


def _evidence(held: HeldOut, shown: Sequence[View]) -> SceneEvidence:
    """Put photographs in the place of true light; there is nothing else."""
    capture = held.capture
    nothing = Truth(capture.track, capture.scene, held.views, capture.exposure, 0.0, ())
    layers = {
        view.name: {"radiance": held.photograph(view) * np.float32(held.exposure(view))} for view in shown
    }
    return SceneEvidence(nothing, capture, tuple(shown), layers, (), {})


def _exposed(method: MethodEvidence, held: HeldOut, shown: Sequence[View]) -> MethodEvidence:
    """Return a method whose light is brought to the exposure of each photograph, as it is scored."""
    layers = {name: dict(found) for name, found in method.layers.items()}
    for view in shown:
        if "radiance" in layers.get(view.name, {}):
            layers[view.name]["radiance"] = layers[view.name]["radiance"] * np.float32(held.exposure(view))
    return replace(method, layers=layers)


def _layers(held: HeldOut, view: View, methods: Sequence[MethodEvidence]) -> tuple[LayerRow, ...]:
    given = {name for method in methods for name in method.layers.get(view.name, {})}
    names = [name for name in _LAYERS if name in given]
    return tuple(bare_row(name, view, held.capture.exposure, methods) for name in names)


def _line(record: MetricRecord, rows: Sequence[CaptureRow]) -> MetricLine:
    found = [_score_of(row.sheet, record.id) for row in rows]
    views = dict.fromkeys(view for score in found if score for view in score.per_view)
    return MetricLine(
        record.title,
        "" if record.unit == "1" else record.unit,
        "↑" if record.higher_is_better else "↓",
        record.formula,
        tuple(_cell(score, record.unit) for score in found),
        tuple((view, tuple(_view_cell(score, view, record.unit) for score in found)) for view in views),
    )


def _score_of(sheet: PhotographSheet, metric: str) -> Score | None:
    return next((score for score in sheet.scores if score.metric == metric), None)


def _cell(score: Score | None, unit: str) -> ScoreCell:
    if score is None:
        return ScoreCell("–", "not provided")
    if score.value is None:
        return ScoreCell("–" if score.status == "not provided" else "failed", score.status, score.reason)
    taken = score.breakdown.get("as_taken")
    note = "" if taken is None else f"as taken {format_value(taken, unit)}"
    return ScoreCell(format_value(score.value, unit), "scored", note=note)


def _view_cell(score: Score | None, view: str, unit: str) -> ScoreCell:
    value = score.per_view.get(view) if score else None
    if value is None:
        return ScoreCell("–", "not provided")
    return ScoreCell(format_value(value, unit), "scored")


def _described(held: HeldOut) -> str:
    camera, train = held.capture.views[0].camera, len(held.capture.train)
    return (
        f"{count(train, 'training photograph')} and {count(len(held.views), 'held-out one')} of "
        f"{camera.width} × {camera.height} pixels"
    )


def _thumbnail(held: HeldOut, view: View) -> PagePicture:
    small = shrink(held.capture.photograph(view).astype(np.float64), THUMBNAIL_SIDE)
    return light_picture(small * held.capture.exposure, f"training photograph {view.name}")


def _faults(methods: Sequence[MethodEvidence]) -> Iterator[tuple[str, str]]:
    for method in methods:
        if method.fault:
            yield method.method, method.fault
        yield from ((method.method, f"{view}: {why}") for view, why in method.faults.items())


def _spread(views: Sequence[View], most: int) -> tuple[View, ...]:
    """Return at most so many views, evenly chosen from first to last."""
    if len(views) <= most:
        return tuple(views)
    return tuple(views[round(i * (len(views) - 1) / (most - 1))] for i in range(most))
