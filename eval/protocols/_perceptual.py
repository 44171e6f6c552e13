# SPDX-License-Identifier: Apache-2.0
"""Protocols that end in LPIPS of whole pictures, which papers print beside the PSNR."""

from dataclasses import dataclass, field

from graycard.eval.kinds._records import error
from graycard.eval.measures._lpips import Fed, plain_lpips
from graycard.eval.protocols._alignment import Alignment
from graycard.eval.protocols._base import (
    GROUPS,
    JudgedViews,
    Outcome,
    PublishedProtocol,
    Rules,
    mean_of_views,
)
from graycard.eval.protocols._psnr import alignment_rules
from graycard.networks import Net
from graycard.records import MetricRecord


@dataclass(frozen=True, slots=True, kw_only=True)
class LpipsProtocol(PublishedProtocol):
    """Mean over views of the LPIPS of whole pictures, as published code feeds its network."""

    alignment: Alignment = field(default_factory=Alignment)
    net: Net = "vgg"
    fed: Fed = "from -1 to 1"

    @property
    def record(self) -> MetricRecord:
        """LPIPS of the subject."""
        group, title = GROUPS[self.subject]
        return error(group, "lpips", f"{title} LPIPS", self.summary, tolerance=0.01, ignores=self.ignores)

    def rules_of(self, metric: str) -> Rules:
        """Return the fields as a row of a table."""
        pixels = f"whole image, {self.net}, fed {self.fed}"
        return alignment_rules(self.alignment, pixels, "mean of views", "together")

    def score(self, views: JudgedViews) -> Outcome:
        """Judge the test views; see :class:`PublishedProtocol`."""
        aligned = self.alignment.apply(views, self.name)
        each = {v.name: plain_lpips(v.predicted, v.true, self.net, self.fed) for v in aligned}
        return mean_of_views(each, self.alignment.shared_by(aligned))
