# SPDX-License-Identifier: Apache-2.0
"""How well a method shows the photographs that it was fitted to: no merit in itself, but papers print it.

What training views are better by than held-out ones is what a method has learnt by heart.
"""

import math
from dataclasses import replace

from graycard.eval.measures._psnr import psnr
from graycard.eval.metrics._view_metrics import pooled
from graycard.eval.scoring._assembly import Finding, status_of
from graycard.eval.scoring._training import Training
from graycard.records import MetricRecord, Score

LAYER = "radiance"
TRAINING_METRICS = (
    MetricRecord(
        "training_view.psnr", "Training view PSNR", "training_view", "dB", True, math.inf,
        "10·log10(1 / mean over training views of MSE); radiance as displayed, srgb(L·exposure), over the "
        "mask of the training views; without a ceiling, as a fit has seen the noise of these very pictures",
        headline=False, tolerance=0.5,
    ),
)  # fmt: skip


def score_training_views(training: Training) -> list[Score]:
    """The score over the training views; it keeps no value of single views, which are not held out."""
    found = {
        name: Finding(reason=error) if isinstance(error, str) else Finding(error)
        for name, error in training.errors.items()
    }
    if not found:
        return []
    status, reason = status_of(LAYER, found, LAYER in training.provided, training.unreadable)
    score = pooled(TRAINING_METRICS[0], psnr, found, status=status, reason=reason)
    return [replace(score, per_view={})]
