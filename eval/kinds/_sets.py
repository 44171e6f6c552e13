# SPDX-License-Identifier: Apache-2.0
"""Metrics that compare all test views together with the truth, as one set of pictures with another."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from graycard import GraycardError, Predictions, Truth
from graycard.eval.kinds._metric import Metric, Rule, Scorer
from graycard.eval.measures._spaces import display
from graycard.eval.scoring._findings import Finding, Measurement, SceneFacts, pooled, status_of
from graycard.eval.scoring._mask import with_true_background
from graycard.eval.scoring._readings import PredictedView, TrueView
from graycard.records import Score

LEAST_VIEWS = 2
"""Views from which two sets can be compared."""


@dataclass(frozen=True, slots=True)
class SetRule(Rule):
    """Computes one number from the features of all test views, predicted and true."""

    embed: Callable[[np.ndarray], np.ndarray]
    """From pictures as displayed ``(2, H, W, 3)`` to features ``(2, D)``; rules with the same share them."""
    compare: Callable[[np.ndarray, np.ndarray], Measurement]
    """From features of predictions and of truth, each ``(N, D)``, to the value."""

    @classmethod
    def scorer(
        cls, metrics: "Sequence[Metric[SetRule]]", predictions: Predictions, truth: Truth, scene: SceneFacts
    ) -> "SetScorer":
        """Begin to score; see :class:`Rule`."""
        return SetScorer(metrics, scene)


SetMetric = Metric[SetRule]
Embedding = tuple[str, Callable[[np.ndarray], np.ndarray]]
"""A layer, and what makes features of it."""


@dataclass(slots=True)
class SetScorer(Scorer):
    """Features of all views, gathered while the views pass by; outside the mask both show the truth."""

    metrics: Sequence[SetMetric]
    scene: SceneFacts
    findings: dict[Embedding, dict[str, Finding]] = field(default_factory=dict)
    """By view; the evidence is the features of both, one after the other."""
    provided: set[str] = field(default_factory=set)
    unreadable: list[str] = field(default_factory=list)

    def observe(self, predicted: PredictedView, true: TrueView, scene: SceneFacts) -> None:
        """Look at a test view; see :class:`Scorer`."""
        self.provided |= predicted.provided
        self.unreadable += [predicted.fault] if predicted.fault else []
        for layer, embed in dict.fromkeys((metric.layer, metric.rule.embed) for metric in self.metrics):
            if layer in true.layers and true.mask(layer).any():
                found = _embedded(predicted, true, layer, embed, scene.exposure)
                self.findings.setdefault((layer, embed), {})[true.view.name] = found

    def scores(self) -> list[Score]:
        """Return one score for each metric whose layer the scene has."""
        return [self._score(m) for m in self.metrics if (m.layer, m.rule.embed) in self.findings]

    def _score(self, metric: SetMetric) -> Score:
        findings, training = self.findings[metric.layer, metric.rule.embed], self.scene.training
        provided = metric.layer in self.provided | training.provided
        status, reason = status_of(metric.layer, findings, provided, [*training.unreadable, *self.unreadable])
        if status == "scored" and len(findings) < LEAST_VIEWS:
            lacks = f"expected at least {LEAST_VIEWS} test views to compare sets, got {len(findings)}"
            status, reason = "not provided", f"{lacks}. Render the scene with more"

        def together(evidence: np.ndarray) -> Measurement:
            sets = evidence.reshape(len(findings), 2, -1)
            return metric.rule.compare(sets[:, 0], sets[:, 1])

        score = pooled(metric.record, float, findings, status=status, reason=reason, pool=together)
        return replace(score, per_view={})  # a set has one value


def _embedded(
    predicted: PredictedView,
    true: TrueView,
    layer: str,
    embed: Callable[[np.ndarray], np.ndarray],
    exposure: float,
) -> Finding:
    """Return the features of a view, predicted and true; a fault is found, not raised.

    Raises:
        DatasetError: The truth of the view is broken.
    """
    reference = display(true.take(layer), exposure)
    try:
        values = display(predicted.take(layer, true.mask(layer)), exposure)
        pair = np.stack([with_true_background(values, reference, true.mask(layer)), reference])
        return Finding(value=0.0, evidence=embed(pair).ravel())
    except GraycardError as cause:
        return Finding(reason=str(cause))
