# SPDX-License-Identifier: Apache-2.0
"""Novel views where the main light does not reach, and where it does: a method without shadows errs there."""

from dataclasses import dataclass

import numpy as np

from graycard.eval.kinds._metric import Metric
from graycard.eval.kinds._records import decibels
from graycard.eval.kinds._references import PSNR
from graycard.eval.kinds._views import ViewRule
from graycard.eval.measures._psnr import psnr
from graycard.eval.measures._spaces import display
from graycard.eval.scoring._ceiling import AS_DISPLAYED, mean_variance
from graycard.eval.scoring._findings import Measurement
from graycard.eval.scoring._readings import TrueView

LAYER = "radiance"
_IRRADIANCE, _VISIBILITY = "irradiance.", "visibility."
HIDDEN, SEEN = 0.25, 0.75
"""Share of the main light that a pixel in its shadow sees at most, and one in its light at least."""


@dataclass(frozen=True, slots=True)
class Region:
    """The true picture in one part of a view."""

    pixels: np.ndarray
    """Shape ``(H, W)``, bool."""
    true: np.ndarray
    """True radiance there, shape ``(N, 3)``."""
    exposure: float
    variance: np.ndarray | None
    """Variance of the true radiance; None where it is not known."""


def main_light(true: TrueView) -> str | None:
    """Return the light that brings surfaces in view the most; None without layers of visibility."""
    lights = [name.removeprefix(_VISIBILITY) for name in true.layers if name.startswith(_VISIBILITY)]
    brings = {light: _IRRADIANCE + light for light in lights if _IRRADIANCE + light in true.layers}
    seen = true.mask("shading")
    if not brings or not seen.any():
        return None
    return max(brings, key=lambda light: float(true.take(brings[light])[seen].mean()))


def _prepare(true: TrueView, exposure: float, shadow: bool) -> Region | None:
    light = true.once(main_light)
    if light is None:
        return None
    visible = true.take(_VISIBILITY + light)
    pixels = true.mask("shading") & (visible < HIDDEN if shadow else visible > SEEN)
    if not pixels.any():
        return None
    variance = true.take(f"{LAYER}.var")[pixels] if f"{LAYER}.var" in true.layers else None
    return Region(pixels, true.take(LAYER)[pixels].astype(np.float64), exposure, variance)


def _square_error(predicted: np.ndarray, region: Region) -> Measurement:
    p, t = (display(values, region.exposure) for values in (predicted[region.pixels], region.true))
    return Measurement(float(np.mean((p - t) ** 2)))


def _noise(region: Region) -> float | None:
    if region.variance is None:
        return None
    return mean_variance(region.true, region.variance, lambda values: display(values, region.exposure))


def _metric(name: str, title: str, where: str, shadow: bool) -> Metric[ViewRule]:
    return Metric(
        record=decibels(
            "novel_view",
            f"psnr.{name}",
            title,
            "10·log10(1 / mean over views of MSE) of radiance as displayed, srgb(L·exposure), without "
            f"lights, {where}; the main light of a view is the one of most irradiance",
            tolerance=0.5,
        ),
        rule=ViewRule(
            (LAYER, _IRRADIANCE, _VISIBILITY),
            lambda true, exposure: _prepare(true, exposure, shadow),
            _square_error,
            finish=psnr,
            noise=_noise,
        ),
        layers=(LAYER,),
        ceiling=AS_DISPLAYED,
        references=(PSNR,),
    )


METRICS: tuple[Metric[ViewRule], ...] = (
    _metric(
        "shadow", "Novel view PSNR in shadow", f"where less than {HIDDEN:g} of the main light is seen", True
    ),
    _metric("lit", "Novel view PSNR in light", f"where more than {SEEN:g} of the main light is seen", False),
)
