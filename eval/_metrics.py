# SPDX-License-Identifier: Apache-2.0
"""The table of metrics: what each one measures, on which layer, in which space, with which gauge."""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

import graycard as gc
from graycard.eval._gauge import Kind
from graycard.eval._lmse import lmse
from graycard.eval._pixelwise import (
    Pixelwise,
    angle_errors,
    colour_errors,
    flip_errors,
    square_errors,
)
from graycard.eval._psnr import psnr
from graycard.eval._ssim import ssim

Space = Callable[[np.ndarray, float], np.ndarray]
"""``(linear, exposure) -> values that are compared``."""
Measure = Callable[[np.ndarray, np.ndarray, np.ndarray], float]
"""``(predicted, true, mask) -> value of one view`` that is averaged over views."""


@dataclass(frozen=True, slots=True)
class ImageMetric:
    """How one number is made from one layer of the test views."""

    record: gc.MetricRecord
    layer: str
    space: Space
    measure: Measure
    finish: Callable[[float], float]
    """Applied to the mean over views."""
    gauge: Kind | None = None
    """Which gauge is applied first; None for a layer that has none."""
    noisy: bool = False
    """Whether the noise of the truth bounds it from above."""
    beside: tuple[str, Space] | None = None
    """Another space that the breakdown has the same number in, and its name."""


def display(radiance: np.ndarray, exposure: float) -> np.ndarray:
    """What a display shows of linear radiance, [0, 1]."""
    return gc.srgb_encode(np.asarray(radiance, np.float64) * exposure)


def _linear(values: np.ndarray, exposure: float) -> np.ndarray:
    return values


def exposed(radiance: np.ndarray, exposure: float) -> np.ndarray:
    """Linear, in the range of the display: a light in the picture would outweigh all else."""
    return np.clip(radiance * exposure, 0, 1)


def _display_of_reflectance(values: np.ndarray, exposure: float) -> np.ndarray:
    """A reflectance has no exposure: 1 is white."""
    return gc.srgb_encode(values)


def _same(value: float) -> float:
    return value


_MEAN_SQUARE, _FLIP = Pixelwise(square_errors, np.mean), Pixelwise(flip_errors, np.mean)
_GLOBAL: tuple[gc.Invariance, ...] = ("global gain",)
_CHANNEL: tuple[gc.Invariance, ...] = ("global gain", "channel gain")
_ANY: tuple[gc.Invariance, ...] = ("global gain", "channel gain", "sign")
_IGNORED: dict[Kind, tuple[gc.Invariance, ...]] = {"raw": (), "scalar": _GLOBAL, "channel": _CHANNEL}


def _radiance_metrics(group: str, title: str, layer: str, of: str) -> tuple[ImageMetric, ...]:
    shown = f"{of} as displayed, srgb(L·exposure), over the mask of the test views"
    psnr_record = gc.MetricRecord(
        f"{group}.psnr", f"{title} PSNR", group, "dB", True, math.inf,
        f"10·log10(1 / mean over views of MSE); {shown}", headline=True, tolerance=0.3,
    )  # fmt: skip
    ssim_record = gc.MetricRecord(
        f"{group}.ssim", f"{title} SSIM", group, "1", True, 1.0,
        f"mean of the SSIM map (Gaussian 11x11, sigma 1.5) over the eroded mask; {shown}",
        headline=False, tolerance=0.01,
    )  # fmt: skip
    flip_record = gc.MetricRecord(
        f"{group}.flip", f"{title} FLIP", group, "1", False, 0.0,
        f"mean of the LDR-FLIP map (67 pixels per degree) over the mask; {shown}",
        headline=False, tolerance=0.01,
    )  # fmt: skip
    return (
        ImageMetric(psnr_record, layer, display, _MEAN_SQUARE, psnr, noisy=True, beside=("linear", exposed)),
        ImageMetric(ssim_record, layer, display, ssim, _same),
        ImageMetric(flip_record, layer, display, _FLIP, _same),
    )


def _albedo_psnr(kind: Kind, title: str, scale: str) -> ImageMetric:
    record = gc.MetricRecord(
        f"albedo.psnr.{kind}", f"Albedo PSNR, {title}", "albedo", "dB", True, math.inf,
        f"10·log10(1 / mean over views of MSE) of {scale} against base_color, linear, over the mask "
        "without lights",
        headline=kind == "channel", tolerance=0.3, ignores=_IGNORED[kind],
    )  # fmt: skip
    beside = "srgb", _display_of_reflectance
    return ImageMetric(record, "base_color", _linear, _MEAN_SQUARE, psnr, gauge=kind, beside=beside)


