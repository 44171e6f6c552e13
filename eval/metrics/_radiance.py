# SPDX-License-Identifier: Apache-2.0
"""Pictures from new viewpoints, and of the scene without the target object, as a display shows them."""

import numpy as np

from graycard.eval.kinds._images import ImageMetric, ImageRule
from graycard.eval.kinds._records import decibels, error, share
from graycard.eval.kinds._references import FLIP, PSNR, SSIM, Reference
from graycard.eval.measures._pixelwise import Bracketed, Pixelwise, flip_errors, square_errors
from graycard.eval.measures._psnr import psnr
from graycard.eval.measures._spaces import Space, display, exposed
from graycard.eval.measures._ssim import ssim
from graycard.eval.scoring._ceiling import AS_DISPLAYED, NEIGHBOURHOODS
from graycard.eval.scoring._comparison import REGIONS

STOPS = 0, 3
"""Exposures of HDR-FLIP relative to that of the scene, which shows the photographs' 99th percentile as white:
3 stops more open up what lies in the dark. Given and not found from each picture, as dark ones have no median
to find them by (NVlabs/flip, issue 42)."""
_BRACKET = (
    display,
    Space("sRGB", lambda radiance, exposure: display(radiance, exposure * 2 ** STOPS[1])),
)


def _pictures(group: str, title: str, layer: str, of: str) -> tuple[ImageMetric, ...]:
    """Return PSNR, SSIM and FLIP of pictures."""
    shown = f"{of} as displayed, srgb(L·exposure), over the mask of the test views"
    return (
        ImageMetric(
            record=decibels(
                group,
                "psnr",
                f"{title} PSNR",
                f"10·log10(1 / mean over views of MSE); {shown}",
                headline=True,
            ),
            rule=ImageRule(display, Pixelwise(square_errors, np.mean), psnr, other_space=("linear", exposed)),
            layers=(layer,),
            ceiling=AS_DISPLAYED,
            references=(PSNR,),
            breakdown=(*REGIONS, "linear", "mean_of_views", "debiased"),
        ),
        ImageMetric(
            record=share(
                group,
                "ssim",
                f"{title} SSIM",
                f"mean of the SSIM map (Gaussian 11x11, sigma 1.5) over the eroded mask; {shown}",
            ),
            rule=ImageRule(display, ssim),
            layers=(layer,),
            ceiling=NEIGHBOURHOODS,
            references=(SSIM,),
        ),
        ImageMetric(
            record=error(
                group,
                "flip",
                f"{title} FLIP",
                f"mean of the LDR-FLIP map (67 pixels per degree) over the mask; {shown}",
                tolerance=0.01,
            ),
            rule=ImageRule(display, Pixelwise(flip_errors, np.mean)),
            layers=(layer,),
            ceiling=NEIGHBOURHOODS,
            references=(FLIP,),
            breakdown=REGIONS,
        ),
    )


_FLIP_HDR = ImageMetric(
    record=error(
        "novel_view",
        "flip_hdr",
        "Novel view HDR-FLIP",
        "mean over the mask of the greatest LDR-FLIP (67 pixels per degree) of srgb(2^e·L·exposure) clipped "
        f"to [0, 1], e = {', '.join(f'{stop:+d}' for stop in STOPS)} stops: exposures fixed by the scene, "
        "tone mapping that of the display",
        tolerance=0.01,
    ),
    rule=ImageRule(display, Bracketed(flip_errors, np.mean, _BRACKET)),
    layers=("radiance",),
    ceiling=NEIGHBOURHOODS,
    references=(
        Reference("HDR-FLIP", "flip-evaluator on the whole picture, the greatest of both exposures", 1e-6),
    ),
    breakdown=REGIONS,
)

METRICS: tuple[ImageMetric, ...] = (
    *_pictures("novel_view", "Novel view", "radiance", "radiance"),
    _FLIP_HDR,
    *_pictures("counterfactual", "Removal", "counterfactual.radiance", "radiance without the target object"),
)
