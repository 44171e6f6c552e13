# SPDX-License-Identifier: Apache-2.0
"""Adaptive aggregation: lamps that do next to nothing are put where light is missing (inferred).

The paper says that lamps are aggregated adaptively, and its figures show that some are out; not how.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import torch

from graycard.methods.gsid._candidates import CLEAR
from graycard.methods.gsid._draw import draw
from graycard.methods.gsid._lights import (
    AMPLITUDES,
    AXES,
    DARK,
    FIRST_SHARPNESS,
    POSITIONS,
    SHARPNESS,
    lamps_from,
    sky_from,
)
from graycard.methods.gsid._model import LitPicture, Reach
from graycard.methods.gsid._objective import DeferredView
from graycard.methods.gsid._settings import GsidSettings
from graycard.methods.shading import surroundings_of
from graycard.methods.splat import FitState

HEIGHT = 0.25
"""Shares of the extent: how far over the place that lacks light a lamp begins anew."""
_SMOOTH = 7
"""Pixels over which missing light is averaged: a highlight or an edge is no lamp."""


@dataclass(frozen=True, eq=False)
class Lack:
    """A place that lacks light."""

    position: torch.Tensor
    """Where a lamp would help, shape ``(3,)``, metres."""
    intensity: torch.Tensor
    """Of a lamp there that shines alike all round, shape ``(3,)``, W/sr times exposure."""


@torch.no_grad()
def aggregated(
    state: FitState,
    shots: Sequence[DeferredView],
    reach: Sequence[Reach],
    settings: GsidSettings,
    extent: float,
) -> FitState:
    """A state in which the weakest lamp, if it is next to out, shines where light is missing.

    One at a time: a lamp that is put somewhere changes where light is missing. Where there is a lamp already
    it stays as it is.

    Args:
        state: Of the second stage; used up.
        shots: Training views.
        reach: One a view.
        settings: ``lamps`` and ``least_share``.
        extent: Of the scene, metres.
    """
    if settings.lamps == 0:
        return state
    values = state.parameters.all
    pictures = [_shaded(values, s, r, settings, extent) for s, r in zip(shots, reach, strict=True)]
    given = torch.stack([p.by_lamp.mean(dim=(0, 1, 3)) for p in pictures]).mean(dim=0)
    weakest = int(given.argmin())
    if given[weakest] >= settings.least_share * given.sum():
        return state
    lack = largest_lack(shots, pictures, extent)
    others = values[POSITIONS][given > given[weakest]]
    if len(others) and float((others - lack.position).norm(dim=-1).min()) < CLEAR * extent:
        return state  # there is a lamp already, and it does not help
    _put(values, weakest, lack, settings)
    for name in (POSITIONS, AXES, SHARPNESS, AMPLITUDES):
        state.moments[name].first[weakest] = 0
        state.moments[name].second[weakest] = 0
    return state


def _shaded(
    values: Mapping[str, torch.Tensor],
    shot: DeferredView,
    reach: Reach,
    settings: GsidSettings,
    extent: float,
) -> LitPicture:
    lights = lamps_from(values), surroundings_of(sky_from(values))
    return draw(values, shot.ground, lights, reach, settings, extent)


def largest_lack(shots: Sequence[DeferredView], pictures: Sequence[LitPicture], extent: float) -> Lack:
    """Where photographs are brighter than pictures by most, over a few pixels."""
    missing = torch.stack([_blurred(s.linear - p.whole) for s, p in zip(shots, pictures, strict=True)])
    covered = torch.stack([shot.ground.drawn.alpha > 0.9 for shot in shots])
    brightness = torch.where(covered, missing.mean(dim=-1), -torch.inf)
    view, row, column = (int(i) for i in torch.unravel_index(brightness.argmax(), brightness.shape))
    ground = shots[view].ground
    height = HEIGHT * extent
    position = ground.points[row, column] + height * ground.normal[row, column]
    # what a surface of the mean albedo returns, turned round
    return Lack(position, missing[view, row, column].clamp(min=1e-4) * torch.pi * height**2 / 0.4)


def _blurred(image: torch.Tensor) -> torch.Tensor:
    padded = image.permute(2, 0, 1)[None]
    mean = torch.nn.functional.avg_pool2d(padded, _SMOOTH, 1, _SMOOTH // 2, count_include_pad=False)
    return mean[0].permute(1, 2, 0)


def _put(values: Mapping[str, torch.Tensor], lamp: int, lack: Lack, settings: GsidSettings) -> None:
    """Move a lamp, and let it shine alike all round."""
    values[POSITIONS][lamp] = lack.position
    steps = torch.linspace(0, 0.5 * (settings.lobes - 1), settings.lobes)
    values[SHARPNESS][lamp] = torch.tensor(FIRST_SHARPNESS).log() + steps
    values[AMPLITUDES][lamp] = (lack.intensity / settings.lobes).log().clamp(min=DARK)
