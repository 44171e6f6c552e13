# SPDX-License-Identifier: Apache-2.0
"""Scores of the predicted images of a scene, view by view."""

from collections.abc import Mapping, Sequence, Set
from dataclasses import replace
from itertools import groupby
from typing import Protocol

import numpy as np

from graycard import DatasetError, GraycardError, Predictions, Truth
from graycard.eval.measures._ssim import interior, ssim
from graycard.eval.metrics._albedo import IMAGE_METRICS
from graycard.eval.metrics._image_metric import ImageMetric
from graycard.eval.scoring._assembly import Finding, Scene, assemble, by_record
from graycard.eval.scoring._breakdown import Comparison, measure
from graycard.eval.scoring._gauge import Factors, apply_gauge
from graycard.eval.scoring._readings import (
    PredictedView,
    TrueView,
    read_prediction,
    read_truth,
    with_darkness,
)
from graycard.eval.scoring._training import Training, fit_gauges
from graycard.layers import lights_of
from graycard.records import Score

REQUIRED = frozenset({"radiance", "base_color", "normal"})
"""Layers that the truth of every scene has; what depends on another is left out of a sheet without it."""

Comparisons = dict[tuple[str, Factors, bool], Comparison]
"""By layer, gauge, and whether the colour chart alone is judged."""


class Observer(Protocol):
    """What else looks at the test views while they are in memory."""

    def observe(self, predicted: PredictedView, true: TrueView, scene: Scene) -> None:
        """Look at one view."""
        ...


def score_images(
    predictions: Predictions,
    truth: Truth,
    training: Training,
    names: Mapping[str, str] | None = None,
    observers: Sequence[Observer] = (),
) -> list[Score]:
    """All image scores, in the order of the table.

    Args:
        predictions: What is scored.
        truth: What it is scored by.
        training: What the training views say.
        names: True names of lights by predicted ones; None where they are as they are.
        observers: Each is shown every test view.

    Raises:
        DatasetError: The truth is broken, or no test view sees an object.
    """
    scene = Scene(truth.exposure, training, fit_gauges(training))
    tests = [v for v in truth.views if v.split == "test"]
    first = read_truth(truth, tests[0])
    table = _applicable(first)
    findings: dict[ImageMetric, dict[str, Finding]] = {m: {} for m in table}
    provided, unreadable = set(training.provided), list(training.unreadable)
    surplus: set[str] = set()
    for view in tests:
        true = first if view is tests[0] else read_truth(truth, view)
        predicted = read_prediction(predictions, view, names)
        provided |= predicted.layers.keys()
        surplus |= predicted.surplus
        lit = with_darkness(predicted, [m.layer for m in table], names)
        unreadable += [predicted.fault] if predicted.fault else []
        for observer in observers:
            observer.observe(predicted, true, scene)
        for _, metrics in groupby(table, key=lambda m: m.layer):
            comparisons: Comparisons = {}  # of one layer at a time: all at once would take a gigabyte
            for metric in (m for m in metrics if true.mask(m.layer, m.chart).any()):
                findings[metric][view.name] = judge(metric, lit, true, scene, comparisons)
    seen = [m for m in table if findings[m] or (m.layer in REQUIRED and not m.chart)]
    extra = _unknown_views(predictions, truth)
    return [
        assemble(group, findings, scene, provided, unreadable, extra + _surplus(group[0].layer, surplus))
        for group in by_record(seen)
    ]


def _surplus(layer: str, surplus: Set[str]) -> tuple[str, ...]:
    """Layers of predicted lights that stand for no true one: nothing judges them."""
    stem = layer.rpartition(".")[0]
    found = sorted(name for name in surplus if name.rpartition(".")[0] == stem)
    return (
        (f"of lights that the scene has not, and not judged: {', '.join(found)}",) if stem and found else ()
    )


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
    mask, reference = true.mask(metric.layer, metric.chart), _checked(metric.layer, true)
    exposure = scene.exposure * metric.brightness
    gauge = scene.gauges.get(metric.gauge, "") if metric.gauge else (1.0, 1.0, 1.0)
    try:
        values = predicted.take(metric.layer)
        if isinstance(gauge, str):
            return Finding(reason=gauge)
        key = metric.layer, gauge, metric.chart
        if key not in comparisons:
            values = apply_gauge(values, gauge) if metric.gauge else values.astype(np.float64)
            images = values, reference.astype(np.float64), mask
            comparisons[key] = Comparison(*images, exposure, _variance(true, metric.layer), true.pure())
        seen = comparisons[key]
        value, parts = measure(metric, seen)
    except GraycardError as cause:
        return Finding(reason=str(cause))
    noise = seen.noise(metric.space) if metric.noisy else None
    return Finding(value, "", _warnings(metric, seen.predicted, mask, true.view.name), noise, parts)


def _applicable(first: TrueView) -> list[ImageMetric]:
    """The metrics that a scene has; the first test view decides, and the others must have its layers."""
    table = [each for m in IMAGE_METRICS for each in _of_each_light(m, first)]
    return [m for m in table if m.layer in REQUIRED | first.layers.keys() and m.available()]


def _of_each_light(metric: ImageMetric, first: TrueView) -> list[ImageMetric]:
    stem = metric.layer.removesuffix("<light>")
    if stem == metric.layer:
        return [metric]
    return [replace(metric, layer=stem + light) for light in lights_of(stem.rstrip("."), first.layers)]


def _checked(layer: str, true: TrueView) -> np.ndarray:
    """The true layer; a normal without direction could be met by any prediction."""
    values = true.take(layer)
    if layer == "normal" and (_aimless(values) & true.mask(layer)).any():
        raise DatasetError(
            f"expected true normals of unit length in view {true.view.name} wherever an object is seen, "
            "got some of length zero. Run `graycard render` again"
        )
    return values


def _variance(true: TrueView, layer: str) -> np.ndarray | None:
    return true.take(f"{layer}.var") if f"{layer}.var" in true.layers else None


def _warnings(metric: ImageMetric, values: np.ndarray, mask: np.ndarray, view: str) -> tuple[str, ...]:
    if metric.measure is ssim and not interior(mask).any():
        return (f"{view}: no SSIM window fits into the mask; the mean is over the mask itself",)
    if metric.layer == "depth" and (holes := int(np.isposinf(values[mask]).sum())):
        return (f"{view}: {holes} of {int(mask.sum())} depths are +inf where there is a surface",)
    if metric.layer == "normal" and (zeros := int((_aimless(values) & mask).sum())):
        return (f"{view}: {zeros} of {int(mask.sum())} normals have length zero; each counts as 90°",)
    return ()


def _aimless(directions: np.ndarray) -> np.ndarray:
    """Where a direction has no length, shape ``(H, W)``, bool."""
    x, y, z = np.moveaxis(directions, -1, 0)
    return (x == 0) & (y == 0) & (z == 0)


def _unknown_views(predictions: Predictions, truth: Truth) -> tuple[str, ...]:
    names = sorted(set(predictions.view_names()) - {v.name for v in truth.views})
    return (f"views that this scene does not have were left out: {', '.join(names)}",) if names else ()
