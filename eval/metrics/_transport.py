# SPDX-License-Identifier: Apache-2.0
"""Light that surfaces receive, and that they return to the camera, apart for source, lobe and bounce."""

import math

import numpy as np

from graycard.eval.kinds._images import ImageMetric, ImageRule
from graycard.eval.kinds._records import CHANNEL, decibels
from graycard.eval.kinds._references import PSNR
from graycard.eval.measures._pixelwise import Pixelwise, square_errors
from graycard.eval.measures._psnr import psnr
from graycard.eval.measures._spaces import display
from graycard.eval.scoring._ceiling import AS_DISPLAYED, NO_VARIANCE
from graycard.eval.scoring._comparison import REGIONS

CARD = 0.18
"""Reflectance of a photographer's gray card: shading is compared as such a card in its place would look."""
_MEAN_SQUARE = Pixelwise(square_errors, np.mean)


def _received(layer: str, group: str, title: str, of: str, brightness: float) -> ImageMetric:
    """Return the PSNR of light that arrives at surfaces: it loses what albedo gains by the gauge."""
    noisy = layer == "shading"
    return ImageMetric(
        record=decibels(
            group,
            "psnr",
            f"{title} PSNR",
            f"10·log10(1 / mean over views{of} of MSE) of srgb(g·p·exposure) against srgb(g·t·exposure), "
            f"g = {CARD:g}{'' if brightness == CARD else '/π'}: a gray card in its place as displayed; p "
            "divided by the scale per channel of the prediction's albedo (base_color, else "
            "diffuse_reflectance, else albedo; 1 where it has none); over the mask without lights",
            ignores=CHANNEL,
        ),
        rule=ImageRule(display, _MEAN_SQUARE, psnr, brightness=brightness),
        layers=(layer,),
        gauge="light",
        refuses=("sign",),
        ceiling=AS_DISPLAYED if noisy else NO_VARIANCE,
        references=(PSNR,),
        breakdown=(*REGIONS, "mean_of_views", *(("debiased",) if noisy else ())),
    )


def _returned(layer: str, group: str, title: str, *, of: str = "", where: str = "") -> ImageMetric:
    """Return the PSNR of light on its way to the camera: albedo and light together, so without a gauge."""
    return ImageMetric(
        record=decibels(
            group,
            "psnr",
            f"{title} PSNR",
            f"10·log10(1 / mean over views{of} of MSE) of {layer} as displayed, srgb(L·exposure), over the "
            f"mask without lights{where}",
        ),
        rule=ImageRule(display, _MEAN_SQUARE, psnr),
        layers=(layer,),
        ceiling=NO_VARIANCE,
        references=(PSNR,),
        breakdown=(*REGIONS, "mean_of_views"),
    )


_LIGHTS = " and over the true lights (one that the prediction has not is dark in it)"
_GLOSSY = ", of views in which something has a specular lobe (f0 > 0)"

METRICS: tuple[ImageMetric, ...] = (
    _received("shading", "shading", "Shading", "", CARD),
    _received("irradiance.<light>", "irradiance", "Irradiance of each light", _LIGHTS, CARD / math.pi),
    _returned("radiance.<light>", "light_share", "Share of each light", of=_LIGHTS),
    _returned("diffuse", "diffuse", "Diffuse light", where=_GLOSSY),
    _returned("specular", "specular", "Specular light", where=_GLOSSY),
    _returned("direct.diffuse", "direct.diffuse", "Direct diffuse light"),
    _returned("direct.specular", "direct.specular", "Direct specular light"),
    _returned("indirect.diffuse", "indirect.diffuse", "Bounced light, diffuse"),
    _returned("indirect.specular", "indirect.specular", "Bounced light, specular"),
)
