# SPDX-License-Identifier: Apache-2.0
"""The protocol that judges roughness."""

from dataclasses import dataclass

import numpy as np

from graycard.eval.kinds._records import error
from graycard.eval.protocols._alignment import check_finite
from graycard.eval.protocols._base import (
    JudgedView,
    JudgedViews,
    Outcome,
    PublishedProtocol,
    Rules,
    Subject,
    mean_of_views,
)
from graycard.eval.protocols._encoding import STORED
from graycard.records import MetricRecord


@dataclass(frozen=True, slots=True, kw_only=True)
class RoughnessProtocol(PublishedProtocol):
    """Mean square error of roughness over the whole picture, in which both have one background.

    The error is 0 outside the mask, so the value falls with the size of the object. The truth is an 8-bit
    file.
    """

    subject: Subject = "roughness"

    @property
    def record(self) -> MetricRecord:
        """Mean square error."""
        return error("roughness", "mse", "Roughness error, square", self.summary, tolerance=0.002)

    def rules_of(self, metric: str) -> Rules:
        """Return the steps in words for a table."""
        return Rules(pixels="whole image", space="roughness")

    def score(self, views: JudgedViews) -> Outcome:
        """Judge the test views; see :class:`PublishedProtocol`."""
        each = {view.name: _square(view) for view in views.test}
        return mean_of_views(each)


def _square(view: JudgedView) -> float:
    check_finite(view.name, view.predicted, view.mask)
    predicted, true = (np.asarray(image, np.float64)[view.mask] for image in (view.predicted, view.true))
    return float(((predicted - STORED["8 bits"](true)) ** 2).sum() / view.mask.size)
