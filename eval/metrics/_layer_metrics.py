# SPDX-License-Identifier: Apache-2.0
"""The table of metrics of geometry, material and light that a surface receives and returns."""

import math
from dataclasses import replace
from functools import partial

import numpy as np

from graycard.eval.measures._depth import depth_errors, relative_depth_errors, within_ratio
from graycard.eval.measures._pixelwise import (
    Pixelwise,
    absolute_errors,
    angle_errors,
    share_below,
    square_errors,
)
from graycard.eval.measures._psnr import psnr
from graycard.eval.metrics._chart import patch_difference
from graycard.eval.metrics._image_metric import CHANNEL, GLOBAL, IGNORED, ImageMetric, display, linear, same
from graycard.records import MetricRecord

CARD = 0.18
"""Reflectance of a photographer's gray card: shading is compared as such a card in its place would look."""
_MEAN_SQUARE = Pixelwise(square_errors, np.mean)


def _reflectance_metrics(layer: str, group: str, title: str) -> tuple[ImageMetric, ...]:
    """PSNR by three gauges, fitted on the layer itself, of one of the other reflectances."""
    scales = {"raw": "p", "scalar": "s·p, s = Σpt/Σp²", "channel": "s_c·p, s_c = Σp_c t_c/Σp_c²"}
    return tuple(_reflectance_psnr(layer, group, title, kind, scale) for kind, scale in scales.items())


def _reflectance_psnr(layer: str, group: str, title: str, kind: str, scale: str) -> ImageMetric:
    record = MetricRecord(
        f"{group}.psnr.{kind}", f"{title} PSNR, {kind}", group, "dB", True, math.inf,
        f"10·log10(1 / mean over views of MSE) of {scale} on training views against t, both {layer}, linear, "
        "over the mask without lights", headline=False, tolerance=0.3, ignores=IGNORED[kind],
    )  # fmt: skip
    return ImageMetric(record, layer, linear, _MEAN_SQUARE, psnr, gauge=f"{layer}.{kind}")


def _chart() -> ImageMetric:
    record = MetricRecord(
        "albedo.chart", "Colour chart", "albedo", "ΔE00", False, 0.0,
        "mean over the colours of the object 'color chart' (24 patches and the board) of CIEDE2000 between "
        "the mean of s·base_color over the patch's pure pixels and the truth, s = Σpt/Σp² on training views",
        headline=False, tolerance=0.5, ignores=GLOBAL,
    )  # fmt: skip
    return ImageMetric(record, "base_color", linear, patch_difference, same, gauge="scalar", chart=True)


def _normal_share(limit: float) -> ImageMetric:
    record = MetricRecord(
        "normal.within_" + f"{limit:g}".replace(".", "_"), f"Normals within {limit:g}°", "normal", "%", True,
        100.0, f"share of the mask with an angle atan2(|p×t|, p·t) below {limit:g}°, mean over views; a zero "
        "vector counts 90°", headline=False, tolerance=1.0, ignores=GLOBAL,
    )  # fmt: skip
    measure = Pixelwise(angle_errors, partial(share_below, limit=limit))
    return ImageMetric(record, "normal", linear, measure, same)


def _depth_metrics() -> tuple[ImageMetric, ...]:
    where = "z-depth, over the mask where the true depth is finite; a pixel predicted empty (+inf) counts as"
    relative = MetricRecord(
        "depth.abs_rel", "Depth error, relative", "depth", "1", False, 0.0,
        f"mean of min(|p - t| / t, 1), mean over views; {where} 1",
        headline=False, tolerance=0.01,
    )  # fmt: skip
    near = MetricRecord(
        "depth.within_1_25", "Depth within a factor 1.25", "depth", "%", True, 100.0,
        f"share with max(p / t, t / p) < 1.25, mean over views; {where} outside, so does 0 or less",
        headline=False, tolerance=1.0,
    )  # fmt: skip
    metres = MetricRecord(
        "depth.rmse", "Depth error, RMS", "depth", "m", False, 0.0,
        f"√(mean over views of the mean of min(|p - t|, t)²); {where} an error of t",
        headline=False, tolerance=0.05,
    )  # fmt: skip
    ratio = Pixelwise(within_ratio, partial(share_below, limit=1.25))
    return (
        ImageMetric(relative, "depth", linear, Pixelwise(relative_depth_errors, np.mean), same),
        ImageMetric(near, "depth", linear, ratio, same),
        ImageMetric(metres, "depth", linear, Pixelwise(depth_errors, _mean_of_squares), math.sqrt),
    )


