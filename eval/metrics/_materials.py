# SPDX-License-Identifier: Apache-2.0
"""Parameters of a material: reflectance at normal incidence, roughness, metallic."""

import math

import numpy as np

from graycard.eval.kinds._images import ImageMetric, ImageRule
from graycard.eval.kinds._records import error
from graycard.eval.kinds._references import DISTANCES
from graycard.eval.measures._pixelwise import Pixelwise, absolute_errors, square_errors
from graycard.eval.measures._spaces import linear
from graycard.eval.scoring._ceiling import NO_LIGHT_PATH
from graycard.eval.scoring._comparison import REGIONS


def _errors(layer: str, where: str) -> tuple[ImageMetric, ...]:
    """Return the mean and the root mean square error of a layer."""
    title = layer.capitalize()
    return (
        ImageMetric(
            record=error(
                layer,
                "mae",
                f"{title} error, mean",
                f"mean of |p - t| of {layer}, mean over views; {where}",
                tolerance=0.02,
            ),
            rule=ImageRule(linear, Pixelwise(absolute_errors, np.mean)),
            layers=(layer,),
            ceiling=NO_LIGHT_PATH,
            references=(DISTANCES,),
            breakdown=REGIONS,
        ),
        ImageMetric(
            record=error(
                layer,
                "rmse",
                f"{title} error, RMS",
                f"√(mean over views of the mean of (p - t)²) of {layer}; {where}",
                tolerance=0.02,
            ),
            rule=ImageRule(linear, Pixelwise(square_errors, np.mean), math.sqrt),
            layers=(layer,),
            ceiling=NO_LIGHT_PATH,
            references=(DISTANCES,),
            breakdown=REGIONS,
        ),
    )


_WITH_LOBE = "over the mask without lights where the truth has a specular lobe (f0 > 0)"
METRICS: tuple[ImageMetric, ...] = (
    *_errors("f0", _WITH_LOBE),
    *_errors("roughness", _WITH_LOBE),
    *_errors("metallic", "over the mask without lights"),
)
