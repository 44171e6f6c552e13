# SPDX-License-Identifier: Apache-2.0
"""Pictures under lights, and with objects, that were not there when the scene was photographed.

Whoever takes the albedo for half of what it is, renders half the light under given lamps. So the gauge that
was fitted to its albedo on training views, under the lights of the photographs, is carried over; nothing is
fitted to the changed pictures. Where an object is put in, the lights stay those that the method found: then
albedo and light stand together in the picture, and it has no gauge.
"""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from graycard import EditKind, PredictionError, Predictions, Truth, View
from graycard.eval.measures._pixelwise import square_errors
from graycard.eval.measures._psnr import psnr
from graycard.eval.measures._ssim import ssim
from graycard.eval.metrics._image_metric import display, same
from graycard.eval.metrics._view_metrics import mean, pooled
from graycard.eval.scoring._assembly import Finding, Scene
from graycard.eval.scoring._ceiling import noise_as_displayed
from graycard.eval.scoring._gauge import apply_gauge
from graycard.eval.scoring._readings import PredictedView, TrueView
from graycard.layers import find_fault
from graycard.records import Invariance, MetricRecord, Score, Status

GAUGE = "traded"
"""Name of the gauge of pictures under given lights: what the albedo gains, they gain with it."""

Read = Callable[[], dict[str, np.ndarray] | None]


@dataclass(frozen=True, slots=True)
class ChangedMetric:
    """How one number is made from pictures of the changed scene."""

    record: MetricRecord
    measure: Callable[[np.ndarray, np.ndarray, np.ndarray], float]
    """``(predicted, true, mask)``, as displayed, to the value of one picture."""
    finish: Callable[[float], float]
    """Applied to the mean over pictures."""
    kind: EditKind | None = None
    """Which changes; None for all of them."""
    noisy: bool = False


@dataclass(frozen=True, slots=True)
class Picture:
    """A held-out view of the changed scene, as it is and as it was predicted."""

    change: str
    """Name of the edit, or of the object put in."""
    kind: EditKind | None
    view: View
    true: dict[str, np.ndarray]
    predicted: Read
    mask: np.ndarray
    """Shape ``(H, W)``, bool."""
    parts: Mapping[str, np.ndarray] = field(default_factory=dict)
    """Regions to be told apart, by name, each ``(H, W)``, bool."""
    gauged: bool = True
    """Whether the lights were handed in: then the albedo's gauge applies."""

    @property
    def key(self) -> str:
        """Name of the picture in a score."""
        return f"{self.change}/{self.view.name}"


@dataclass(slots=True)
class Masks:
    """What each test view sees, and what is the same for all: gathered while they pass by."""

    seen: dict[str, np.ndarray] = field(default_factory=dict)
    """Pixels that are judged, by view, each ``(H, W)``, bool."""
    scene: Scene | None = None

    def observe(self, predicted: PredictedView, true: TrueView, scene: Scene) -> None:
        """Keep the mask of a view."""
        self.seen[true.view.name], self.scene = true.mask("radiance"), scene


def square_error(predicted: np.ndarray, true: np.ndarray, mask: np.ndarray) -> float:
    """Mean over pixels and channels."""
    return float(square_errors(predicted, true, mask).mean())


def _record(
    group: str, name: str, title: str, rule: str, headline: bool = False, unit: str = "dB"
) -> MetricRecord:
    best, tolerance = (math.inf, 0.3) if unit == "dB" else (1.0, 0.01)
    where = "as displayed, srgb(L·exposure), over the mask of the test views"
    own = group == "composition"
    scale = (
        "s_c of the prediction's albedo (base_color, else diffuse_reflectance, else albedo; 1 where it has "
        "none) on training views under the lights of the photographs"
    )
    formula = f"{rule} of radiance {where}" if own else f"{rule} of s_c·radiance {where}, {scale}"
    ignores: tuple[Invariance, ...] = () if own else ("global gain", "channel gain")
    return MetricRecord(
        f"{group}.{name}", title, group, unit, True, best, formula, headline, tolerance, ignores
    )


