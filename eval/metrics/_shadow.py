# SPDX-License-Identifier: Apache-2.0
"""Novel views where the main light does not reach, and where it does: a method without shadows errs there."""

import math
from dataclasses import dataclass

import numpy as np

from graycard.eval.measures._psnr import psnr
from graycard.eval.metrics._image_metric import display
from graycard.eval.metrics._view_metrics import Answer, ViewMetric
from graycard.eval.scoring._ceiling import mean_variance
from graycard.eval.scoring._readings import TrueView
from graycard.records import MetricRecord

LAYER = "radiance"
_IRRADIANCE, _VISIBILITY = "irradiance.", "visibility."
HIDDEN, SEEN = 0.25, 0.75
"""Share of the main light that a pixel in its shadow sees at most, and one in its light at least."""


@dataclass(frozen=True, slots=True)
class Region:
    """What is asked of a picture in one part of a view."""

    pixels: np.ndarray
    """Shape ``(H, W)``, bool."""
    true: np.ndarray
    """True radiance there, shape ``(N, 3)``."""
    exposure: float
    variance: np.ndarray | None
    """Of the true radiance; None where it is not known."""


def main_light(true: TrueView) -> str | None:
    """The light that brings surfaces in view the most; None where no light has a layer of visibility."""
    lights = [name.removeprefix(_VISIBILITY) for name in true.layers if name.startswith(_VISIBILITY)]
    brings = {light: _IRRADIANCE + light for light in lights if _IRRADIANCE + light in true.layers}
    seen = true.mask("shading")
    if not brings or not seen.any():
        return None
    return max(brings, key=lambda light: float(true.take(brings[light])[seen].mean()))


def _asked(true: TrueView, exposure: float, shadow: bool) -> Region | None:
    light = true.once(main_light)
    if light is None:
        return None
    visible = true.take(_VISIBILITY + light)
    pixels = true.mask("shading") & (visible < HIDDEN if shadow else visible > SEEN)
    if not pixels.any():
        return None
    variance = true.take(f"{LAYER}.var")[pixels] if f"{LAYER}.var" in true.layers else None
    return Region(pixels, true.take(LAYER)[pixels].astype(np.float64), exposure, variance)


def _square_error(predicted: np.ndarray, asked: Region) -> Answer:
    p, t = (display(values, asked.exposure) for values in (predicted[asked.pixels], asked.true))
    return Answer(float(np.mean((p - t) ** 2)))


def _noise(asked: Region) -> float | None:
    if asked.variance is None:
        return None
    return mean_variance(asked.true, asked.variance, lambda values: display(values, asked.exposure))


def _metric(name: str, title: str, where: str, shadow: bool) -> ViewMetric:
    record = MetricRecord(
        f"novel_view.psnr.{name}", title, "novel_view", "dB", True, math.inf,
        "10·log10(1 / mean over views of MSE) of radiance as displayed, srgb(L·exposure), without lights, "
        f"{where}; the main light of a view is the one of most irradiance", headline=False, tolerance=0.5,
    )  # fmt: skip
    return ViewMetric(
        record,
        LAYER,
        (LAYER, _IRRADIANCE, _VISIBILITY),
        lambda true, exposure: _asked(true, exposure, shadow),
        _square_error,
        finish=psnr,
        ceiling=_noise,
    )


SHADOW_METRICS: tuple[ViewMetric, ...] = (
    _metric(
        "shadow", "Novel view PSNR in shadow", f"where less than {HIDDEN:g} of the main light is seen", True
    ),
    _metric("lit", "Novel view PSNR in light", f"where more than {SEEN:g} of the main light is seen", False),
)
