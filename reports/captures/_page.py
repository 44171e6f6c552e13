# SPDX-License-Identifier: Apache-2.0
"""The content of the page of an imported capture, before any HTML."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from graycard import Truth, View, find_layer
from graycard.dataset import HeldOut, open_held_out
from graycard.records import PhotographSheet
from graycard.reports._comparison import THUMBNAIL_SIDE, Gallery, ViewPictures
from graycard.reports._evidence import MethodEvidence, SceneEvidence, handed_in
from graycard.reports._format import count
from graycard.reports.captures._lights import FoundLight, found_lights
from graycard.reports.captures._scores import ScoreTable, score_table
from graycard.reports.pictures._layer_rows import LayerRow, bare_row, judged_layer, layer_row
from graycard.reports.pictures._pictures import PagePicture, light_picture, shrink

MAX_VIEWS = 3
"""Held-out views whose pictures are embedded: first, middle and last."""
MAX_THUMBNAILS = 12
MAX_SIDE = 256
"""Pixels of a picture: photographs have more to show than small rendered scenes."""
MODEL_UNIT = "units of the imported cameras"
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
    scores: ScoreTable
    lights: tuple[FoundLight, ...]
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
    radiance = replace(judged_layer("radiance", evidence, methods), side=MAX_SIDE)
    capture = held.capture
    return CapturePage(
        capture.scene,
        capture.track,
        rows[0].sheet.kind,
        _described(held),
        tuple(row.name for row in rows),
        score_table([(row.name, row.sheet) for row in rows]),
        found_lights(methods),
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
    """Return a method whose light, its parts too, is brought to the exposure of each photograph."""
    layers = {name: dict(found) for name, found in method.layers.items()}
    for view in shown:
        own, exposure = layers.get(view.name, {}), np.float32(held.exposure(view))
        for name in ("radiance", *_LAYERS):
            if name in own and "sr" in find_layer(name).unit:
                own[name] = own[name] * exposure
    return replace(method, layers=layers)


def _layers(held: HeldOut, view: View, methods: Sequence[MethodEvidence]) -> tuple[LayerRow, ...]:
    given = {name for method in methods for name in method.layers.get(view.name, {})}
    names = [name for name in _LAYERS if name in given]
    return tuple(_of_model(bare_row(name, view, held.capture.exposure, methods, MAX_SIDE)) for name in names)


def _of_model(row: LayerRow) -> LayerRow:
    """Return a row without metres: what a metre is in an imported model is not known."""
    if row.unit != "m" or row.value_scale is None:
        return row
    return replace(
        row, unit=MODEL_UNIT, values="of these units", value_scale=replace(row.value_scale, unit=MODEL_UNIT)
    )


def _described(held: HeldOut) -> str:
    camera, train = held.capture.views[0].camera, len(held.capture.train)
    told = (
        f"{count(train, 'training photograph')} and {count(len(held.views), 'held-out one')} of "
        f"{camera.width} × {camera.height} pixels"
    )
    sensor = held.capture.sensor
    exposures = [*(sensor.exposures.values() if sensor else ()), *map(held.exposure, held.views)]
    span = max(exposures) / min(exposures)
    return told if span < 1.01 else f"{told}; exposures up to {span:.3g} times apart"


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