_PSNR = "10·log10(1 / mean of MSE over changes and views)"
_SSIM = "mean over changes and views of SSIM (Gaussian 11x11, sigma 1.5, eroded mask)"
_KINDS: tuple[tuple[EditKind, str], ...] = (
    ("off", "a light off"),
    ("moved", "a light moved"),
    ("recoloured", "a light in another colour"),
    ("environment", "other surroundings"),
)

RELIGHTING_METRICS: tuple[ChangedMetric, ...] = (
    ChangedMetric(
        _record("relighting", "psnr", "Relighting PSNR", _PSNR, headline=True),
        square_error,
        psnr,
        noisy=True,
    ),
    ChangedMetric(_record("relighting", "ssim", "Relighting SSIM", _SSIM, unit="1"), ssim, same),
    *(
        ChangedMetric(
            _record("relighting", f"psnr.{kind}", f"Relighting PSNR, {title}", f"{_PSNR}, {title},"),
            square_error,
            psnr,
            kind,
            noisy=True,
        )
        for kind, title in _KINDS
    ),
)

COMPOSITION_METRICS: tuple[ChangedMetric, ...] = (
    ChangedMetric(_record("composition", "psnr", "Composition PSNR", _PSNR), square_error, psnr, noisy=True),
    ChangedMetric(_record("composition", "ssim", "Composition SSIM", _SSIM, unit="1"), ssim, same),
)


def score_changed(predictions: Predictions, truth: Truth, masks: Masks) -> list[Score]:
    """Scores of relighting and of composition, as far as the scene has the changes.

    Args:
        predictions: What is scored.
        truth: What it is scored by.
        masks: Gathered from the test views.

    Raises:
        DatasetError: The truth of a changed view is missing or broken.
    """
    assert masks.scene is not None, "views were observed"
    relit = _score(RELIGHTING_METRICS, _relit(predictions, truth, masks), masks.scene)
    return relit + _score(COMPOSITION_METRICS, _composed(predictions, truth), masks.scene)


def _relit(predictions: Predictions, truth: Truth, masks: Masks) -> Iterator[Picture]:
    for edit in truth.edits:
        for view in (v for v in truth.views if v.split == "test" and masks.seen[v.name].any()):
            yield Picture(
                edit.name,
                edit.kind,
                view,
                truth.relit(edit.name, view),
                lambda e=edit.name, v=view.name: predictions.relit(e, v),
                masks.seen[view.name],
            )


def _composed(predictions: Predictions, truth: Truth) -> Iterator[Picture]:
    composition = truth.composition()
    for view in (v for v in truth.views if v.split == "test" and composition is not None):
        assert composition is not None
        true = truth.composed(view)
        put_in = true["object_id"] == composition.object_id
        yield Picture(
            composition.donor.object,
            None,
            view,
            true,
            lambda v=view.name: predictions.composed(v),
            true["object_id"] > 0,
            {"object": put_in, "around": (true["object_id"] > 0) & ~put_in},
            gauged=False,
        )


def _score(table: Sequence[ChangedMetric], pictures: Iterator[Picture], scene: Scene) -> list[Score]:
    """One score for each metric that has a picture."""
    found: dict[str, dict[str, Finding]] = {}
    kinds: dict[str, EditKind | None] = {}
    for picture in pictures:
        kinds[picture.key] = picture.kind
        for name, finding in judge_picture(table, picture, scene).items():
            found.setdefault(name, {})[picture.key] = finding
    return [_pool(m, found[m.record.id], kinds, scene) for m in table if m.record.id in found]


def judge_picture(table: Sequence[ChangedMetric], picture: Picture, scene: Scene) -> dict[str, Finding]:
    """Judge one picture by every metric that its change belongs to; a fault is found, not raised.

    Raises:
        DatasetError: The truth of the picture is broken.
    """
    asked = [m for m in table if m.kind in (None, picture.kind)]
    true = TrueView(picture.view, picture.true, frozenset())
    radiance = true.take("radiance")
    noise = {m.record.id: _noise(m, true, picture.mask, scene.exposure) for m in asked}
    try:
        values = _gauged(picture, scene)
    except PredictionError as cause:
        return {name: Finding(reason=str(cause), noise=best) for name, best in noise.items()}
    if values is None:
        return {name: Finding(reason=_ABSENT, noise=best) for name, best in noise.items()}
    images = display(values, scene.exposure), display(radiance, scene.exposure)
    return {m.record.id: _judge(m, picture, images, noise[m.record.id]) for m in asked}


