# SPDX-License-Identifier: Apache-2.0
"""Metrics that compare a predicted layer with the true layer of that name, pixel by pixel or by windows."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import reduce
from itertools import groupby
from typing import Any

import numpy as np

from graycard import DatasetError, GraycardError, Predictions, Truth
from graycard.eval.kinds._metric import Metric, Rule, Scorer
from graycard.eval.measures._pixelwise import Bracketed, Pixelwise
from graycard.eval.measures._psnr import psnr
from graycard.eval.measures._spaces import Space, same
from graycard.eval.measures._ssim import interior, ssim
from graycard.eval.scoring._comparison import LayerComparison
from graycard.eval.scoring._findings import Finding, SceneFacts, mean, pooled, status_of
from graycard.eval.scoring._gauge import Factors, apply_gauge
from graycard.eval.scoring._readings import PredictedView, TrueView, with_darkness
from graycard.layers import lights_of
from graycard.records import Score

REQUIRED = frozenset({"radiance", "base_color", "normal"})
"""Layers that the truth of every scene has; a sheet goes without metrics of others that it lacks."""
EACH_LIGHT = "<light>"
"""End of the name of a layer that there is one of for each light."""

Comparisons = dict[tuple[str, Factors, bool], LayerComparison]
"""By layer, gauge, and whether the colour chart alone is judged."""


@dataclass(frozen=True, slots=True)
class ImageRule(Rule):
    """Computes one number from one layer of the test views and the true layer of that name."""

    space: Space
    measure: Callable[[np.ndarray, np.ndarray, np.ndarray], float]
    """``(predicted, true, mask) -> value of one view`` that is averaged over views."""
    finish: Callable[[float], float] = same
    """Applied to the mean over views."""
    other_space: tuple[str, Space] | None = None
    """Another space that the breakdown has the same number in, and its name there."""
    brightness: float = 1.0
    """Factor on the exposure of the scene, for a layer that is not itself seen in photographs."""
    chart: bool = False
    """Judge the colour chart alone."""
    least_side: int = 1
    """Pixels that each side of each test view needs; scenes with smaller views go without."""

    @classmethod
    def scorer(
        cls, metrics: "Sequence[Metric[ImageRule]]", predictions: Predictions, truth: Truth, scene: SceneFacts
    ) -> "ImageScorer":
        """Begin to score; see :class:`Rule`."""
        unknown = sorted(set(predictions.view_names()) - {v.name for v in truth.views})
        sides = [min(v.camera.width, v.camera.height) for v in truth.views if v.split == "test"]
        fitting = [metric for metric in metrics if metric.rule.least_side <= min(sides, default=0)]
        return ImageScorer(fitting, scene, unknown)

    @property
    def space_name(self) -> str:
        """Space of the comparison in words."""
        return self.space.name


ImageMetric = Metric[ImageRule]


@dataclass(slots=True)
class ImageScorer(Scorer):
    """Findings of image metrics, gathered while the views pass by."""

    metrics: Sequence[ImageMetric]
    scene: SceneFacts
    unknown: Sequence[str]
    """Names of predicted views that the scene does not have."""
    table: list[ImageMetric] | None = None
    """Metrics that the scene has, one for each light where there is such a layer; set by the first view."""
    findings: dict[ImageMetric, dict[str, Finding]] = field(default_factory=dict)
    """By metric and view."""
    provided: set[str] = field(default_factory=set)
    unreadable: list[str] = field(default_factory=list)
    surplus: set[str] = field(default_factory=set)
    """Names of layers of predicted lights that stand for no true one."""

    def observe(self, predicted: PredictedView, true: TrueView, scene: SceneFacts) -> None:
        """Judge a test view; see :class:`Scorer`."""
        if self.table is None:
            self.table = _applicable(self.metrics, true)
            self.findings = {m: {} for m in self.table}
        self.provided |= predicted.provided
        self.unreadable += [predicted.fault] if predicted.fault else []
        self.surplus |= predicted.surplus
        lit = with_darkness(predicted, [m.layer for m in self.table], scene.light_names)
        for _, metrics in groupby(self.table, key=lambda m: m.layer):
            comparisons: Comparisons = {}  # of one layer at a time: all at once would take a gigabyte
            for metric in (m for m in metrics if true.mask(m.layer, m.rule.chart).any()):
                self.findings[metric][true.view.name] = judge(metric, lit, true, scene, comparisons)

    def scores(self) -> list[Score]:
        """Return one score for each metric; see :class:`Scorer`.

        Raises:
            DatasetError: No test view sees anything that is judged.
        """
        seen: dict[str, list[ImageMetric]] = {}
        for metric, found in self.findings.items():
            if found or is_in_every_view(metric):
                seen.setdefault(metric.id, []).append(metric)
        return [self._score(metric, seen[metric.id]) for metric in self.metrics if metric.id in seen]

    def _score(self, metric: ImageMetric, metrics: Sequence[ImageMetric]) -> Score:
        """Return one score of a metric, over the layers of all lights where there is one for each."""
        findings = _mean_over_lights([self.findings[m] for m in metrics])
        if not findings:
            raise DatasetError(
                f"expected a test view that sees something to judge by {metric.id}, got none. "
                "Render the scene again"
            )
        training = self.scene.training
        given = {m.layer for m in metrics} & (self.provided | training.provided)
        unreadable = [*training.unreadable, *self.unreadable]
        status, reason = status_of(metric.layer, findings, bool(given), unreadable)
        gauge = self.scene.fitted(metric.gauge)
        whole = {name: replace(f, parts={}) for name, f in findings.items()}  # parts have a rule of their own
        score = pooled(metric.record, metric.rule.finish, whole, status=status, reason=reason, gauge=gauge)
        warnings = self._warnings(metric) + tuple(w for f in findings.values() for w in f.warnings)
        if status != "scored":
            return replace(score, warnings=warnings)
        dark = _dark([m.layer for m in metrics if m.layer not in given])
        parts = breakdown(metric, [f for f in findings.values() if f.value is not None])
        return replace(score, warnings=warnings + dark + score.warnings, breakdown=parts)

    def _warnings(self, metric: ImageMetric) -> tuple[str, ...]:
        """Return what the whole folder has that is not judged: views, and layers of lights."""
        found: list[str] = []
        if self.unknown:
            found.append(f"views that this scene does not have were left out: {', '.join(self.unknown)}")
        layers = sorted(n for n in self.surplus if f"{n.rpartition('.')[0]}.{EACH_LIGHT}" == metric.layer)
        if layers:
            found.append(f"of lights that the scene has not, and not judged: {', '.join(layers)}")
        return tuple(found)


def is_in_every_view(metric: Metric[Any]) -> bool:
    """Tell whether each held-out view with an object in it has a value of a metric.

    Others judge what some views do not show: a colour chart, the shadow of a target, a highlight.
    """
    return isinstance(metric.rule, ImageRule) and metric.layer in REQUIRED and not metric.rule.chart


def judge(
    metric: ImageMetric, predicted: PredictedView, true: TrueView, scene: SceneFacts, comparisons: Comparisons
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
    mask, reference = true.mask(metric.layer, metric.rule.chart), _checked(metric.layer, true)
    gauge = scene.gauges.get(metric.gauge, "") if metric.gauge else (1.0, 1.0, 1.0)
    try:
        values = predicted.take(metric.layer, true.mask(metric.layer))
        if isinstance(gauge, str):
            return Finding(reason=gauge)
        key = metric.layer, gauge, metric.rule.chart
        if key not in comparisons:
            values = apply_gauge(values, gauge) if metric.gauge else values.astype(np.float64)
            images, exposure = (values, reference.astype(np.float64)), scene.exposure * metric.rule.brightness
            variance = _variance(true, metric.layer)
            shown = next((c.true_shown for c in comparisons.values() if c.exposure == exposure), {})
            comparisons[key] = LayerComparison(*images, mask, exposure, variance, true.pure(), shown)
        seen = comparisons[key]
        value, parts = measure(metric, seen)
    except GraycardError as cause:
        return Finding(reason=str(cause))
    noise = seen.noise(metric.rule.space) if metric.ceiling.known else None
    return Finding(value, "", _warnings(metric, seen.predicted, mask, true.view.name), noise, parts)


def measure(metric: ImageMetric, seen: LayerComparison) -> tuple[float, dict[str, float]]:
    """Return the value of one view, and the same by neighbouring rules; all before ``finish``.

    Raises:
        DatasetError: The images are too small for the metric.
    """
    rule = metric.rule
    value_of = rule.measure
    if not isinstance(value_of, Pixelwise):
        return value_of(*seen.shown(rule.space), seen.mask), {}
    spaces = value_of.spaces if isinstance(value_of, Bracketed) else (rule.space,)
    errors = reduce(np.maximum, (seen.errors(value_of.errors, space) for space in spaces))
    regions = {name: of for name, of in seen.regions().items() if of.any()}
    parts = {name: float(value_of.statistic(errors[of])) for name, of in regions.items()}
    if rule.other_space:
        name, space = rule.other_space
        parts[name] = float(value_of.statistic(seen.errors(value_of.errors, space)))
    value = float(value_of.statistic(errors))
    if metric.ceiling.known and seen.variance is not None and seen.variance.any():
        parts["debiased"] = value - (seen.noise(rule.space) or 0.0)
    return value, parts


def breakdown(metric: ImageMetric, findings: Sequence[Finding]) -> dict[str, float]:
    """Return the breakdown of a score from what :func:`measure` found in its views.

    A view without a part, as one whose every pixel is interior has no boundary, does not enter that part;
    the noise must be known of every view.
    """
    names = dict.fromkeys(name for f in findings for name in f.parts)
    if not all("debiased" in f.parts for f in findings):
        names.pop("debiased", None)
    means = {name: mean([f.parts[name] for f in findings if name in f.parts]) for name in names}
    parts = {name: metric.rule.finish(max(value, 0.0)) for name, value in means.items()}
    if metric.rule.finish is psnr:
        parts["mean_of_views"] = mean([psnr(f.value) for f in findings if f.value is not None])
    return parts


def _applicable(metrics: Sequence[ImageMetric], first: TrueView) -> list[ImageMetric]:
    """Return the metrics that a scene has: the first test view decides, the others must have its layers."""
    table = [each for metric in metrics for each in _of_each_light(metric, first)]
    return [m for m in table if m.layer in REQUIRED | first.layers.keys()]


def _of_each_light(metric: ImageMetric, first: TrueView) -> list[ImageMetric]:
    stem = metric.layer.removesuffix(EACH_LIGHT)
    if stem == metric.layer:
        return [metric]
    lights = lights_of(stem.rstrip("."), first.layers)
    return [replace(metric, layers=(stem + light, *metric.layers[1:])) for light in lights]


def _mean_over_lights(found: Sequence[Mapping[str, Finding]]) -> dict[str, Finding]:
    if len(found) == 1:
        return dict(found[0])
    views = dict.fromkeys(name for findings in found for name in findings)
    return {name: _mean([findings[name] for findings in found if name in findings]) for name in views}


def _mean(findings: Sequence[Finding]) -> Finding:
    """Return the mean over lights of one view, or the first reason why there is none."""
    values = [f.value for f in findings if f.value is not None]
    if len(values) < len(findings):
        return Finding(reason=next(f.reason for f in findings if f.value is None))
    names = set.intersection(*(set(f.parts) for f in findings))
    return Finding(mean(values), parts={n: mean([f.parts[n] for f in findings]) for n in sorted(names)})


def _dark(absent: Sequence[str]) -> tuple[str, ...]:
    return (f"lights that are not predicted count as dark: {', '.join(absent)}",) if absent else ()


def _checked(layer: str, true: TrueView) -> np.ndarray:
    """Return the true layer; a normal without direction could be met by any prediction."""
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
    if metric.rule.measure is ssim and not interior(mask).any():
        return (f"{view}: no SSIM window fits into the mask; the mean is over the mask itself",)
    if metric.layer == "depth" and (holes := int(np.isposinf(values[mask]).sum())):
        return (f"{view}: {holes} of {int(mask.sum())} depths are +inf where there is a surface",)
    if metric.layer == "normal" and (zeros := int((_aimless(values) & mask).sum())):
        return (f"{view}: {zeros} of {int(mask.sum())} normals have length zero; each counts as 90°",)
    return ()


def _aimless(directions: np.ndarray) -> np.ndarray:
    """Return where a direction has no length, shape ``(H, W)``, bool."""
    x, y, z = np.moveaxis(directions, -1, 0)
    return (x == 0) & (y == 0) & (z == 0)
