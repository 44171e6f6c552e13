# SPDX-License-Identifier: Apache-2.0
"""Protocols that end in a PSNR: each is data, and one short program follows it."""

from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from graycard.eval.kinds._records import decibels
from graycard.eval.measures._psnr import psnr
from graycard.eval.protocols._alignment import Aligned, Alignment
from graycard.eval.protocols._base import GROUPS, JudgedViews, Outcome, PublishedProtocol, Rules
from graycard.records import MetricRecord

Pixels = Literal["mask", "whole image"]
Channels = Literal["together", "mean of PSNRs"]
Pooling = Literal["mean of PSNRs", "PSNR of the mean error"]


@dataclass(frozen=True, slots=True, kw_only=True)
class PsnrProtocol(PublishedProtocol):
    """PSNR of pictures, peak 1, by rules that are spelt out field by field."""

    alignment: Alignment = field(default_factory=Alignment)
    pixels: Pixels = "mask"
    """``whole image``: where both images have one background the error is 0 there, so that it raises the
    score by ``-10 log10(|mask| / N)`` dB, whatever its colour."""
    channels: Channels = "together"
    pooling: Pooling = "mean of PSNRs"
    floor: float | None = None
    """No view scores less than this gray inside the mask would."""

    @property
    def record(self) -> MetricRecord:
        """PSNR of the subject."""
        group, title = GROUPS[self.subject]
        return decibels(group, "psnr", f"{title} PSNR", self.summary, ignores=self.ignores)

    def rules_of(self, metric: str) -> Rules:
        """Return the fields as a row of a table."""
        floor = "" if self.floor is None else f", at least that of gray {self.floor:g}"
        return alignment_rules(self.alignment, self.pixels, self.pooling + floor, self.channels)

    def score(self, views: JudgedViews) -> Outcome:
        """Judge the test views; see :class:`PublishedProtocol`."""
        aligned = self.alignment.apply(views, self.name)
        errors = [self._errors(view) for view in aligned]
        each = [self._view_psnr(*pair) for pair in zip(errors, aligned, strict=True)]
        pooled = self.pooling == "PSNR of the mean error"
        value = psnr(float(np.mean(errors))) if pooled else float(np.mean(each))
        by_view = {view.name: found for view, found in zip(aligned, each, strict=True)}
        return Outcome(value, by_view, self.alignment.shared_by(aligned))

    def _errors(self, view: Aligned) -> np.ndarray:
        """Return the mean square error of each channel, shape ``(3,)``."""
        gap = view.predicted - view.true
        judged = gap[view.mask] if self.pixels == "mask" else gap.reshape(-1, 3)
        return (judged * judged).mean(axis=0)

    def _view_psnr(self, errors: np.ndarray, view: Aligned) -> float:
        apart = self.channels == "mean of PSNRs"
        value = float(np.mean([psnr(float(e)) for e in errors])) if apart else psnr(float(errors.mean()))
        if self.floor is None:
            return value
        gray = np.where(view.mask[..., None], self.floor, 0.0)
        return max(value, psnr(float(((gray - view.true) ** 2).mean())))


def alignment_rules(alignment: Alignment, pixels: str, pooling: str, channels: str) -> Rules:
    """Return the rules of an alignment and of what is done with it, in words for a table."""
    eroded = f", eroded {alignment.erosion}x{alignment.erosion}" if alignment.erosion > 1 else ""
    bits = "" if alignment.predicted_as == "float" else f", {alignment.predicted_as}"
    return Rules(
        pixels=pixels + eroded,
        gauge=alignment.estimator,
        fitted_on=alignment.fitted_on,
        space=alignment.space + bits,
        pooling=pooling,
        channels=channels,
        exposure=alignment.exposure,
    )