_ABSENT = ""
"""Reason of a picture that was not provided."""


def _judge(
    metric: ChangedMetric, picture: Picture, images: tuple[np.ndarray, np.ndarray], noise: float | None
) -> Finding:
    parts = {}
    if metric.finish is psnr:
        parts = {n: metric.measure(*images, at) for n, at in picture.parts.items() if at.any()}
    value = metric.measure(*images, picture.mask)
    return Finding(value, noise=noise, parts=parts)


def _gauged(picture: Picture, scene: Scene) -> np.ndarray | None:
    """The predicted picture, in the gauge of the truth where it has one; None where there is none.

    Raises:
        PredictionError: It is unreadable, of another size or not finite, or there is no gauge.
    """
    where, camera = f"{picture.change}, {picture.view.name}", picture.view.camera
    layers = picture.predicted()
    if layers is None:
        return None
    if "radiance" not in layers:
        raise PredictionError(f"{where}: expected radiance, got {', '.join(layers)}. Write this layer")
    if fault := find_fault("radiance", layers["radiance"], camera.height, camera.width):
        raise PredictionError(f"{where}: {fault}. Write this picture again")
    if not picture.gauged:
        return layers["radiance"].astype(np.float64)
    gauge = scene.gauges[GAUGE]
    if isinstance(gauge, str):
        raise PredictionError(gauge)
    return apply_gauge(layers["radiance"], gauge)


def _noise(metric: ChangedMetric, true: TrueView, mask: np.ndarray, exposure: float) -> float | None:
    return noise_as_displayed(true, "radiance", mask, exposure) if metric.noisy else None


def _pool(
    metric: ChangedMetric,
    findings: Mapping[str, Finding],
    kinds: Mapping[str, EditKind | None],
    scene: Scene,
) -> Score:
    status, reason = _status(findings, kinds)
    factors = scene.gauges[GAUGE]
    gauge = factors if isinstance(factors, tuple) and metric in RELIGHTING_METRICS else None
    score = pooled(metric.record, metric.finish, findings, status=status, reason=reason, gauge=gauge)
    if status != "scored":
        return score
    changes = _by_change(findings)
    parts = {name: metric.finish(mean(values)) for name, values in changes.items() if len(changes) > 1}
    return replace(score, breakdown={**score.breakdown, **parts})


def _by_change(findings: Mapping[str, Finding]) -> dict[str, list[float]]:
    values: dict[str, list[float]] = {}
    for key, finding in findings.items():
        if finding.value is not None:
            values.setdefault(key.split("/")[0], []).append(finding.value)
    return values


def _status(findings: Mapping[str, Finding], kinds: Mapping[str, EditKind | None]) -> tuple[Status, str]:
    """A kind of change without any picture is not provided; one that lacks some has failed."""
    faults = [f.reason for f in findings.values() if f.value is None and f.reason != _ABSENT]
    if faults:
        more = f" (and {len(faults) - 1} more)" if len(faults) > 1 else ""
        return "failed", faults[0] + more
    absent = [key for key, f in findings.items() if f.value is None]
    given = {kinds[key] for key, f in findings.items() if f.value is not None}
    lost = [key for key in absent if kinds[key] in given]
    if lost:
        return "failed", (
            f"expected a picture of every change and test view, got none of {', '.join(lost[:3])}"
            f"{f' and {len(lost) - 3} more' if len(lost) > 3 else ''}. Write all of a kind of change or none"
        )
    if absent:
        changes = dict.fromkeys(key.split("/")[0] for key in absent)
        return "not provided", f"no picture of {', '.join(changes)}"
    return "scored", ""
