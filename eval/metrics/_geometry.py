# SPDX-License-Identifier: Apache-2.0
"""Normals and depth."""

import math
from collections.abc import Callable
from functools import partial

import numpy as np

from graycard.eval.kinds._images import ImageMetric, ImageRule
from graycard.eval.kinds._records import GLOBAL, error, share
from graycard.eval.kinds._references import DISTANCES, Reference
from graycard.eval.measures._depth import depth_errors, relative_depth_errors, within_ratio
from graycard.eval.measures._pixelwise import Pixelwise, angle_errors, share_below
from graycard.eval.measures._spaces import linear, world
from graycard.eval.scoring._ceiling import NO_LIGHT_PATH
from graycard.eval.scoring._comparison import REGIONS
from graycard.records import MetricRecord

_ANGLE = Reference("angle between normals", "length of the chord, 2 arcsin(|p - t| / 2)", 1e-6, "°")
_COUNTED = Reference("share of normals", "cosines above that of the limit, counted", 1e-9, "%")
_RATIO = Reference("depth within a ratio", "|log p - log t| < log 1.25, counted", 1e-9, "%")


def _normal_angle(
    name: str, statistic: Callable[[np.ndarray], np.floating], *, headline: bool
) -> ImageMetric:
    """Return a statistic of the angles between normals."""
    return ImageMetric(
        record=error(
            "normal",
            f"{name}_angle",
            f"Normal error, {name}",
            f"{name} over the mask of atan2(|p×t|, p·t), mean over views; a zero vector counts 90°",
            unit="°",
            tolerance=0.5,
            headline=headline,
            ignores=GLOBAL,
        ),
        rule=ImageRule(world, Pixelwise(angle_errors, statistic)),
        layers=("normal",),
        ceiling=NO_LIGHT_PATH,
        references=(_ANGLE,),
        breakdown=REGIONS,
    )


def _normal_share(limit: float) -> ImageMetric:
    """Return the share of normals within an angle, degrees."""
    return ImageMetric(
        record=share(
            "normal",
            "within_" + f"{limit:g}".replace(".", "_"),
            f"Normals within {limit:g}°",
            f"share of the mask with an angle atan2(|p×t|, p·t) below {limit:g}°, mean over views; a zero "
            "vector counts 90°",
            percent=True,
            ignores=GLOBAL,
        ),
        rule=ImageRule(world, Pixelwise(angle_errors, partial(share_below, limit=limit))),
        layers=("normal",),
        ceiling=NO_LIGHT_PATH,
        references=(_COUNTED,),
        breakdown=REGIONS,
    )


def _depth(
    record: MetricRecord,
    measure: Pixelwise,
    reference: Reference,
    finish: Callable[[float], float] | None = None,
) -> ImageMetric:
    return ImageMetric(
        record=record,
        rule=ImageRule(linear, measure, finish) if finish else ImageRule(linear, measure),
        layers=("depth",),
        ceiling=NO_LIGHT_PATH,
        references=(reference,),
        breakdown=REGIONS,
    )


def _mean_of_squares(errors: np.ndarray) -> np.floating:
    return np.mean(errors**2)


_WHERE = "z-depth, over the mask where the true depth is finite; a pixel predicted empty (+inf) counts as"

METRICS: tuple[ImageMetric, ...] = (
    _normal_angle("mean", np.mean, headline=True),
    _normal_angle("median", np.median, headline=False),
    *(_normal_share(limit) for limit in (11.25, 22.5, 30.0)),
    _depth(
        error(
            "depth",
            "abs_rel",
            "Depth error, relative",
            f"mean of min(|p - t| / t, 1), mean over views; {_WHERE} 1",
            tolerance=0.01,
        ),
        Pixelwise(relative_depth_errors, np.mean),
        DISTANCES,
    ),
    _depth(
        share(
            "depth",
            "within_1_25",
            "Depth within a factor 1.25",
            f"share with max(p / t, t / p) < 1.25, mean over views; {_WHERE} outside, so does 0 or less",
            percent=True,
        ),
        Pixelwise(within_ratio, partial(share_below, limit=1.25)),
        _RATIO,
    ),
    _depth(
        error(
            "depth",
            "rmse",
            "Depth error, RMS",
            f"√(mean over views of the mean of min(|p - t|, t)²); {_WHERE} an error of t",
            unit="m",
            tolerance=0.05,
        ),
        Pixelwise(depth_errors, _mean_of_squares),
        DISTANCES,
        math.sqrt,
    ),
)
