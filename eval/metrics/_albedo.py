# SPDX-License-Identifier: Apache-2.0
"""The table of metrics: what each one measures, on which layer, in which space, with which gauge."""

import math

import numpy as np

from graycard.eval.measures._lmse import lmse
from graycard.eval.measures._lpips import VARIABLE, has_weights, lpips
from graycard.eval.measures._pixelwise import (
    Bracketed,
    Pixelwise,
    angle_errors,
    colour_errors,
    flip_errors,
    square_errors,
)
from graycard.eval.measures._psnr import psnr
from graycard.eval.measures._ssim import ssim
from graycard.eval.metrics._image_metric import (
    CHANNEL,
    GLOBAL,
    IGNORED,
    ImageMetric,
    Measure,
    Space,
    display,
    display_of_reflectance,
    exposed,
    linear,
    same,
)
from graycard.eval.metrics._layer_metrics import (
    CHART_METRICS,
    GEOMETRY_METRICS,
    MATERIAL_METRICS,
    NORMAL_SHARES,
    TRANSPORT_METRICS,
)
from graycard.eval.scoring._gauge import Kind
from graycard.records import MetricRecord

STOPS = 0, 3
"""Exposures of HDR-FLIP relative to that of the scene, which shows the photographs' 99th percentile as white:
3 stops more open up what lies in the dark. Given and not found from each picture, as dark ones have no median
to find them by (NVlabs/flip, issue 42)."""
_BRACKET: tuple[Space, ...] = (
    display,
    lambda radiance, exposure: display(radiance, exposure * 2 ** STOPS[1]),
)
_MEAN_SQUARE, _FLIP = Pixelwise(square_errors, np.mean), Pixelwise(flip_errors, np.mean)


def _radiance_metrics(group: str, title: str, layer: str, of: str) -> tuple[ImageMetric, ...]:
    shown = f"{of} as displayed, srgb(L·exposure), over the mask of the test views"
    psnr_record = MetricRecord(
        f"{group}.psnr", f"{title} PSNR", group, "dB", True, math.inf,
        f"10·log10(1 / mean over views of MSE); {shown}", headline=True, tolerance=0.3,
    )  # fmt: skip
    ssim_record = MetricRecord(
        f"{group}.ssim", f"{title} SSIM", group, "1", True, 1.0,
        f"mean of the SSIM map (Gaussian 11x11, sigma 1.5) over the eroded mask; {shown}",
        headline=False, tolerance=0.01,
    )  # fmt: skip
    flip_record = MetricRecord(
        f"{group}.flip", f"{title} FLIP", group, "1", False, 0.0,
        f"mean of the LDR-FLIP map (67 pixels per degree) over the mask; {shown}",
        headline=False, tolerance=0.01,
    )  # fmt: skip
    return (
        ImageMetric(psnr_record, layer, display, _MEAN_SQUARE, psnr, noisy=True, beside=("linear", exposed)),
        ImageMetric(ssim_record, layer, display, ssim, same),
        ImageMetric(flip_record, layer, display, _FLIP, same),
    )


def _flip_hdr() -> ImageMetric:
    stops = ", ".join(f"{stop:+d}" for stop in STOPS)
    record = MetricRecord(
        "novel_view.flip_hdr", "Novel view HDR-FLIP", "novel_view", "1", False, 0.0,
        "mean over the mask of the greatest LDR-FLIP (67 pixels per degree) of srgb(2^e·L·exposure) clipped "
        f"to [0, 1], e = {stops} stops: exposures fixed by the scene, tone mapping that of the display",
        headline=False, tolerance=0.01,
    )  # fmt: skip
    return ImageMetric(record, "radiance", display, Bracketed(flip_errors, np.mean, _BRACKET), same)


def _lpips() -> ImageMetric:
    record = MetricRecord(
        "novel_view.lpips", "Novel view LPIPS", "novel_view", "1", False, 0.0,
        "mean over the mask of the LPIPS map (version 0.1, AlexNet, spatial) of srgb(L·exposure) in [-1, 1]; "
        f"only where {VARIABLE} names a folder of its weights", headline=False, tolerance=0.01,
    )  # fmt: skip
    return ImageMetric(record, "radiance", display, lpips, same, available=has_weights)