def _material_metrics(layer: str, where: str) -> tuple[ImageMetric, ...]:
    title = layer.capitalize()
    mean = MetricRecord(
        f"{layer}.mae", f"{title} error, mean", layer, "1", False, 0.0,
        f"mean of |p - t| of {layer}, mean over views; {where}", headline=False, tolerance=0.02,
    )  # fmt: skip
    root = MetricRecord(
        f"{layer}.rmse", f"{title} error, RMS", layer, "1", False, 0.0,
        f"√(mean over views of the mean of (p - t)²) of {layer}; {where}", headline=False, tolerance=0.02,
    )  # fmt: skip
    return (
        ImageMetric(mean, layer, linear, Pixelwise(absolute_errors, np.mean), same),
        ImageMetric(root, layer, linear, Pixelwise(square_errors, np.mean), math.sqrt),
    )


def _received(layer: str, group: str, title: str, of: str, brightness: float) -> ImageMetric:
    """Light that arrives at surfaces: what albedo gains by the gauge, this loses."""
    record = MetricRecord(
        f"{group}.psnr", f"{title} PSNR", group, "dB", True, math.inf,
        f"10·log10(1 / mean over views{of} of MSE) of srgb(g·p·exposure) against srgb(g·t·exposure), "
        f"g = {CARD:g}{'' if brightness == CARD else '/π'}: a gray card in its place as displayed; p divided "
        "by the scale per channel of the prediction's albedo (base_color, else diffuse_reflectance, else "
        "albedo; 1 where it has none); over the mask without lights",
        headline=False, tolerance=0.3, ignores=CHANNEL,
    )  # fmt: skip
    noisy = layer == "shading"
    return ImageMetric(record, layer, display, _MEAN_SQUARE, psnr, "light", noisy, None, brightness)


def _returned(layer: str, title: str, of: str = "") -> ImageMetric:
    """Light on its way to the camera: albedo and light together, so without a gauge."""
    name = layer.removesuffix(".<light>").replace("radiance", "light_share") if of else layer
    record = MetricRecord(
        f"{name}.psnr", f"{title} PSNR", name, "dB", True, math.inf,
        f"10·log10(1 / mean over views{of} of MSE) of {layer} as displayed, srgb(L·exposure), over the mask "
        "without lights", headline=False, tolerance=0.3,
    )  # fmt: skip
    return ImageMetric(record, layer, display, _MEAN_SQUARE, psnr)


def _lobe(layer: str, title: str) -> ImageMetric:
    """What one lobe returns, direct and indirect light together."""
    whole = _returned(layer, title)
    where = f"{whole.record.formula}, of views in which something has a specular lobe (f0 > 0)"
    return replace(whole, record=replace(whole.record, formula=where))


def _mean_of_squares(errors: np.ndarray) -> np.floating:
    return np.mean(errors**2)


_WITH_LOBE = "over the mask without lights where the truth has a specular lobe (f0 > 0)"
_LIGHTS = " and over the true lights (one that the prediction has not is dark in it)"
CHART_METRICS: tuple[ImageMetric, ...] = (_chart(),)
NORMAL_SHARES: tuple[ImageMetric, ...] = tuple(_normal_share(limit) for limit in (11.25, 22.5, 30.0))
GEOMETRY_METRICS: tuple[ImageMetric, ...] = _depth_metrics()
MATERIAL_METRICS: tuple[ImageMetric, ...] = (
    *_reflectance_metrics("diffuse_reflectance", "diffuse_reflectance", "Diffuse reflectance"),
    *_reflectance_metrics("albedo", "hemispherical_albedo", "Hemispherical albedo"),
    *_material_metrics("f0", _WITH_LOBE),
    *_material_metrics("roughness", _WITH_LOBE),
    *_material_metrics("metallic", "over the mask without lights"),
)
TRANSPORT_METRICS: tuple[ImageMetric, ...] = (
    _received("shading", "shading", "Shading", "", CARD),
    _received("irradiance.<light>", "irradiance", "Irradiance of each light", _LIGHTS, CARD / math.pi),
    _returned("radiance.<light>", "Share of each light", _LIGHTS),
    _lobe("diffuse", "Diffuse light"),
    _lobe("specular", "Specular light"),
    _returned("direct.diffuse", "Direct diffuse light"),
    _returned("direct.specular", "Direct specular light"),
    _returned("indirect.diffuse", "Bounced light, diffuse"),
    _returned("indirect.specular", "Bounced light, specular"),
)
