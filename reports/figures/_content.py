# SPDX-License-Identifier: Apache-2.0
"""The content of a figure, before it is drawn: pictures, errors and words, cell by cell."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from graycard import RecordError, UnknownNameError, View, find_layer
from graycard.records import JobResult, RunRecord, SceneRecord, is_published, read_run
from graycard.reports._evidence import MethodEvidence, SceneEvidence, open_method, open_scene, usable_layer
from graycard.reports._format import format_number, format_with_unit
from graycard.reports._scores import find_score
from graycard.reports.pictures._colour_maps import ColourMap
from graycard.reports.pictures._error_images import error_unit
from graycard.reports.pictures._layer_pictures import layer_picture, mapped, photograph_picture
from graycard.reports.pictures._layer_rows import JudgedLayer, judged_layer, title_of

_SCORES = {
    "radiance": ("novel_view.psnr", "training_view.psnr"),
    "counterfactual.radiance": ("counterfactual.psnr",),
    "base_color": ("albedo.psnr.channel",),
    "normal": ("normal.mean_angle",),
    "depth": ("depth.abs_rel",),
}
"""Metrics that stand below the pictures of a layer: the first that has a value of the view."""


@dataclass(frozen=True, slots=True)
class FigureSpec:
    """Request of a figure."""

    scene: str
    """``SCENE`` or ``TRACK/SCENE``."""
    rows: tuple[str, ...]
    """Methods of the run, a column each."""
    layers: tuple[str, ...]
    view: str = ""
    """The first held-out view if empty."""
    errors: bool = True
    """True if maps of errors stand below the pictures."""


@dataclass(frozen=True, slots=True)
class Cell:
    """A picture with the words below it."""

    pixels: np.ndarray | None
    """Shape ``(H, W, 3)``, uint8, sRGB; None where nothing can be shown."""
    text: str = ""
    """Score below the picture, or the reason why there is none."""
    metric: str = ""
    """Id of the metric of that score."""


@dataclass(frozen=True, slots=True)
class Bar:
    """A colour bar."""

    colours: ColourMap
    low: float
    high: float
    label: str


@dataclass(frozen=True, slots=True)
class Strip:
    """A row of pictures of one layer, a cell for each column."""

    label: str
    cells: tuple[Cell | None, ...]
    """None leaves a place empty."""
    bar: Bar | None


@dataclass(frozen=True, slots=True)
class FigureContent:
    """A figure."""

    columns: tuple[str, ...]
    strips: tuple[Strip, ...]
    aspect: float
    """Height of a picture by its width."""
    view: str
    notes: tuple[str, ...]
    """Contents of a caption: metrics of the scores, and factors that predictions were shown with."""


def figure_content(run: Path, spec: FigureSpec) -> FigureContent:
    """Return what a figure of a run shows.

    Raises:
        UnknownNameError: The run has no such scene or row, the scene no such view, the view no such layer.
        RecordError: No rows or no layers are named, or the run is damaged.
        DatasetError: The folder of the scene is gone or damaged.
    """
    if is_published(run):
        raise RecordError(
            f"expected a run with scenes and predictions, got a published folder, {run}, which has records "
            "alone. Name the run that it was made of"
        )
    record = read_run(run)
    for what, named in (("rows", spec.rows), ("layers", spec.layers)):
        if not named or len({*named}) < len(named):
            raise RecordError(f"expected {what} of different names, got {', '.join(named) or 'none'}")
    scene = _scene(record, spec.scene)
    results = [r for r in record.results if (r.job.track, r.job.scene) == (scene.track, scene.scene)]
    by_row = {row: [r for r in results if r.job.method == row] for row in spec.rows}
    for row, found in by_row.items():
        if not found:
            raise UnknownNameError(f"row of {scene.scene}", row, dict.fromkeys(r.job.method for r in results))
    evidence = open_scene(run / scene.folder)
    view = _view(evidence, spec.view)
    evidence = evidence.at(view)
    _check_layers(evidence, view, spec.layers)
    methods = [open_method(run, found, [view]) for found in by_row.values()]
    return _content(evidence, view, methods, by_row, spec)


def _content(
    evidence: SceneEvidence,
    view: View,
    methods: Sequence[MethodEvidence],
    results: dict[str, list[JobResult]],
    spec: FigureSpec,
) -> FigureContent:
    photograph = _photograph(evidence, view) if {"radiance"} & {*spec.layers} else None
    strips: list[Strip] = []
    notes: list[str] = []
    for name in spec.layers:
        layer = judged_layer(name, evidence, methods)
        first = [] if photograph is None else [photograph if name == "radiance" else None]
        truth = Cell(_pixels(layer, evidence.layers[view.name][name]))
        cells = [_cell(layer, evidence, view, method, results[method.method], notes) for method in methods]
        if any(cell.metric for cell in cells):
            notes.append(f"below {name}: {next(c.metric for c in cells if c.metric)} of view {view.name}")
        strips.append(Strip(title_of(name), (*first, truth, *cells), _value_bar(layer)))
        maps = [_error(layer, view, method) for method in methods] if spec.errors else []
        if any(maps):
            bar = Bar("error", 0.0, layer.error_high, error_unit(name))
            strips.append(Strip("Error", (*(None for _ in first), None, *maps), bar))
    columns = (*(["photograph"] if photograph else []), "truth", *spec.rows)
    height, width = view.camera.height, view.camera.width
    return FigureContent(columns, tuple(strips), height / width, view.name, tuple(notes))


def _scene(record: RunRecord, name: str) -> SceneRecord:
    found = [s for s in record.scenes if name in (s.scene, f"{s.track}/{s.scene}")]
    if len(found) == 1:
        return found[0]
    raise UnknownNameError("scene of this run", name, [f"{s.track}/{s.scene}" for s in record.scenes])


def _view(evidence: SceneEvidence, name: str) -> View:
    if not name and evidence.test:
        return evidence.test[0]
    for view in evidence.truth.views:
        if view.name == name:
            return view
    raise UnknownNameError("view of this scene", name, [view.name for view in evidence.truth.views])


def _check_layers(evidence: SceneEvidence, view: View, layers: Sequence[str]) -> None:
    true = evidence.layers[view.name]
    shown = [name for name in true if find_layer(name).dtype != "uint32"]
    for name in layers:
        if name not in shown:
            raise UnknownNameError(f"layer of {view.name}", name, shown)


def _photograph(evidence: SceneEvidence, view: View) -> Cell | None:
    """Return the photograph of a training view; held-out views have none."""
    if view.name not in {v.name for v in evidence.capture.train}:
        return None
    taken = evidence.capture.photograph(view)
    return Cell(photograph_picture(taken, evidence.truth.exposure), "as taken")


def _cell(
    layer: JudgedLayer,
    evidence: SceneEvidence,
    view: View,
    method: MethodEvidence,
    results: Sequence[JobResult],
    notes: list[str],
) -> Cell:
    values, note = usable_layer(method, view, layer.name, evidence.mask(layer.name, view))
    if values is None:
        return Cell(None, note.partition(":")[0])
    if note:
        notes.append(f"{layer.name} of {method.method} is shown {note}, as it is scored")
    return Cell(_pixels(layer, values), *_score(layer.name, view, results))


def _score(layer: str, view: View, results: Sequence[JobResult]) -> tuple[str, str]:
    """Return the score of the view that goes with a picture, of the job that it is of, and its metric."""
    shown = next((r for r in results if r.status == "done"), results[0])
    for metric in _SCORES.get(layer, ()):
        score = find_score(shown, metric)
        if score and (value := score.per_view.get(view.name)) is not None:
            return format_with_unit(value, score.unit), metric
    return "", ""


def _error(layer: JudgedLayer, view: View, method: MethodEvidence) -> Cell | None:
    error = layer.errors.get((view.name, method.method))
    if error is None:
        return None
    typical = float(np.nanmean(error)) if np.isfinite(error).any() else float("nan")
    return Cell(mapped(error, 0.0, layer.error_high, "error"), f"mean {format_number(typical)}")


def _pixels(layer: JudgedLayer, values: np.ndarray) -> np.ndarray:
    """Return a layer as pixels: numbers by one scale for all, light at one exposure."""
    if len(find_layer(layer.name).channels) == 1:
        return mapped(np.where(np.isfinite(values), values, np.nan), layer.low, layer.high, "depth")
    return layer_picture(layer.name, values, layer.exposure)[0]


def _value_bar(layer: JudgedLayer) -> Bar | None:
    """Return the scale of a layer that is shown through a colour map."""
    kind = find_layer(layer.name)
    if len(kind.channels) > 1:
        return None
    return Bar("depth", layer.low, layer.high, "" if kind.unit == "1" else kind.unit)