def _albedo_metrics() -> tuple[ImageMetric, ...]:
    ssim_record = gc.MetricRecord(
        "albedo.ssim", "Albedo SSIM", "albedo", "1", True, 1.0,
        "mean of the SSIM map (Gaussian 11x11, sigma 1.5) of srgb(s_c·base_color) over the eroded mask",
        headline=False, tolerance=0.01, ignores=_CHANNEL,
    )  # fmt: skip
    flip_record = gc.MetricRecord(
        "albedo.flip", "Albedo FLIP", "albedo", "1", False, 0.0,
        "mean of the LDR-FLIP map (67 pixels per degree) of srgb(s_c·base_color) over the mask",
        headline=False, tolerance=0.01, ignores=_CHANNEL,
    )  # fmt: skip
    colour_record = gc.MetricRecord(
        "albedo.ciede2000", "Albedo colour difference", "albedo", "ΔE00", False, 0.0,
        "mean over the mask of CIEDE2000 between s·base_color and the truth, s = Σpt/Σp² on training views",
        headline=False, tolerance=0.5, ignores=_GLOBAL,
    )  # fmt: skip
    lmse_record = gc.MetricRecord(
        "albedo.lmse", "Albedo LMSE", "albedo", "1", False, 0.0,
        "Σ_w Σ(t - a_w·p)² / Σ_w Σt² of the gray base_color, a_w = Σpt/Σp² in windows of 20x20, step 10",
        headline=False, tolerance=0.01, ignores=_GLOBAL,
    )  # fmt: skip
    shown = _display_of_reflectance
    return (
        _albedo_psnr("raw", "raw", "base_color as it is"),
        _albedo_psnr("scalar", "one scale", "s·base_color, s = Σpt/Σp² on training views"),
        _albedo_psnr(
            "channel", "scale per channel", "s_c·base_color, s_c = Σp_c t_c/Σp_c² on training views"
        ),
        ImageMetric(ssim_record, "base_color", shown, ssim, _same, gauge="channel"),
        ImageMetric(flip_record, "base_color", shown, _FLIP, _same, gauge="channel"),
        ImageMetric(
            colour_record, "base_color", _linear, Pixelwise(colour_errors, np.mean), _same, gauge="scalar"
        ),
        ImageMetric(lmse_record, "base_color", _linear, lmse, _same),
    )


def _normal_metric(statistic: str, measure: Measure, headline: bool) -> ImageMetric:
    record = gc.MetricRecord(
        f"normal.{statistic}_angle", f"Normal error, {statistic}", "normal", "°", False, 0.0,
        f"{statistic} over the mask of atan2(|p×t|, p·t), mean over views; a zero vector counts 90°",
        headline, tolerance=0.5, ignores=_GLOBAL,
    )  # fmt: skip
    return ImageMetric(record, "normal", _linear, measure, _same)


def _light_metric(
    name: str,
    title: str,
    unit: str,
    formula: str,
    tolerance: float,
    *,
    headline: bool = False,
    ignores: tuple[gc.Invariance, ...] = _ANY,
) -> gc.MetricRecord:
    return gc.MetricRecord(
        f"light.{name}", title, "light", unit, False, 0.0, formula, headline, tolerance, ignores
    )


IMAGE_METRICS: tuple[ImageMetric, ...] = (
    *_radiance_metrics("novel_view", "Novel view", "radiance", "radiance"),
    *_radiance_metrics(
        "counterfactual", "Removal", "counterfactual.radiance", "radiance without the target object"
    ),
    *_albedo_metrics(),
    _normal_metric("mean", Pixelwise(angle_errors, np.mean), headline=True),
    _normal_metric("median", Pixelwise(angle_errors, np.median), headline=False),
)

LIGHT_METRICS: tuple[gc.MetricRecord, ...] = (
    _light_metric(
        "position", "Light position error", "% of the scene's diameter",
        "100·(Σ over matched lights of min(|p - t| / diameter, 1) + missing + extra) / max(true, predicted); "
        "in the world, mean over test cameras; matched by least sum of distances", 1.0, headline=True,
    ),
    _light_metric(
        "intensity", "Light intensity error", "stops",
        "mean over matched lights and channels of |log2(p / t)| of the axial radiant intensity", 0.1,
        ignores=(),
    ),
    _light_metric("missing", "Lights missing", "count", "true local lights without a partner", 0.0),
    _light_metric("extra", "Lights too many", "count", "predicted local lights without a partner", 0.0),
)  # fmt: skip
