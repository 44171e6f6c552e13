# SPDX-License-Identifier: Apache-2.0
"""Scores of the predicted images of a scene, view by view."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

import graycard as gc
from graycard.eval._breakdown import Comparison, breakdown, measure
from graycard.eval._gauge import Factors, apply_gauge
from graycard.eval._metrics import IMAGE_METRICS, ImageMetric
from graycard.eval._psnr import psnr
from graycard.eval._readings import PredictedView, TrueView, read_prediction, read_truth
from graycard.eval._ssim import interior, ssim
from graycard.eval._training import Training, survey_training
from graycard.eval.protocols import PROTOCOL

OPTIONAL = frozenset({"counterfactual.radiance"})
"""Layers that the truth of some scenes does not have."""
_SUSPICIOUS = 1.0
"""dB above the noise ceiling: no estimate of the noise-free image scores that high by chance."""


Comparisons = dict[tuple[str, Factors], Comparison]
"""By layer and gauge."""


@dataclass(frozen=True, slots=True)
class Finding:
    """What one metric says about one test view."""

    value: float | None = None
    """Before ``finish``; None where it failed."""
    reason: str = ""
    """Why it failed."""
    warnings: tuple[str, ...] = ()
    noise: float | None = None
    """Mean display variance of the truth over the mask; None where it is not known."""
    parts: Mapping[str, float] = field(default_factory=dict)
    """The same by neighbouring rules, before ``finish``."""


@dataclass(frozen=True, slots=True)
class Scene:
    """What is the same for all test views."""

    exposure: float
    training: Training
    gauges: Mapping[str, Factors | str] = field(default_factory=dict)
    """By kind: the factors, or why there are none."""


class Observer(Protocol):
    """What else looks at the test views while they are in memory."""

    def observe(self, predicted: PredictedView, true: TrueView, scene: Scene) -> None:
        """Look at one view."""
        ...


def score_images(
    predictions: gc.Predictions, truth: gc.Truth, observers: Sequence[Observer] = ()
) -> list[gc.Score]:
    """All image scores, in the order of the table.

    Args:
        predictions: What is scored.
        truth: What it is scored by.
        observers: Each is shown every test view.

    Raises:
        DatasetError: The truth is broken, or no test view sees an object.
    """
    training = survey_training(predictions, truth)
    scene = Scene(truth.exposure, training, fit_gauges(training))
    tests = [v for v in truth.views if v.split == "test"]
    first = read_truth(truth, tests[0])
    table = _applicable(first)
    findings: dict[str, dict[str, Finding]] = {m.record.id: {} for m in table}
    provided, unreadable = set(training.provided), list(training.unreadable)
    for view in tests:
        predicted, true = (
            read_prediction(predictions, view),
            first if view is tests[0] else read_truth(truth, view),
        )
        provided |= predicted.layers.keys()
        unreadable += [predicted.fault] if predicted.fault else []
        for observer in observers:
            observer.observe(predicted, true, scene)
        comparisons: Comparisons = {}
        for metric in table:
            if true.mask(metric.layer).any():
                findings[metric.record.id][view.name] = judge(metric, predicted, true, scene, comparisons)
    extra = _unknown_views(predictions, truth)
    return [_assemble(m, findings[m.record.id], scene, m.layer in provided, unreadable, extra) for m in table]


def judge(
    metric: ImageMetric, predicted: PredictedView, true: TrueView, scene: Scene, comparisons: Comparisons
) -> Finding:
    """Judge one view by one metric; a fault of the prediction is found, not raised.

    Args:
        metric: What to measure.
        predicted: The prediction of the view.
        true: Its truth.
        scene: What is the same for all views.
        comparisons: What other metrics have computed for this view; it grows.

    Raises:
        DatasetError: The truth of the view is broken.
    """
    mask, reference = true.mask(metric.layer), _checked(metric.layer, true)
    noise = _noise(metric, true, mask, scene.exposure)
    gauge = scene.gauges.get(metric.gauge or "raw", "")
    try:
        values = predicted.take(metric.layer)
        if isinstance(gauge, str):
            return Finding(reason=gauge)
        key = metric.layer, gauge
        if key not in comparisons:
            values = apply_gauge(values, gauge)
            images = values, reference.astype(np.float64), mask
            comparisons[key] = Comparison(*images, scene.exposure, _variance(true, metric.layer), true.pure())
        seen = comparisons[key]
        value, parts = measure(metric, seen)
    except gc.GraycardError as cause:
        return Finding(reason=str(cause))
    return Finding(value, "", _warnings(metric, seen.predicted, mask, true.view.name), noise, parts)


def _applicable(first: TrueView) -> list[ImageMetric]:
    """The metrics that a scene has; the first test view decides, and the others must have its layers."""
    absent = OPTIONAL - first.layers.keys()
    return [m for m in IMAGE_METRICS if m.layer not in absent]


def fit_gauges(training: Training) -> dict[str, Factors | str]:
    found: dict[str, Factors | str] = {}
    for kind in ("raw", "scalar", "channel"):
        try:
            found[kind] = training.gauge(kind)
        except gc.PredictionError as cause:
            found[kind] = str(cause)
    return found


def _checked(layer: str, true: TrueView) -> np.ndarray:
    """The true layer; a normal without direction could be met by any prediction."""
    values = true.take(layer)
    if layer == "normal" and not values[true.mask(layer)].any(axis=-1).all():
        raise gc.DatasetError(
            f"expected true normals of unit length in view {true.view.name} wherever an object is seen, "
            "got some of length zero. Run `graycard render` again"
        )
    return values


def _variance(true: TrueView, layer: str) -> np.ndarray | None:
    return true.take(f"{layer}.var") if f"{layer}.var" in true.layers else None


def _noise(metric: ImageMetric, true: TrueView, mask: np.ndarray, exposure: float) -> float | None:
    variance = _variance(true, metric.layer) if metric.noisy else None
    if variance is None:
        return None
    return float(gc.display_variance(true.take(metric.layer), variance, exposure)[mask].mean())


def _warnings(metric: ImageMetric, values: np.ndarray, mask: np.ndarray, view: str) -> tuple[str, ...]:
    if metric.measure is ssim and not interior(mask).any():
        return (f"{view}: no SSIM window fits into the mask; the mean is over the mask itself",)
    if metric.layer == "normal" and (zeros := int((~values[mask].any(axis=-1)).sum())):
        return (f"{view}: {zeros} of {int(mask.sum())} normals have length zero; each counts as 90°",)
    return ()


def _unknown_views(predictions: gc.Predictions, truth: gc.Truth) -> tuple[str, ...]:
    names = sorted(set(predictions.view_names()) - {v.name for v in truth.views})
    return (f"views that this scene does not have were left out: {', '.join(names)}",) if names else ()


def _assemble(
    metric: ImageMetric,
    findings: Mapping[str, Finding],
    scene: Scene,
    provided: bool,
    unreadable: Sequence[str],
    extra: tuple[str, ...],
) -> gc.Score:
    if not findings:
        raise gc.DatasetError(
            f"expected a test view that sees something to judge by {metric.record.id}, got none. "
            "Render the scene again"
        )
    values = {name: f.value for name, f in findings.items() if f.value is not None}
    status, reason = status_of(metric.layer, findings, provided, unreadable)
    pooled = metric.finish(math.fsum(values.values()) / len(values)) if status == "scored" else None
    ceiling = _ceiling([f.noise for f in findings.values()])
    gauge = scene.gauges[metric.gauge] if metric.gauge not in (None, "raw") else ""
    warnings = extra + tuple(w for f in findings.values() for w in f.warnings)
    return gc.Score(
        metric.record.id,
        PROTOCOL,
        status,
        pooled,
        metric.record.unit,
        metric.record.higher_is_better,
        metric.record.optimum,
        per_view={name: metric.finish(value) for name, value in values.items()},
        noise_ceiling=ceiling,
        gauge=gauge if isinstance(gauge, tuple) else None,
        expected=len(findings),
        scored=len(values),
        reason=reason,
        warnings=warnings + _too_good(pooled, ceiling),
        breakdown=breakdown(metric, list(values.values()), [f.parts for f in findings.values()])
        if status == "scored"
        else {},
    )


def status_of(
    layer: str, findings: Mapping[str, Finding], provided: bool, unreadable: Sequence[str]
) -> tuple[gc.Status, str]:
    """Whether findings of a layer make a score, and why not."""
    if unreadable:
        return "failed", unreadable[0]
    if not provided:
        return "not provided", f"no view has {layer}"
    reasons = list(dict.fromkeys(f.reason for f in findings.values() if f.value is None))
    if reasons:
        more = f" (and {len(reasons) - 1} more)" if len(reasons) > 1 else ""
        return "failed", reasons[0] + more
    return "scored", ""


def _ceiling(noise: Sequence[float | None]) -> float | None:
    known = [n for n in noise if n is not None]
    mean = math.fsum(known) / len(known) if len(known) == len(noise) else 0.0
    return psnr(mean) if mean > 0 else None


def _too_good(value: float | None, ceiling: float | None) -> tuple[str, ...]:
    if value is None or ceiling is None or value < ceiling + _SUSPICIOUS:
        return ()
    return (
        f"{value:.1f} dB is above the {ceiling:.1f} dB that the noise of the truth allows: "
        "the prediction holds the noise of the truth itself",
    )
