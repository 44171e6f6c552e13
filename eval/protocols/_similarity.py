# SPDX-License-Identifier: Apache-2.0
"""Protocols that end in the likeness of whole pictures, which papers print beside the PSNR."""

from dataclasses import dataclass, field

from graycard.eval.kinds._records import share
from graycard.eval.measures._window_ssim import Window, window_ssim
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
from graycard.records import MetricRecord


@dataclass(frozen=True, slots=True, kw_only=True)
class SsimProtocol(PublishedProtocol):
    """Mean over views of the SSIM of whole pictures, by the window and border of published code."""

    alignment: Alignment = field(default_factory=Alignment)
    window: Window = field(default_factory=Window)

    @property
    def record(self) -> MetricRecord:
        """SSIM of the subject."""
        group, title = GROUPS[self.subject]
        return share(group, "ssim", f"{title} SSIM", self.summary, ignores=self.ignores)

    def rules_of(self, metric: str) -> Rules:
        """Return the fields as a row of a table."""
        side, border = self.window.side, self.window.border
        pixels = f"whole image, windows {side}x{side}, beyond the border: {border}"
        return alignment_rules(self.alignment, pixels, "mean of views", "their mean")

    def score(self, views: JudgedViews) -> Outcome:
        """Judge the test views; see :class:`PublishedProtocol`."""
        aligned = self.alignment.apply(views, self.name)
        each = {v.name: window_ssim(v.predicted, v.true, self.window) for v in aligned}
        return mean_of_views(each, self.alignment.shared_by(aligned))
