# SPDX-License-Identifier: Apache-2.0
"""The three reflectances, each against the truth of its own name: base colour, diffuse, hemispherical."""

import numpy as np

from graycard.eval.kinds._images import ImageMetric, ImageRule
from graycard.eval.kinds._records import CHANNEL, GLOBAL, IGNORED, decibels, error, share
from graycard.eval.kinds._references import CIEDE2000, FLIP, PSNR, SSIM, Reference
from graycard.eval.measures._chart import patch_difference
from graycard.eval.measures._lmse import lmse
from graycard.eval.measures._pixelwise import Pixelwise, colour_errors, flip_errors, square_errors
from graycard.eval.measures._psnr import psnr
from graycard.eval.measures._spaces import display_of_reflectance, lab, linear, linear_gray
from graycard.eval.measures._ssim import ssim
from graycard.eval.scoring._ceiling import NO_LIGHT_PATH
from graycard.eval.scoring._comparison import REGIONS
from graycard.eval.scoring._gauge import Kind

LAYER = "base_color"
_MEAN_SQUARE = Pixelwise(square_errors, np.mean)


def _albedo_psnr(kind: Kind, title: str, scale: str) -> ImageMetric:
    """Return the PSNR of base colour with a gauge of some kind."""
    return ImageMetric(
        record=decibels(
            "albedo",
            f"psnr.{kind}",
            f"Albedo PSNR, {title}",
            f"10·log10(1 / mean over views of MSE) of {scale} against base_color, linear, over the mask "
            "without lights",
            headline=kind == "channel",
            ignores=IGNORED[kind],
        ),
        rule=ImageRule(linear, _MEAN_SQUARE, psnr, other_space=("srgb", display_of_reflectance)),
        layers=(LAYER,),
        gauge=None if kind == "raw" else kind,
        refuses=() if kind == "raw" else ("sign",),
        ceiling=NO_LIGHT_PATH,
        references=(PSNR,),
        breakdown=(*REGIONS, "srgb", "mean_of_views"),
    )


def _reflectance_psnr(layer: str, group: str, title: str, kind: Kind, scale: str) -> ImageMetric:
    """Return the PSNR of another reflectance with a gauge that is fitted on the layer itself."""
    return ImageMetric(
        record=decibels(
            group,
            f"psnr.{kind}",
            f"{title} PSNR, {kind}",
            f"10·log10(1 / mean over views of MSE) of {scale} on training views against t, both {layer}, "
            "linear, over the mask without lights",
            ignores=IGNORED[kind],
        ),
        rule=ImageRule(linear, _MEAN_SQUARE, psnr),
        layers=(layer,),
        gauge=None if kind == "raw" else f"{layer}.{kind}",
        refuses=() if kind == "raw" else ("sign",),
        ceiling=NO_LIGHT_PATH,
        references=(PSNR,),
        breakdown=(*REGIONS, "mean_of_views"),
    )


_SCALES: dict[Kind, str] = {
    "raw": "p",
    "scalar": "s·p, s = Σpt/Σp²",
    "channel": "s_c·p, s_c = Σp_c t_c/Σp_c²",
}
_OTHERS = (
    ("diffuse_reflectance", "diffuse_reflectance", "Diffuse reflectance"),
    ("albedo", "hemispherical_albedo", "Hemispherical albedo"),
)
"""Layer, group and title of the reflectances beside base colour."""

METRICS: tuple[ImageMetric, ...] = (
    _albedo_psnr("raw", "raw", "base_color as it is"),
    _albedo_psnr("scalar", "one scale", "s·base_color, s = Σpt/Σp² on training views"),
    _albedo_psnr("channel", "scale per channel", "s_c·base_color, s_c = Σp_c t_c/Σp_c² on training views"),
    ImageMetric(
        record=share(
            "albedo",
            "ssim",
            "Albedo SSIM",
            "mean of the SSIM map (Gaussian 11x11, sigma 1.5) of srgb(s_c·base_color) over the eroded mask",
            ignores=CHANNEL,
        ),
        rule=ImageRule(display_of_reflectance, ssim),
        layers=(LAYER,),
        gauge="channel",
        refuses=("sign",),
        ceiling=NO_LIGHT_PATH,
        references=(SSIM,),
    ),
    ImageMetric(
        record=error(
            "albedo",
            "flip",
            "Albedo FLIP",
            "mean of the LDR-FLIP map (67 pixels per degree) of srgb(s_c·base_color) over the mask",
            tolerance=0.01,
            ignores=CHANNEL,
        ),
        rule=ImageRule(display_of_reflectance, Pixelwise(flip_errors, np.mean)),
        layers=(LAYER,),
        gauge="channel",
        refuses=("sign",),
        ceiling=NO_LIGHT_PATH,
        references=(FLIP,),
        breakdown=REGIONS,
    ),
    ImageMetric(
        record=error(
            "albedo",
            "ciede2000",
            "Albedo colour difference",
            "mean over the mask of CIEDE2000 between s·base_color and the truth, s = Σpt/Σp² on training "
            "views",
            unit="ΔE00",
            tolerance=0.5,
            ignores=GLOBAL,
        ),
        rule=ImageRule(lab, Pixelwise(colour_errors, np.mean)),
        layers=(LAYER,),
        gauge="scalar",
        refuses=("sign",),
        ceiling=NO_LIGHT_PATH,
        references=CIEDE2000,
        breakdown=REGIONS,
    ),
    ImageMetric(
        record=error(
            "albedo",
            "lmse",
            "Albedo LMSE",
            "Σ_w Σ(t - a_w·p)² / Σ_w Σt² of the gray base_color, a_w = Σpt/Σp² in windows of 20x20, step 10",
            tolerance=0.01,
            ignores=GLOBAL,
        ),
        rule=ImageRule(linear_gray, lmse),
        layers=(LAYER,),
        ceiling=NO_LIGHT_PATH,
        references=(
            Reference(
                "LMSE", "equations 7 to 9 of Grosse et al. 2009, numpy.linalg.lstsq in each window", 1e-9
            ),
        ),
    ),
    ImageMetric(
        record=error(
            "albedo",
            "chart",
            "Colour chart",
            "mean over the colours of the object 'color chart' (24 patches and the board) of CIEDE2000 "
            "between the mean of s·base_color over the patch's pure pixels and the truth, s = Σpt/Σp² on "
            "training views",
            unit="ΔE00",
            tolerance=0.5,
            ignores=GLOBAL,
        ),
        rule=ImageRule(lab, patch_difference, chart=True),
        layers=(LAYER,),
        gauge="scalar",
        refuses=("sign",),
        ceiling=NO_LIGHT_PATH,
        references=(Reference("colour chart", "colour-science, patch by patch", 1e-6, "ΔE00"),),
    ),
    *(_reflectance_psnr(*layer, kind, scale) for layer in _OTHERS for kind, scale in _SCALES.items()),
)
