# SPDX-License-Identifier: Apache-2.0
"""Metrics of predicted lights that have a place, matched with the true ones."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from graycard import Camera, LocalLight, PredictionError, Predictions, Truth
from graycard.eval._protocol import PROTOCOL
from graycard.eval.kinds._metric import Metric, Rule, Scorer
from graycard.eval.lights._errors import LightMatch, match_lights
from graycard.eval.lights._read import INDEX, local, predicted_lights
from graycard.eval.scoring._findings import SceneFacts
from graycard.eval.scoring._gauge import Factors
from graycard.records import MetricRecord, Score, Status

GAUGE = "light"
"""Name of the gauge of light: what light gains where albedo loses."""


@dataclass(frozen=True, slots=True)
class MatchedLights:
    """The lights of a scene, predicted and true, matched."""

    predicted: Sequence[LocalLight]
    true: Sequence[LocalLight]
    cameras: Sequence[Camera]
    diameter: float
    """Diameter of the scene, metres."""
    gauge: Factors | str
    """Factors by which predicted light is divided, or why they are not known."""
    match: LightMatch

    @property
    def pairs(self) -> list[tuple[LocalLight, LocalLight]]:
        """Predicted and true."""
        return [(self.predicted[i], self.true[j]) for i, j in self.match.pairs]


def _any(light: LocalLight) -> bool:
    return True


@dataclass(frozen=True, slots=True)
class LightRule(Rule):
    """Computes one number from matched lights: a mean of errors of pairs, or a function of all of them."""

    error: Callable[[LocalLight, LocalLight, MatchedLights], float] | None = None
    """Error of a predicted light against its true partner, averaged over true lights."""
    price: float = 0.0
    """Error of a true light without a partner, and the most that one with a partner has."""
    judges: Callable[[LocalLight], bool] = _any
    """Tell whether a true light is judged."""
    together: Callable[[MatchedLights], float] | None = None
    """From all lights to the value; instead of ``error``."""
    counts: bool = False
    """Give a score also where the scene has no light that is judged."""

    @classmethod
    def scorer(
        cls, metrics: "Sequence[Metric[LightRule]]", predictions: Predictions, truth: Truth, scene: SceneFacts
    ) -> "LightScorer":
        """Begin to score; see :class:`Rule`."""
        return LightScorer(metrics, predictions, truth, scene.gauges[GAUGE])

    @property
    def space_name(self) -> str:
        """Frame of the comparison in words."""
        return "world"


@dataclass(slots=True)
class LightScorer(Scorer):
    """Scores the lights; test views tell it nothing."""

    metrics: Sequence[Metric[LightRule]]
    predictions: Predictions
    truth: Truth
    gauge: Factors | str

    def scores(self) -> list[Score]:
        """Return the scores of lights; see :func:`score_lights`."""
        return score_lights(self.metrics, self.predictions, self.truth, self.gauge)


def score_lights(
    metrics: Sequence[Metric[LightRule]],
    predictions: Predictions,
    truth: Truth,
    gauge: Factors | str = (1.0, 1.0, 1.0),
) -> list[Score]:
    """Return the light scores that a scene has.

    A scene without local lights has only counts, one without axes no directions, and so on.

    Args:
        metrics: In the order of the scores.
        predictions: What is scored.
        truth: What it is scored by.
        gauge: Factors (R, G, B) on predicted light, or why they are not known.

    Raises:
        DatasetError: The true lights are missing or broken.
    """
    true = local(truth.lights())
    judged = [m for m in metrics if m.rule.counts or any(map(m.rule.judges, true))]
    try:
        lights = predicted_lights(predictions)
    except PredictionError as cause:
        return [light_score(m.record, _count(m, true), "failed", reason=str(cause)) for m in judged]
    if lights is None:
        reason = f"there is no {INDEX}"
        return [light_score(m.record, _count(m, true), "not provided", reason=reason) for m in judged]
    cameras = [v.camera for v in truth.views if v.split == "test"]
    predicted = local(lights)
    match = match_lights(predicted, true, cameras)
    matched = MatchedLights(predicted, true, cameras, truth.diameter, gauge, match)
    return [_judge(m, matched) for m in judged]


def _count(metric: Metric[LightRule], true: Iterable[LocalLight]) -> int:
    """Return how many of the true lights a metric judges."""
    return sum(map(metric.rule.judges, true))


def _judge(metric: Metric[LightRule], matched: MatchedLights) -> Score:
    record, rule, judged = metric.record, metric.rule, _count(metric, matched.true)
    pairs = [(p, t) for p, t in matched.pairs if rule.judges(t)]
    alone = judged - len(pairs)
    try:
        value = _value(rule, pairs, alone, matched)
    except PredictionError as cause:
        return light_score(record, judged, "failed", reason=str(cause))
    unmatched = ()
    if rule.error and alone:
        unmatched = (f"{alone} of {judged} lights have no partner; each counts {rule.price:g} {record.unit}",)
    score = light_score(record, judged, "scored", value=value, scored=len(pairs), warnings=unmatched)
    gauged = metric.gauge is not None and not isinstance(matched.gauge, str)
    return replace(score, gauge=matched.gauge) if gauged else score


def _value(
    rule: LightRule, pairs: Sequence[tuple[LocalLight, LocalLight]], alone: int, matched: MatchedLights
) -> float:
    if rule.error:
        errors = [min(rule.error(p, t, matched), rule.price) for p, t in pairs]
        return float(np.mean([*errors, *[rule.price] * alone]))
    assert rule.together is not None
    return rule.together(matched)


def light_score(
    record: MetricRecord,
    expected: int,
    status: Status,
    *,
    value: float | None = None,
    scored: int = 0,
    reason: str = "",
    warnings: tuple[str, ...] = (),
) -> Score:
    """Return a score that is not made of views: ``expected`` and ``scored`` count lights."""
    return Score(
        record.id,
        PROTOCOL,
        status,
        value,
        record.unit,
        record.higher_is_better,
        record.optimum,
        expected=expected,
        scored=scored,
        reason=reason,
        warnings=warnings,
    )
