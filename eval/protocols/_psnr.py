# SPDX-License-Identifier: Apache-2.0
"""Protocols that end in a PSNR: each is data, and one short program follows it."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np

from graycard import DatasetError, PredictionError, srgb_encode
from graycard.eval.kinds._records import decibels
from graycard.eval.measures._psnr import psnr
from graycard.eval.protocols._base import AlbedoProtocol, AlbedoView, AlbedoViews, Outcome, Rules
from graycard.eval.protocols._estimators import Estimator, estimate
from graycard.records import MetricRecord

Storage = Literal["float", "8 bits", "8 bits, gamma 2.2"]
FittedOn = Literal[
    "no view",
    "each scored view",
    "the first scored view",
    "20 scored views",
    "all scored views",
    "the first training view",
]
Space = Literal["linear", "sRGB", "gamma 2.2"]
Pixels = Literal["mask", "whole image"]
Channels = Literal["together", "mean of PSNRs"]
Pooling = Literal["mean of PSNRs", "PSNR of the mean error"]

RATIO_VIEWS = 20
"""Number of views of ``20 scored views``."""


@dataclass(frozen=True, slots=True)
class Pair:
    """The compared pixels of one view."""

    predicted: np.ndarray
    """shape ``(N, 3)``, linear, as stored."""
    true: np.ndarray
    """shape ``(N, 3)``, linear, as stored."""
    area: int
    """Number of pixels that the error is averaged over: N, or all of the image."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PsnrProtocol(AlbedoProtocol):
    """PSNR of base colour, peak 1, by rules that are spelt out field by field."""

    estimator: Estimator = "none"
    fitted_on: FittedOn = "no view"
    space: Space = "linear"
    pixels: Pixels = "mask"
    """``whole image``: both images have one and the same background. There the error is 0, so that the
    background raises the score by ``-10 log10(|mask| / N)`` dB, whatever its colour."""
    erosion: int = 1
    """Side of the square, in pixels, by which the mask is eroded; beyond the image counts as mask."""
    channels: Channels = "together"
    pooling: Pooling = "mean of PSNRs"
    clipped: bool = False
    """Whether both images are clipped to [0, 1] once the factors are applied."""
    predicted_as: Storage = "float"
    true_as: Storage = "float"
    floor: float | None = None
    """No view scores less than this gray inside the mask would."""

    @property
    def record(self) -> MetricRecord:
        """Albedo PSNR."""
        return decibels("albedo", "psnr", "Albedo PSNR", self.summary, ignores=self.ignores)

    def rules_of(self, metric: str) -> Rules:
        """The fields as a row of a table."""
        eroded = f", eroded {self.erosion}x{self.erosion}" if self.erosion > 1 else ""
        bits = "" if self.predicted_as == "float" else f", {self.predicted_as}"
        floor = "" if self.floor is None else f", at least that of gray {self.floor:g}"
        return Rules(
            pixels=self.pixels + eroded,
            gauge=self.estimator,
            fitted_on=self.fitted_on,
            space=self.space + bits,
            pooling=self.pooling + floor,
            channels=self.channels,
            exposure="1 is white",
        )

    def score(self, views: AlbedoViews) -> Outcome:
        """Judge the test views; see :class:`AlbedoProtocol`."""
        pairs = [self._read(view) for view in views.test]
        factors = self._fit(pairs, views)
        errors = [self._errors(pair, f) for pair, f in zip(pairs, factors, strict=True)]
        each = [self._view_psnr(e, p) for e, p in zip(errors, pairs, strict=True)]
        pooled = self.pooling == "PSNR of the mean error"
        value = psnr(float(np.mean(errors))) if pooled else float(np.mean(each))
        shared = self.fitted_on not in ("no view", "each scored view")
        return Outcome(
            value,
            {view.name: x for view, x in zip(views.test, each, strict=True)},
            tuple(factors[0].tolist()) if shared else None,
        )

    def _read(self, view: AlbedoView) -> Pair:
        """The pixels inside the mask; outside, both images are the same."""
        mask = _eroded(view.mask, self.erosion)
        if not mask.any():
            raise DatasetError(
                f"expected {view.name} to see something inside its mask eroded by {self.erosion} pixels, "
                "got nothing. Render the scene larger"
            )
        area = mask.size if self.pixels == "whole image" else int(mask.sum())
        predicted, true = (np.asarray(i, np.float64)[mask] for i in (view.predicted, view.true))
        return Pair(STORED[self.predicted_as](predicted), STORED[self.true_as](true), area)

    def _fit(self, pairs: list[Pair], views: AlbedoViews) -> list[np.ndarray]:
        """The factors of each test view."""
        match self.fitted_on:
            case "no view" | "each scored view":
                return [estimate(self.estimator, pair.predicted, pair.true) for pair in pairs]
            case "the first training view":
                if views.validation is None:
                    raise PredictionError(
                        f"expected base_color on the first training view, where {self.name} fits its "
                        "factors, got none that can be used. Write this layer in every view"
                    )
                seen = [self._read(views.validation)]
            case "the first scored view":
                seen = pairs[:1]
            case "20 scored views":
                # With fewer than 20 views the published step is 0: it takes the first view 20 times.
                step = len(pairs) // RATIO_VIEWS
                seen = pairs[: RATIO_VIEWS * step : step] if step else pairs[:1]
            case "all scored views":
                seen = pairs
        predicted, true = (np.concatenate([getattr(p, n) for p in seen]) for n in ("predicted", "true"))
        return [estimate(self.estimator, predicted, true)] * len(pairs)

    def _errors(self, pair: Pair, factors: np.ndarray) -> np.ndarray:
        """Mean square error of each channel, shape ``(3,)``."""
        shown, true = pair.predicted * factors, pair.true
        if self.clipped:
            shown, true = np.clip(shown, 0, 1), np.clip(true, 0, 1)
        gap = ENCODED[self.space](shown) - ENCODED[self.space](true)
        return (gap * gap).sum(axis=0) / pair.area

    def _view_psnr(self, errors: np.ndarray, pair: Pair) -> float:
        apart = self.channels == "mean of PSNRs"
        value = float(np.mean([psnr(float(e)) for e in errors])) if apart else psnr(float(errors.mean()))
        if self.floor is None:
            return value
        gray = ((self.floor - np.clip(pair.true, 0, 1)) ** 2).sum() / (3 * pair.area)
        return max(value, psnr(float(gray)))


def _eroded(mask: np.ndarray, side: int) -> np.ndarray:
    from scipy.ndimage import binary_erosion

    return mask if side == 1 else binary_erosion(mask, np.ones((side, side), bool), border_value=1)


def _as_float(values: np.ndarray) -> np.ndarray:
    return values


def _in_8_bits(values: np.ndarray) -> np.ndarray:
    return np.round(np.clip(values, 0, 1) * 255) / 255


def _in_8_bits_of_gamma(values: np.ndarray) -> np.ndarray:
    return _in_8_bits(_gamma(values)) ** 2.2


def _gamma(values: np.ndarray) -> np.ndarray:
    return np.maximum(values, 0) ** (1 / 2.2)


STORED: Mapping[Storage, Callable[[np.ndarray], np.ndarray]] = {
    "float": _as_float,
    "8 bits": _in_8_bits,
    "8 bits, gamma 2.2": _in_8_bits_of_gamma,
}
ENCODED: Mapping[Space, Callable[[np.ndarray], np.ndarray]] = {
    "linear": _as_float,
    "sRGB": srgb_encode,
    "gamma 2.2": _gamma,
}
