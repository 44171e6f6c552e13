# SPDX-License-Identifier: Apache-2.0
"""Metrics with a rule of their own: the truth of a view asks, and one predicted layer answers."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np

from graycard import PredictionError
from graycard.eval.metrics._image_metric import same
from graycard.eval.protocols import PROTOCOL
from graycard.eval.scoring._assembly import Finding, Scene, status_of
from graycard.eval.scoring._ceiling import ceiling_warnings, pooled_ceiling
from graycard.eval.scoring._gauge import Factors, apply_gauge
from graycard.eval.scoring._readings import PredictedView, TrueView
from graycard.records import MetricRecord, Score, Status


class Answer(NamedTuple):
    """What a metric says, all before ``finish``."""

    value: float
    parts: Mapping[str, float] = MappingProxyType({})
    """The same by neighbouring rules."""
    evidence: np.ndarray | None = None
    """What the value is a statistic of, shape ``(N,)``, where that is pooled over views."""


@dataclass(frozen=True, slots=True)
class ViewMetric:
    """How one number is made from one predicted layer and whatever the truth knows of the view."""

    record: MetricRecord
    layer: str
    """Which is predicted."""
    needs: tuple[str, ...]
    """True layers, or how their names begin, without which a scene does not have the metric."""
    question: Callable[[TrueView, float], Any]
    """``(truth, exposure) -> what is asked``; None where the view has nothing to judge."""
    answer: Callable[[np.ndarray, Any], Answer]
    """``(prediction with its gauge, question) -> value``."""
    finish: Callable[[float], float] = same
    """Applied to the mean over views."""
    gauge: str = "raw"
    """Name of the gauge that is applied first."""
    ceiling: Callable[[Any], float | None] = field(default=lambda question: None)
    """``question -> the best value that the truth's noise allows``, before ``finish``; None if unknown."""

    pool: Callable[[np.ndarray], Answer] | None = None
    """From the evidence of all views together; None where the score is the mean of the views' values."""

    def applies(self, true: TrueView) -> bool:
        """Whether the truth has the layers that it needs."""
        return all(any(name.startswith(need) for name in true.layers) for need in self.needs)


@dataclass(slots=True)
class ViewScores:
    """Findings of several metrics, gathered while the views pass by."""

    table: Sequence[ViewMetric]
    findings: dict[str, dict[str, Finding]] = field(default_factory=dict)
    """By metric and view."""
    provided: set[str] = field(default_factory=set)
    unreadable: list[str] = field(default_factory=list)
    scene: Scene | None = None

    def observe(self, predicted: PredictedView, true: TrueView, scene: Scene) -> None:
        """Judge a test view; a fault of the prediction is found, not raised.

        Raises:
            DatasetError: The truth of the view is broken.
        """
        self.scene = scene
        self.provided |= predicted.layers.keys()
        self.unreadable += [predicted.fault] if predicted.fault else []
        for metric in self.table:
            finding = judge_view(metric, predicted, true, scene)
            if finding is not None:
                self.findings.setdefault(metric.record.id, {})[true.view.name] = finding

    def scores(self) -> list[Score]:
        """One score for each metric that a view had a question of, in the order of the table."""
        return [self._score(metric) for metric in self.table if metric.record.id in self.findings]

    def _score(self, metric: ViewMetric) -> Score:
        assert self.scene is not None, "views were observed"
        training, findings = self.scene.training, self.findings[metric.record.id]
        provided = metric.layer in self.provided | training.provided
        factors = self.scene.gauges[metric.gauge] if metric.gauge != "raw" else ""
        status, reason = status_of(metric.layer, findings, provided, [*training.unreadable, *self.unreadable])
        return pooled(
            metric.record,
            metric.finish,
            findings,
            status=status,
            reason=reason,
            gauge=factors if isinstance(factors, tuple) else None,
            pool=metric.pool,
        )


def judge_view(metric: ViewMetric, predicted: PredictedView, true: TrueView, scene: Scene) -> Finding | None:
    """Judge one view by one metric; None where the truth has nothing to ask.

    Raises:
        DatasetError: The truth of the view is broken.
    """
    question = metric.question(true, scene.exposure) if metric.applies(true) else None
    if question is None:
        return None
    noise, gauge = metric.ceiling(question), scene.gauges[metric.gauge]
    try:
        values = predicted.take(metric.layer)
    except PredictionError as cause:
        return Finding(reason=str(cause), noise=noise)
    if isinstance(gauge, str):
        return Finding(reason=gauge, noise=noise)
    values = apply_gauge(values, gauge) if metric.gauge != "raw" else np.asarray(values, np.float64)
    answer = metric.answer(values, question)
    return Finding(answer.value, noise=noise, parts=answer.parts, evidence=answer.evidence)


def pooled(
    record: MetricRecord,
    finish: Callable[[float], float],
    findings: Mapping[str, Finding],
    *,
    status: Status,
    reason: str,
    gauge: Factors | None = None,
    pool: Callable[[np.ndarray], Answer] | None = None,
) -> Score:
    """The score of findings: what they say together, finished; without ``pool`` that is their mean.

    A part is then the mean over the views that have it.
    """
    values = {name: f.value for name, f in findings.items() if f.value is not None}
    together = _together(list(findings.values()), pool) if status == "scored" else None
    value = finish(together.value) if together else None
    ceiling = pooled_ceiling([f.noise for f in findings.values()], finish)
    return Score(
        record.id,
        PROTOCOL,
        status,
        value,
        record.unit,
        record.higher_is_better,
        record.optimum,
        per_view={name: finish(value) for name, value in values.items()},
        noise_ceiling=ceiling,
        gauge=gauge,
        expected=len(findings),
        scored=len(values),
        reason=reason,
        warnings=ceiling_warnings(value, ceiling, record.unit, record.higher_is_better),
        breakdown={name: finish(part) for name, part in together.parts.items()} if together else {},
    )


def mean(values: Sequence[float]) -> float:
    """Arithmetic mean, by an exact sum."""
    return math.fsum(values) / len(values)


def _together(findings: Sequence[Finding], pool: Callable[[np.ndarray], Answer] | None) -> Answer:
    """What scored views say together."""
    if pool is not None:
        return pool(np.concatenate([f.evidence for f in findings if f.evidence is not None]))
    names = dict.fromkeys(name for f in findings for name in f.parts)
    parts = {name: mean([f.parts[name] for f in findings if name in f.parts]) for name in names}
    return Answer(mean([f.value for f in findings if f.value is not None]), parts)
