# SPDX-License-Identifier: Apache-2.0
"""Relighting and composition: pictures under other lights, and with an object of another scene put in.

Whoever takes the albedo for half of what it is, renders half the light under given lamps. So relit pictures
take the gauge of the albedo, fitted on training views under the lights of the photographs; nothing is fitted
to the changed pictures. Where an object is put in, the lights stay those that the method found: albedo and
light stand together in the picture, which has no gauge.
"""

from collections.abc import Iterator

import numpy as np

from graycard import EditKind
from graycard.eval.kinds._changed import LAYER, ChangedMetric, ChangedPicture, ChangedRule, Changes
from graycard.eval.kinds._records import CHANNEL, decibels, share
from graycard.eval.kinds._references import PSNR, RELIT, SSIM
from graycard.eval.measures._pixelwise import square_errors
from graycard.eval.measures._psnr import psnr
from graycard.eval.measures._ssim import ssim
from graycard.eval.scoring._ceiling import AS_DISPLAYED, NEIGHBOURHOODS
from graycard.records import MetricRecord

GAUGE = "traded"
"""Name of the gauge of pictures under given lights: what the albedo gains, they gain with it."""


def square_error(predicted: np.ndarray, true: np.ndarray, mask: np.ndarray) -> float:
    """Return the mean square error over the pixels of a mask and the channels."""
    return float(square_errors(predicted, true, mask).mean())


def relit_pictures(changes: Changes) -> Iterator[ChangedPicture]:
    """Yield each test view under each change of the lights."""
    predictions, truth, masks = changes
    for edit in truth.edits:
        for view in (v for v in truth.views if v.split == "test" and masks[v.name].any()):
            yield ChangedPicture(
                edit.name,
                edit.kind,
                view,
                truth.relit(edit.name, view),
                lambda e=edit.name, v=view.name: predictions.relit(e, v),
                masks[view.name],
            )


def composed_pictures(changes: Changes) -> Iterator[ChangedPicture]:
    """Yield each test view with the object put in; none in a scene without a composition."""
    predictions, truth, _ = changes
    composition = truth.composition()
    if composition is None:
        return
    for view in (v for v in truth.views if v.split == "test"):
        true = truth.composed(view)
        put_in = true["object_id"] == composition.object_id
        yield ChangedPicture(
            composition.donor.object,
            None,
            view,
            true,
            lambda v=view.name: predictions.composed(v),
            true["object_id"] > 0,
            {"object": put_in, "around": (true["object_id"] > 0) & ~put_in},
        )


_PSNR = "10·log10(1 / mean of MSE over changes and views)"
_SSIM = "mean over changes and views of SSIM (Gaussian 11x11, sigma 1.5, eroded mask)"
_WHERE = "as displayed, srgb(L·exposure), over the mask of the test views"
_RELIT = (
    f"of s_c·radiance {_WHERE}, s_c of the prediction's albedo (base_color, else diffuse_reflectance, else "
    "albedo; 1 where it has none) on training views under the lights of the photographs"
)
_COMPOSED = f"of radiance {_WHERE}"
_KINDS: dict[EditKind, str] = {
    "off": "a light off",
    "moved": "a light moved",
    "recoloured": "a light in another colour",
    "environment": "other surroundings",
}


def _relit_psnr(record: MetricRecord, kind: EditKind | None = None) -> ChangedMetric:
    return ChangedMetric(
        record=record,
        rule=ChangedRule(relit_pictures, square_error, psnr, kind),
        layers=(LAYER,),
        gauge=GAUGE,
        refuses=("sign",),
        ceiling=AS_DISPLAYED,
        references=(RELIT,),
    )


METRICS: tuple[ChangedMetric, ...] = (
    _relit_psnr(
        decibels("relighting", "psnr", "Relighting PSNR", f"{_PSNR} {_RELIT}", headline=True, ignores=CHANNEL)
    ),
    ChangedMetric(
        record=share("relighting", "ssim", "Relighting SSIM", f"{_SSIM} {_RELIT}", ignores=CHANNEL),
        rule=ChangedRule(relit_pictures, ssim),
        layers=(LAYER,),
        gauge=GAUGE,
        refuses=("sign",),
        ceiling=NEIGHBOURHOODS,
        references=(SSIM,),
    ),
    *(
        _relit_psnr(
            decibels(
                "relighting",
                f"psnr.{kind}",
                f"Relighting PSNR, {title}",
                f"{_PSNR}, {title}, {_RELIT}",
                ignores=CHANNEL,
            ),
            kind,
        )
        for kind, title in _KINDS.items()
    ),
    ChangedMetric(
        record=decibels("composition", "psnr", "Composition PSNR", f"{_PSNR} {_COMPOSED}"),
        rule=ChangedRule(composed_pictures, square_error, psnr),
        layers=(LAYER,),
        ceiling=AS_DISPLAYED,
        references=(PSNR,),
        breakdown=("object", "around"),
    ),
    ChangedMetric(
        record=share("composition", "ssim", "Composition SSIM", f"{_SSIM} {_COMPOSED}"),
        rule=ChangedRule(composed_pictures, ssim),
        layers=(LAYER,),
        ceiling=NEIGHBOURHOODS,
        references=(SSIM,),
    ),
)
