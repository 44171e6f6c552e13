# SPDX-License-Identifier: Apache-2.0
"""Start of a fit: surfels with one neutral albedo, and lights that explain the photographs of such."""

from collections.abc import Sequence

import torch

from graycard import Capture
from graycard.methods.splat import Parameters, parameters_of
from graycard.methods.sunfaded._light import lamp_parameters
from graycard.methods.sunfaded._model import ALBEDO, AMBIENT
from graycard.methods.sunfaded._objective import DisplayedPhotograph
from graycard.methods.sunfaded._settings import SunFadedSettings
from graycard.methods.sunfaded._weight import FAINT
from graycard.methods.surfels import (
    SweptDepth,
    check_lamp_on_camera,
    check_photographs,
    check_places,
    sparse_discs,
    srgb_decode_tensor,
)

DARKEST = 0.02
"""Floor of the albedo that surfels begin with: at 0 it would have no gradient."""


def check_capture(capture: Capture) -> None:
    """Refuse a capture that the method is not made for, before any time is spent.

    Raises:
        MethodError: The light is not on the camera, all views are from one place, or photographs are black
            or not finite.
    """
    check_lamp_on_camera(capture)
    check_places(capture)
    check_photographs(capture)


def start(
    capture: Capture,
    views: Sequence[DisplayedPhotograph],
    settings: SunFadedSettings,
    seed: int,
    swept: Sequence[SweptDepth] | None = None,
) -> Parameters:
    """Parameters before the first step.

    All surfels begin with one albedo, which no light has touched, and not with the colours of photographs:
    where the lamp always shines nothing in the first stage would take its light out of them. The released
    code begins without any light that stays; then albedo has no gradient. Here both lights begin with what
    explains the photographs of such surfaces, see :func:`first_lights`.

    Args:
        capture: Photographs, cameras and sparse points.
        views: Its training views.
        settings: Of the fit.
        seed: Of the fit.
        swept: Depth by stereo, where it is there.

    Raises:
        MethodError: There are too few sparse points.
    """
    discs = sparse_discs(capture, settings.surfels, settings.fill, seed, swept=swept)
    albedo = _first_albedo(discs.features.float(), settings)
    lights = first_lights(views, albedo.mean(dim=0), settings, seed)
    return parameters_of(discs, {ALBEDO: albedo.logit()}, lights)


def _first_albedo(colours: torch.Tensor, settings: SunFadedSettings) -> torch.Tensor:
    """Return the albedo of surfels of displayed colours ``(N, 3)``, in the space of the fit."""
    if settings.first_albedo > 0:
        return torch.full_like(colours, settings.first_albedo)
    return (srgb_decode_tensor(colours) if settings.space == "linear" else colours).clamp(
        DARKEST, 1 - DARKEST
    )


def first_lights(
    views: Sequence[DisplayedPhotograph], albedo: torch.Tensor, settings: SunFadedSettings, seed: int
) -> dict[str, torch.Tensor]:
    """Both lights before the first step, for surfaces of a mean albedo.

    The light that stays makes them as bright as places that the lamp does not reach, and the lamp what is
    left of the photographs' mean, if surfaces face it.

    Args:
        views: Photographs.
        albedo: Shape ``(3,)``, the mean, in the space of the fit.
        settings: ``space`` and ``ambient``.
        seed: Of the network.

    Returns:
        Parameters by name.
    """
    means, weighted, weights = [], [], []
    for view in views:
        image = srgb_decode_tensor(view.shown) if settings.space == "linear" else view.shown
        means.append(image.mean(dim=(0, 1)))
        weighted.append((view.weight * image).mean(dim=(0, 1)))
        weights.append(view.weight.mean())
    dark = torch.stack(weighted).mean(dim=0) / torch.stack(weights).mean()
    dark = dark if settings.ambient else torch.zeros(3)
    whole = torch.stack(means).mean(dim=0)
    level = (whole - dark).clamp(min=FAINT) / albedo
    return lamp_parameters(seed, level) | {AMBIENT: dark / albedo}
