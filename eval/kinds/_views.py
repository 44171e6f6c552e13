# SPDX-License-Identifier: Apache-2.0
"""Metrics that prepare a question of their own from the truth of a view, and judge one layer by it."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from graycard import PredictionError, Predictions, Truth
from graycard.eval.kinds._metric import Metric, Rule, Scorer
from graycard.eval.measures._spaces import same
from graycard.eval.scoring._findings import Finding, Measurement, SceneFacts, pooled, status_of
from graycard.eval.scoring._gauge import apply_gauge
from graycard.eval.scoring._readings import PredictedView, TrueView
from graycard.records import Score


def _unknown(prepared: Any) -> None:
    return None


@dataclass(frozen=True, slots=True)
class ViewRule(Rule):
    """Computes one number from one predicted layer and any true layers of the view."""

    needs: tuple[str, ...]
    """True layers, or how their names begin, without which a scene does not have the metric."""
    prepare: Callable[[TrueView, float], Any]
    """``(truth, exposure) -> what the view is judged by``; None where it has nothing to judge."""
    compute: Callable[[np.ndarray, Any], Measurement]
    """``(prediction with its gauge, prepared) -> measurement``."""
    finish: Callable[[float], float] = same
    """Applied to the mean over views."""
    noise: Callable[[Any], float | None] = _unknown
    """``prepared -> the best value that the truth's noise allows``, before ``finish``; None if unknown."""
    pool: Callable[[np.ndarray], Measurement] | None = None
    """From the evidence of all views together; None where the score is the mean of the views' values."""

    @classmethod
    def scorer(
        cls, metrics: "Sequence[Metric[ViewRule]]", predictions: Predictions, truth: Truth, scene: SceneFacts
    ) -> "ViewScorer":
        """Begin to score; see :class:`Rule`."""
        return ViewScorer(metrics, scene)

    def applies(self, true: TrueView) -> bool:
        """Tell whether the truth has the layers that it needs."""
        return all(any(name.startswith(need) for name in true.layers) for need in self.needs)


@dataclass(slots=True)
class ViewScorer(Scorer):
    """Findings of several metrics, gathered while the views pass by."""

    metrics: Sequence[Metric[ViewRule]]
    scene: SceneFacts
    findings: dict[str, dict[str, Finding]] = field(default_factory=dict)
    """By metric and view."""
    provided: set[str] = field(default_factory=set)
    unreadable: list[str] = field(default_factory=list)

    def observe(self, predicted: PredictedView, true: TrueView, scene: SceneFacts) -> None:
        """Judge a test view; see :class:`Scorer`."""
        self.provided |= predicted.provided
        self.unreadable += [predicted.fault] if predicted.fault else []
        for metric in self.metrics:
            finding = judge_view(metric, predicted, true, scene)
            if finding is not None:
                self.findings.setdefault(metric.id, {})[true.view.name] = finding

    def scores(self) -> list[Score]:
        """Return one score for each metric that a view has something to judge by."""
        return [self._score(metric) for metric in self.metrics if metric.id in self.findings]

    def _score(self, metric: Metric[ViewRule]) -> Score:
        training, findings = self.scene.training, self.findings[metric.id]
        provided = metric.layer in self.provided | training.provided
        status, reason = status_of(metric.layer, findings, provided, [*training.unreadable, *self.unreadable])
        return pooled(
            metric.record,
            metric.rule.finish,
            findings,
            status=status,
            reason=reason,
            gauge=self.scene.fitted(metric.gauge),
            pool=metric.rule.pool,
        )


def judge_view(
    metric: Metric[ViewRule], predicted: PredictedView, true: TrueView, scene: SceneFacts
) -> Finding | None:
    """Judge one view by one metric; None where the truth has nothing to judge by.

    Raises:
        DatasetError: The truth of the view is broken.
    """
    rule = metric.rule
    prepared = rule.prepare(true, scene.exposure) if rule.applies(true) else None
    if prepared is None:
        return None
    noise, gauge = rule.noise(prepared), scene.gauges[metric.gauge] if metric.gauge else (1.0, 1.0, 1.0)
    try:
        values = predicted.take(metric.layer, true.mask(metric.layer))
    except PredictionError as cause:
        return Finding(reason=str(cause), noise=noise)
    if isinstance(gauge, str):
        return Finding(reason=gauge, noise=noise)
    values = apply_gauge(values, gauge) if metric.gauge else np.asarray(values, np.float64)
    found = rule.compute(values, prepared)
    return Finding(found.value, noise=noise, parts=found.parts, evidence=found.evidence)
