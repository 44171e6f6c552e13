# SPDX-License-Identifier: Apache-2.0
"""Where a fit begins: surfels with the colours of the photographs, and a light that explains dark places."""

from collections.abc import Sequence

import torch

from graycard import Capture
from graycard.methods.splat import Parameters, parameters_of
from graycard.methods.sunfaded._light import lamp_parameters
from graycard.methods.sunfaded._model import ALBEDO, AMBIENT
from graycard.methods.sunfaded._objective import Photograph
from graycard.methods.sunfaded._settings import SunFadedSettings
from graycard.methods.surfels import (
    check_lamp_on_camera,
    check_photographs,
    check_places,
    decode,
    sparse_discs,
)

DARKEST = 0.02
"""Of the albedo that surfels begin with: at 0 it would have no gradient."""


def check_capture(capture: Capture) -> None:
    """Refuse a capture that the method is not made for, before any time is spent.

    Raises:
        MethodError: The light is not on the camera, all views are from one place, or photographs are black
            or not finite.
    """
    check_lamp_on_camera(capture)
    check_places(capture)
    check_photographs(capture)


def start(capture: Capture, views: Sequence[Photograph], settings: SunFadedSettings, seed: int) -> Parameters:
    """Parameters before the first step.

    The released code begins without any light that stays; then albedo has no gradient. Here that light
    begins with what brings the mean albedo to the brightness of places that the lamp does not reach.

    Raises:
        MethodError: There are too few sparse points.
    """
    discs = sparse_discs(capture, settings.surfels, settings.fill, seed)
    linear = settings.space == "linear"
    albedo = (decode(discs.features) if linear else discs.features).float().clamp(DARKEST, 1)
    shared = lamp_parameters(seed)
    shared[AMBIENT] = _dark_places(views, linear) / albedo.mean(dim=0) if settings.ambient else torch.zeros(3)
    return parameters_of(discs, {ALBEDO: albedo}, shared)


def _dark_places(views: Sequence[Photograph], linear: bool) -> torch.Tensor:
    """The weighted mean of the photographs in the space of the fit, shape ``(3,)``."""
    shown = [decode(view.shown) if linear else view.shown for view in views]
    total = sum(float(view.weight.sum()) for view in views)
    summed = torch.stack(
        [(view.weight * image).sum(dim=(0, 1)) for view, image in zip(views, shown, strict=True)]
    )
    return summed.sum(dim=0) / total
