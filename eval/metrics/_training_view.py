# SPDX-License-Identifier: Apache-2.0
"""Photographs that a method was fitted to: no merit in itself, but papers print their PSNR.

Training views that score better than held-out ones show what a method has learnt by heart.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

from graycard import Predictions, Truth
from graycard.eval.kinds._metric import Metric, Rule, Scorer
from graycard.eval.kinds._records import decibels
from graycard.eval.kinds._references import PSNR
from graycard.eval.measures._psnr import psnr
from graycard.eval.scoring._ceiling import FITTED_TO
from graycard.eval.scoring._findings import Finding, SceneFacts, pooled, status_of
from graycard.eval.scoring._training import PICTURE, Training
from graycard.records import Score


@dataclass(frozen=True, slots=True)
class TrainingRule(Rule):
    """Computes the PSNR of the mean square errors that the training views were surveyed for."""

    @classmethod
    def scorer(
        cls,
        metrics: "Sequence[Metric[TrainingRule]]",
        predictions: Predictions,
        truth: Truth,
        scene: SceneFacts,
    ) -> "TrainingScorer":
        """Begin to score; see :class:`Rule`."""
        return TrainingScorer(metrics, scene.training)


@dataclass(slots=True)
class TrainingScorer(Scorer):
    """Scores the training views; it keeps no value of single views, which are not held out."""

    metrics: Sequence[Metric[TrainingRule]]
    training: Training

    def scores(self) -> list[Score]:
        """Return the scores; none where no training view sees an object."""
        findings = {
            name: Finding(reason=error) if isinstance(error, str) else Finding(error)
            for name, error in self.training.errors.items()
        }
        if not findings:
            return []
        provided = PICTURE in self.training.provided
        status, reason = status_of(PICTURE, findings, provided, self.training.unreadable)
        pool = [pooled(m.record, psnr, findings, status=status, reason=reason) for m in self.metrics]
        return [replace(score, per_view={}) for score in pool]


METRICS: tuple[Metric[TrainingRule], ...] = (
    Metric(
        record=decibels(
            "training_view",
            "psnr",
            "Training view PSNR",
            "10·log10(1 / mean over training views of MSE); radiance as displayed, srgb(L·exposure), over "
            "the mask of the training views; without a ceiling, as a fit has seen the noise of these very "
            "pictures",
            tolerance=0.5,
        ),
        rule=TrainingRule(),
        layers=(PICTURE,),
        ceiling=FITTED_TO,
        references=(PSNR,),
    ),
)
