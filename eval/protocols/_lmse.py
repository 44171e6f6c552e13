# SPDX-License-Identifier: Apache-2.0
"""The protocol that ends in a local mean square error."""

from dataclasses import dataclass

from graycard.eval.kinds._records import error
from graycard.eval.measures._lmse import SHIFT, WINDOW, Total, lmse
from graycard.eval.protocols._alignment import check_finite
from graycard.eval.protocols._base import JudgedViews, Outcome, PublishedProtocol, Rules, mean_of_views
from graycard.records import MetricRecord


@dataclass(frozen=True, slots=True, kw_only=True)
class LmseProtocol(PublishedProtocol):
    """Local mean square error of the gray base colour: every window may have a brightness of its own."""

    total: Total = "each window"
    """Windows whose power is added up in the denominator."""

    @property
    def record(self) -> MetricRecord:
        """Albedo LMSE."""
        return error("albedo", "lmse", "Albedo LMSE", self.summary, tolerance=0.01, ignores=self.ignores)

    def rules_of(self, metric: str) -> Rules:
        """Return the steps in words for a table."""
        return Rules(
            pixels="mask",
            gauge="least squares, one factor",
            fitted_on=f"each window of {WINDOW}x{WINDOW}, step {SHIFT}",
            space="linear",
            pooling=f"mean of LMSEs, over the power of {self.total}",
            channels="their mean, gray",
        )

    def score(self, views: JudgedViews) -> Outcome:
        """Judge the test views; see :class:`PublishedProtocol`."""
        for view in views.test:
            check_finite(view.name, view.predicted, view.mask)
        each = {v.name: lmse(v.predicted, v.true, v.mask, self.total) for v in views.test}
        return mean_of_views(each)
