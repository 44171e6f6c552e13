# SPDX-License-Identifier: Apache-2.0
"""Metrics of pictures under lights, or with objects, that were not there when the scene was photographed."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from graycard import EditKind, PredictionError, Predictions, Truth, View
from graycard.eval.kinds._metric import Metric, Rule, Scorer
from graycard.eval.measures._psnr import psnr
from graycard.eval.measures._spaces import display, same
from graycard.eval.scoring._ceiling import noise_as_displayed
from graycard.eval.scoring._findings import Finding, SceneFacts, first_of, mean, pooled
from graycard.eval.scoring._gauge import Factors, apply_gauge
from graycard.eval.scoring._readings import PredictedView, TrueView
from graycard.layers import find_fault
from graycard.records import Score, Status

LAYER = "radiance"

Read = Callable[[], dict[str, np.ndarray] | None]
"""Read the predicted layers of a picture; None where it is not provided."""


@dataclass(frozen=True, slots=True)
class ChangedPicture:
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
    """Regions that the breakdown tells apart, by name, each ``(H, W)``, bool."""

    @property
    def key(self) -> str:
        """Name of the picture in a score."""
        return f"{self.change}/{self.view.name}"


class Changes(NamedTuple):
    """Prediction and truth of a changed scene, from which its pictures are read."""

    predictions: Predictions
    truth: Truth
    masks: Mapping[str, np.ndarray]
    """Judged pixels of each test view, ``(H, W)``, bool."""


Pictures = Callable[[Changes], Iterator[ChangedPicture]]


@dataclass(frozen=True, slots=True)
class ChangedRule(Rule):
    """Computes one number from pictures of the changed scene, compared as displayed."""

    pictures: Pictures
    """Yields the pictures; rules with the same function are scored in one pass."""
    measure: Callable[[np.ndarray, np.ndarray, np.ndarray], float]
    """``(predicted, true, mask)``, as displayed, to the value of one picture."""
    finish: Callable[[float], float] = same
    """Applied to the mean over pictures."""
    kind: EditKind | None = None
    """The kind of change that is judged; None for all."""

    @classmethod
    def scorer(
        cls,
        metrics: "Sequence[Metric[ChangedRule]]",
        predictions: Predictions,
        truth: Truth,
        scene: SceneFacts,
    ) -> "ChangedScorer":
        """Begin to score; see :class:`Rule`."""
        return ChangedScorer(metrics, predictions, truth, scene)


ChangedMetric = Metric[ChangedRule]


@dataclass(slots=True)
class ChangedScorer(Scorer):
    """Masks of the test views, gathered while they pass by; the changed pictures are read in the end."""

    metrics: Sequence[ChangedMetric]
    predictions: Predictions
    truth: Truth
    scene: SceneFacts
    masks: dict[str, np.ndarray] = field(default_factory=dict)

    def observe(self, predicted: PredictedView, true: TrueView, scene: SceneFacts) -> None:
        """Keep the mask of a view."""
        self.masks[true.view.name] = true.mask(LAYER)

    def scores(self) -> list[Score]:
        """Return one score for each metric that has a picture; see :class:`Scorer`."""
        changes = Changes(self.predictions, self.truth, self.masks)
        sources = dict.fromkeys(m.rule.pictures for m in self.metrics)
        return [score for pictures in sources for score in self._scores(pictures, pictures(changes))]

    def _scores(self, source: Pictures, pictures: Iterator[ChangedPicture]) -> list[Score]:
        table = [m for m in self.metrics if m.rule.pictures == source]
        found: dict[str, dict[str, Finding]] = {}
        kinds: dict[str, EditKind | None] = {}
        for picture in pictures:
            kinds[picture.key] = picture.kind
            for name, finding in judge_picture(table, picture, self.scene).items():
                found.setdefault(name, {})[picture.key] = finding
        return [_pool(m, found[m.id], kinds, self.scene) for m in table if m.id in found]


def judge_picture(
    table: Sequence[ChangedMetric], picture: ChangedPicture, scene: SceneFacts
) -> dict[str, Finding]:
    """Judge one picture by every metric of its kind of change; a fault is found, not raised.

    Args:
        table: Metrics of pictures from one source, which share a gauge.
        picture: What is judged.
        scene: What is the same for all pictures.

    Raises:
        DatasetError: The truth of the picture is broken.
    """
    metrics = [m for m in table if m.rule.kind in (None, picture.kind)]
    true = TrueView(picture.view, picture.true, frozenset())
    radiance = true.take(LAYER)
    noise = {m.id: _noise(m, true, picture.mask, scene.exposure) for m in metrics}
    try:
        values = predicted_picture(picture)
        if values is not None and metrics and metrics[0].gauge:
            values = apply_gauge(values, _factors(scene, metrics[0].gauge))
    except PredictionError as cause:
        return {name: Finding(reason=str(cause), noise=best) for name, best in noise.items()}
    if values is None:
        return {name: Finding(reason=ABSENT, noise=best) for name, best in noise.items()}
    images = display(values, scene.exposure), display(radiance, scene.exposure)
    return {m.id: _judge(m.rule, picture, images, noise[m.id]) for m in metrics}


ABSENT = ""
"""Reason of a picture that was not provided."""


def _judge(
    rule: ChangedRule, picture: ChangedPicture, images: tuple[np.ndarray, np.ndarray], noise: float | None
) -> Finding:
    parts = {}
    if rule.finish is psnr:
        parts = {n: rule.measure(*images, at) for n, at in picture.parts.items() if at.any()}
    return Finding(rule.measure(*images, picture.mask), noise=noise, parts=parts)


def predicted_picture(picture: ChangedPicture) -> np.ndarray | None:
    """Return the predicted radiance of a picture, shape ``(H, W, 3)``, float64; None where there is none.

    Raises:
        PredictionError: It is unreadable, of another size or not finite.
    """
    where, camera = f"{picture.change}, {picture.view.name}", picture.view.camera
    layers = picture.predicted()
    if layers is None:
        return None
    if LAYER not in layers:
        raise PredictionError(f"{where}: expected radiance, got {', '.join(layers)}. Write this layer")
    if fault := find_fault(LAYER, layers[LAYER], camera.height, camera.width):
        raise PredictionError(f"{where}: {fault}. Write this picture again")
    return layers[LAYER].astype(np.float64)


def _factors(scene: SceneFacts, gauge: str) -> Factors:
    """Return the factors of a gauge.

    Raises:
        PredictionError: They cannot be fitted.
    """
    factors = scene.gauges[gauge]
    if isinstance(factors, str):
        raise PredictionError(factors)
    return factors


def _noise(metric: ChangedMetric, true: TrueView, mask: np.ndarray, exposure: float) -> float | None:
    return noise_as_displayed(true, LAYER, mask, exposure) if metric.ceiling.known else None


def _pool(
    metric: ChangedMetric,
    findings: Mapping[str, Finding],
    kinds: Mapping[str, EditKind | None],
    scene: SceneFacts,
) -> Score:
    status, reason = status_of_changes(findings, kinds)
    finish, gauge = metric.rule.finish, scene.fitted(metric.gauge)
    score = pooled(metric.record, finish, findings, status=status, reason=reason, gauge=gauge)
    if status != "scored":
        return score
    changes = _by_change(findings)
    parts = {name: finish(mean(values)) for name, values in changes.items() if len(changes) > 1}
    return replace(score, breakdown={**score.breakdown, **parts})


def _by_change(findings: Mapping[str, Finding]) -> dict[str, list[float]]:
    values: dict[str, list[float]] = {}
    for key, finding in findings.items():
        if finding.value is not None:
            values.setdefault(key.split("/")[0], []).append(finding.value)
    return values


def status_of_changes(
    findings: Mapping[str, Finding], kinds: Mapping[str, EditKind | None]
) -> tuple[Status, str]:
    """Return "not provided" for a kind of change without any picture, "failed" for one that lacks some.

    Args:
        findings: By picture; one that was not provided has the reason :data:`ABSENT`.
        kinds: Kind of change by picture.
    """
    faults = [f.reason for f in findings.values() if f.value is None and f.reason != ABSENT]
    if faults:
        return "failed", first_of(faults)
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
