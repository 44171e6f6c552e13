# SPDX-License-Identifier: Apache-2.0
"""Evidence about one scene in the folders of a run; what is missing or broken becomes a reason, no error."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from graycard import (
    Capture,
    EnvironmentLight,
    GraycardError,
    Light,
    Predictions,
    Truth,
    View,
    open_capture,
    open_predictions,
    open_truth,
)
from graycard.dataset import manifest_of
from graycard.layers import find_fault, not_meant
from graycard.records import JobResult, SceneRecord, job_folder
from graycard.reports._format import count
from graycard.reports._scores import find_score

MAX_VIEWS = 2
"""Test views whose pictures are embedded: a report must stay small enough to be mailed."""
GAUGED_BY = "albedo.psnr.channel"
"""The score that holds the factors per channel by which base colour is shown."""
RELIT_BY = "relighting.psnr"
"""The score that holds those by which a relit picture is shown."""


@dataclass(frozen=True, slots=True)
class SceneEvidence:
    """The truth and the capture of a scene, as far as the report shows them."""

    truth: Truth
    capture: Capture
    shown: tuple[View, ...]
    """The test views whose pictures are embedded."""
    layers: Mapping[str, Mapping[str, np.ndarray]]
    """True layers by shown view and name."""
    lights: tuple[Light, ...]
    settings: Mapping[str, Any]
    """Knobs and render settings, from the manifest."""

    @property
    def test(self) -> tuple[View, ...]:
        """All test views."""
        return tuple(v for v in self.truth.views if v.split == "test")

    def mask(self, layer: str, view: View) -> np.ndarray:
        """Return where an error of a layer is shown, ``(H, W)``: on surfaces; of base colour not on
        lights.
        """
        ids = self.layers[view.name].get("object_id")
        if ids is None:
            return np.ones((view.camera.height, view.camera.width), bool)
        left_out = self.truth.emitter_ids() if layer == "base_color" else frozenset()
        return (ids > 0) & ~np.isin(ids, sorted(left_out))

    def at(self, view: View) -> "SceneEvidence":
        """Return the same scene with another test view to be shown.

        Raises:
            DatasetError: The file of the view is missing or broken.
        """
        return replace(self, shown=(view,), layers={view.name: self.truth.layers(view)})


@dataclass(frozen=True, slots=True)
class MethodEvidence:
    """Predictions that one method handed in for a scene."""

    method: str
    fault: str = ""
    """Why nothing of it can be shown."""
    layers: Mapping[str, Mapping[str, np.ndarray]] = field(default_factory=dict)
    """Predicted layers by shown view and name."""
    faults: Mapping[str, str] = field(default_factory=dict)
    """Why a view cannot be shown."""
    lights: tuple[Light, ...] | None = None
    lights_fault: str = ""
    gauge: tuple[float, ...] | None = None
    """Factors for R, G, B, as fitted for the score :data:`GAUGED_BY`."""
    gauged: str = "base_color"
    """The layer that ``gauge`` is for."""
    relit_gauge: tuple[float, ...] | None = None
    """The same of pictures under changed lights, as fitted for the score :data:`RELIT_BY`."""
    seeds: int = 1
    """Number of jobs, of which the first is shown."""
    competes: bool = True
    """True if it was handed the photographs alone."""
    predictions: Predictions | None = None
    """Source of more views."""

    def layer(self, view: str, name: str) -> np.ndarray | None:
        """Return a predicted layer; None where it is not provided."""
        return self.layers.get(view, {}).get(name)

    def at(self, view: View) -> "MethodEvidence":
        """Return the same method with the layers of another view; what cannot be read is a fault of that
        view.
        """
        if self.predictions is None:
            return self
        layers, faults = _read_views(self.predictions, [view])
        return replace(self, layers=layers, faults=faults)


def open_scene(folder: Path) -> SceneEvidence:
    """Return the truth and capture of a scene folder, the layers of a few test views among it.

    Raises:
        DatasetError: A file is missing or broken.
    """
    truth = open_truth(folder / "truth", check=False)
    capture = open_capture(folder / "capture", check=False)
    test = [v for v in truth.views if v.split == "test"]
    shown = tuple(test if len(test) <= MAX_VIEWS else [test[0], test[-1]])
    layers = {view.name: truth.layers(view) for view in shown}
    settings = manifest_of(truth).settings
    return SceneEvidence(truth, capture, shown, layers, truth.lights(), settings)


def open_method(
    run: Path, results: Sequence[JobResult], views: Sequence[View], competes: bool = True
) -> MethodEvidence:
    """Return what a method handed in for a scene, from its first job that is not failed, or from its
    first.
    """
    result = next((r for r in results if r.status == "done"), results[0])
    method, seeds = result.job.method, len(results)
    if result.status == "failed":
        return MethodEvidence(method, fault=result.reason or "the job failed", seeds=seeds, competes=competes)
    try:
        found = open_predictions(job_folder(run, result) / "predictions")
    except GraycardError as cause:
        return MethodEvidence(method, fault=str(cause), seeds=seeds, competes=competes)
    layers, faults = _read_views(found, views)
    lights, lights_fault = _read_lights(found)
    return MethodEvidence(
        method,
        layers=layers,
        faults=faults,
        lights=lights,
        lights_fault=lights_fault,
        gauge=_gauge_of(result, GAUGED_BY),
        relit_gauge=_gauge_of(result, RELIT_BY),
        seeds=seeds,
        competes=competes,
        predictions=found,
    )


def handed_in(name: str, folder: Path, views: Sequence[View]) -> MethodEvidence:
    """Read a predictions folder without a job; a missing or broken picture is a fault."""
    try:
        found = open_predictions(folder)
    except GraycardError as cause:
        return MethodEvidence(name, fault=str(cause))
    layers, faults = _read_views(found, views)
    return MethodEvidence(name, layers=layers, faults=faults, predictions=found)


def usable_layer(
    method: MethodEvidence, view: View, name: str, mask: np.ndarray
) -> tuple[np.ndarray, str] | tuple[None, str]:
    """Return a predicted layer that can be shown, the gauge applied; else None and why.

    Args:
        method: Whose layer.
        view: Of which view.
        name: Of the layer.
        mask: Shape ``(H, W)``, bool: where values must be finite; elsewhere what is not is shown as 0.
    """
    if method.fault or view.name in method.faults:
        return None, "failed"
    values = method.layer(view.name, name)
    if values is None:
        return None, "not provided"
    fault = find_fault(name, values, view.camera.height, view.camera.width, within=mask)
    if fault:
        return None, f"failed: {fault}"
    values = np.where(not_meant(name, values), 0, values)
    if name == method.gauged and method.gauge:
        return values * np.array(method.gauge), "× " + " ".join(f"{g:.3g}" for g in method.gauge)
    return values, ""


def describe_scene(scene: SceneRecord, evidence: SceneEvidence) -> str:
    """One line of figures about a scene."""
    views, camera = evidence.truth.views, evidence.truth.views[0].camera
    train = sum(v.split == "train" for v in views)
    parts = [
        f"family {scene.family}, {'secret seed' if scene.seed is None else f'seed {scene.seed}'}",
        f"{count(train, 'training photograph')} and {count(len(evidence.test), 'test view')} "
        f"of {camera.width} × {camera.height} pixels",
        _count_lights(evidence.lights),
    ]
    names = [o.name for o in evidence.truth.objects if o.id == evidence.truth.target]
    parts += [f"object to remove: {name}" for name in names]
    ceiling = evidence.truth.noise_ceiling
    return "; ".join(parts + ([] if ceiling is None else [f"noise ceiling {ceiling:.1f} dB"]))


def _count_lights(lights: Sequence[Light]) -> str:
    mounted = sum(not isinstance(o, EnvironmentLight) and o.frame == "camera" for o in lights)
    return count(len(lights), "light") + (f" ({mounted} on the camera)" if mounted else "")


def _read_views(
    predictions: Predictions, views: Sequence[View]
) -> tuple[dict[str, dict[str, np.ndarray]], dict[str, str]]:
    layers: dict[str, dict[str, np.ndarray]] = {}
    faults: dict[str, str] = {}
    for view in views:
        try:
            layers[view.name] = predictions.layers(view.name)
        except GraycardError as cause:
            faults[view.name] = str(cause)
    return layers, faults


def _read_lights(predictions: Predictions) -> tuple[tuple[Light, ...] | None, str]:
    try:
        return predictions.lights(), ""
    except GraycardError as cause:
        return None, str(cause)


def _gauge_of(result: JobResult, metric: str) -> tuple[float, ...] | None:
    score = find_score(result, metric)
    return score.gauge or None if score else None