def _albedo_psnr(kind: Kind, title: str, scale: str) -> ImageMetric:
    record = MetricRecord(
        f"albedo.psnr.{kind}", f"Albedo PSNR, {title}", "albedo", "dB", True, math.inf,
        f"10·log10(1 / mean over views of MSE) of {scale} against base_color, linear, over the mask "
        "without lights",
        headline=kind == "channel", tolerance=0.3, ignores=IGNORED[kind],
    )  # fmt: skip
    beside = "srgb", display_of_reflectance
    return ImageMetric(record, "base_color", linear, _MEAN_SQUARE, psnr, gauge=kind, beside=beside)


def _albedo_metrics() -> tuple[ImageMetric, ...]:
    ssim_record = MetricRecord(
        "albedo.ssim", "Albedo SSIM", "albedo", "1", True, 1.0,
        "mean of the SSIM map (Gaussian 11x11, sigma 1.5) of srgb(s_c·base_color) over the eroded mask",
        headline=False, tolerance=0.01, ignores=CHANNEL,
    )  # fmt: skip
    flip_record = MetricRecord(
        "albedo.flip", "Albedo FLIP", "albedo", "1", False, 0.0,
        "mean of the LDR-FLIP map (67 pixels per degree) of srgb(s_c·base_color) over the mask",
        headline=False, tolerance=0.01, ignores=CHANNEL,
    )  # fmt: skip
    colour_record = MetricRecord(
        "albedo.ciede2000", "Albedo colour difference", "albedo", "ΔE00", False, 0.0,
        "mean over the mask of CIEDE2000 between s·base_color and the truth, s = Σpt/Σp² on training views",
        headline=False, tolerance=0.5, ignores=GLOBAL,
    )  # fmt: skip
    lmse_record = MetricRecord(
        "albedo.lmse", "Albedo LMSE", "albedo", "1", False, 0.0,
        "Σ_w Σ(t - a_w·p)² / Σ_w Σt² of the gray base_color, a_w = Σpt/Σp² in windows of 20x20, step 10",
        headline=False, tolerance=0.01, ignores=GLOBAL,
    )  # fmt: skip
    shown = display_of_reflectance
    return (
        _albedo_psnr("raw", "raw", "base_color as it is"),
        _albedo_psnr("scalar", "one scale", "s·base_color, s = Σpt/Σp² on training views"),
        _albedo_psnr(
            "channel", "scale per channel", "s_c·base_color, s_c = Σp_c t_c/Σp_c² on training views"
        ),
        ImageMetric(ssim_record, "base_color", shown, ssim, same, gauge="channel"),
        ImageMetric(flip_record, "base_color", shown, _FLIP, same, gauge="channel"),
        ImageMetric(
            colour_record, "base_color", linear, Pixelwise(colour_errors, np.mean), same, gauge="scalar"
        ),
        ImageMetric(lmse_record, "base_color", linear, lmse, same),
    )


def _normal_metric(statistic: str, measure: Measure, headline: bool) -> ImageMetric:
    record = MetricRecord(
        f"normal.{statistic}_angle", f"Normal error, {statistic}", "normal", "°", False, 0.0,
        f"{statistic} over the mask of atan2(|p×t|, p·t), mean over views; a zero vector counts 90°",
        headline, tolerance=0.5, ignores=GLOBAL,
    )  # fmt: skip
    return ImageMetric(record, "normal", linear, measure, same)


IMAGE_METRICS: tuple[ImageMetric, ...] = (
    *_radiance_metrics("novel_view", "Novel view", "radiance", "radiance"),
    _flip_hdr(),
    _lpips(),
    *_radiance_metrics(
        "counterfactual", "Removal", "counterfactual.radiance", "radiance without the target object"
    ),
    *_albedo_metrics(),
    *CHART_METRICS,
    *MATERIAL_METRICS,
    _normal_metric("mean", Pixelwise(angle_errors, np.mean), headline=True),
    _normal_metric("median", Pixelwise(angle_errors, np.median), headline=False),
    *NORMAL_SHARES,
    *GEOMETRY_METRICS,
    *TRANSPORT_METRICS,
)
