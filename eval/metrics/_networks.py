# SPDX-License-Identifier: Apache-2.0
"""Pictures seen through networks that were trained on photographs: LPIPS of each view, FID and KID of all."""

from functools import partial

import numpy as np

from graycard.eval.kinds._images import ImageMetric, ImageRule
from graycard.eval.kinds._records import error
from graycard.eval.kinds._references import Reference
from graycard.eval.kinds._sets import SetMetric, SetRule
from graycard.eval.measures._inception import features_of, fid, kid, kid_error
from graycard.eval.measures._lpips import lpips
from graycard.eval.measures._spaces import display
from graycard.eval.scoring._ceiling import TOO_COSTLY
from graycard.eval.scoring._findings import Measurement
from graycard.networks import Net, has_inception, has_lpips, least_side

_TRUNKS: dict[Net, str] = {"alex": "AlexNet", "vgg": "VGG-16"}
_PAIRED = (
    "; views of one scene are few and alike, so it compares predictions of that scene, not with figures "
    "of sets of thousands"
)


def _lpips(group: str, title: str, layer: str, net: Net, after: str) -> ImageMetric:
    """Return LPIPS of pictures; that of AlexNet has the plain name."""
    trunk = _TRUNKS[net]
    return ImageMetric(
        record=error(
            group,
            "lpips" if net == "alex" else f"lpips.{net}",
            f"{title} LPIPS" if net == "alex" else f"{title} LPIPS, {trunk}",
            f"mean over the mask of the LPIPS map (version 0.1, {trunk}, spatial) of srgb(L·exposure) "
            "in [-1, 1]; only where weights are fetched or named",
            tolerance=0.01,
        ),
        rule=ImageRule(display, partial(lpips, net=net), least_side=least_side(net)),
        layers=(layer,),
        ceiling=TOO_COSTLY,
        references=(
            Reference(
                "LPIPS" if net == "alex" else f"LPIPS, {trunk}",
                "its equations in numpy, float64, small random weights, five digits",
                1e-5,
            ),
        ),
        available=partial(has_lpips, net),
        advice="run `graycard weights lpips`",
        after=after,
    )


def _fid(predicted: np.ndarray, true: np.ndarray) -> Measurement:
    return Measurement(fid(predicted, true))


def _kid(predicted: np.ndarray, true: np.ndarray) -> Measurement:
    parts = {"standard_error": kid_error(predicted, true)} if len(true) > 2 else {}
    return Measurement(kid(predicted, true), parts)


def _sets(group: str, title: str, layer: str, after: str) -> tuple[SetMetric, SetMetric]:
    """Return FID and KID of pictures."""
    shown = "features of Inception v3 (2015, 8 bits, 299 x 299) of all test views, outside the mask the truth"
    return (
        SetMetric(
            record=error(
                group,
                "fid",
                f"{title} FID",
                f"|m₁ - m₂|² + tr(S₁ + S₂ - 2 (S₁ S₂)^½) of the {shown}{_PAIRED}",
                tolerance=1.0,
            ),
            rule=SetRule(features_of, _fid),
            layers=(layer,),
            ceiling=TOO_COSTLY,
            references=(Reference("FID", "scipy.linalg.sqrtm of the covariances", 1e-6),),
            available=has_inception,
            advice="run `graycard weights inception`",
            after=after,
        ),
        SetMetric(
            record=error(
                group,
                "kid",
                f"{title} KID",
                f"squared discrepancy by the kernel (x·y / 2048 + 1)³, without bias, of the {shown}; "
                f"with its standard error by the jackknife{_PAIRED}",
                tolerance=0.01,
            ),
            rule=SetRule(features_of, _kid),
            layers=(layer,),
            ceiling=TOO_COSTLY,
            references=(Reference("KID", "its sums over pairs, one by one", 1e-9),),
            breakdown=("standard_error",),
            available=has_inception,
            advice="run `graycard weights inception`",
            after=f"{group}.fid",
        ),
    )


METRICS = (
    _lpips("novel_view", "Novel view", "radiance", "alex", "novel_view.flip_hdr"),
    _lpips("novel_view", "Novel view", "radiance", "vgg", "novel_view.lpips"),
    *_sets("novel_view", "Novel view", "radiance", "novel_view.lpips.vgg"),
    _lpips("counterfactual", "Removal", "counterfactual.radiance", "alex", "counterfactual.flip"),
    *_sets("counterfactual", "Removal", "counterfactual.radiance", "counterfactual.lpips"),
)
