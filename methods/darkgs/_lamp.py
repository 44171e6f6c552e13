# SPDX-License-Identifier: Apache-2.0
"""The calibrated lamp: what it sends to points, and how it comes to its place."""

from dataclasses import dataclass, replace
from typing import overload

import numpy as np
import torch

from graycard import PointLight
from graycard.methods._priors import Lamp

TAU = 1e-4
"""Square metres, added to the squared distance: a surfel in the lamp must not be infinitely bright. The paper
calibrates it, and the exponent of the sum, to lamps with lenses; a told lamp has the falloff of a point."""
_EDGE = 1e-12
"""Under roots, where they would have no slope at zero."""


@dataclass(frozen=True, slots=True)
class LampProfile:
    """A measured beam: a table over the angle from the lamp's axis, and the fall with distance."""

    table: tuple[tuple[float, float, float], ...]
    """W/sr by angle, even steps from 0 to ``widest``, and channel; what lies between is interpolated."""
    widest: float
    """Degrees; beyond, the last row holds."""
    tau: float
    """Square metres, added to the squared distance."""
    exponent: float
    """Exponent of that sum; 1 for the square of the distance."""


@dataclass(frozen=True, slots=True)
class MeasuredLamp:
    """A lamp whose beam is a profile."""

    lamp: Lamp
    """Its place and axis, in camera axes; strength and beam are those of the profile."""
    profile: LampProfile

    @property
    def position(self) -> tuple[float, float, float]:
        """Metres, in camera axes."""
        return self.lamp.position


def irradiance(lamp: Lamp | MeasuredLamp, points: torch.Tensor) -> torch.Tensor:
    """Return the irradiance of surfaces that face a lamp: ``I(angle) / (tau + d^2)^gamma``.

    Args:
        lamp: In camera axes.
        points: Shape ``(..., 3)``, camera axes, metres.

    Returns:
        Shape ``(..., 3)``, W/m², 0 or more; differentiable in the points.
    """
    if not isinstance(lamp, MeasuredLamp):
        return exact_irradiance(lamp, points)
    away, profile = points - points.new_tensor(lamp.position), lamp.profile
    table = points.new_tensor(profile.table)
    steps = (off_axis(lamp.lamp, away) / profile.widest).clamp(0, 1) * (len(table) - 1)
    before = steps.detach().floor().clamp(max=len(table) - 2)
    rows = before[..., 0].long()
    sent = torch.lerp(table[rows], table[rows + 1], steps - before)
    return sent / (profile.tau + (away * away).sum(dim=-1, keepdim=True)) ** profile.exponent


def exact_irradiance(lamp: Lamp, points: torch.Tensor) -> torch.Tensor:
    """Return the irradiance under a lamp as it is told, see :func:`irradiance`; gamma is 1.

    A spot shines by the renderer's own formula.
    """
    away = points - points.new_tensor(lamp.position)
    squared = (away * away).sum(dim=-1, keepdim=True)
    return points.new_tensor(lamp.intensity) * _share(lamp, away) / (TAU + squared)


def _share(lamp: Lamp, away: torch.Tensor) -> torch.Tensor:
    """Return the share of the intensity on the axis, shape ``(..., 1)``."""
    if isinstance(lamp, PointLight):
        return torch.ones_like(away[..., :1])
    edge = max(lamp.cutoff_angle - lamp.beam_width, 1e-3)
    return ((lamp.cutoff_angle - off_axis(lamp, away)) / edge).clamp(0, 1)


def off_axis(lamp: Lamp, away: torch.Tensor) -> torch.Tensor:
    """Degrees between the axis of a lamp and directions from it; a bare bulb has that of the lens.

    Args:
        lamp: In camera axes.
        away: Shape ``(..., 3)``, of any length.

    Returns:
        Shape ``(..., 1)``.
    """
    ahead = (0.0, 0.0, 1.0) if isinstance(lamp, PointLight) else lamp.direction
    axis = torch.nn.functional.normalize(away.new_tensor(ahead), dim=0)
    along = (away * axis).sum(dim=-1, keepdim=True)
    across = ((away - along * axis) ** 2).sum(dim=-1, keepdim=True)
    return torch.rad2deg(torch.atan2((across + _EDGE).sqrt(), along))


@overload
def warming(lamp: Lamp, share: float) -> Lamp: ...
@overload
def warming(lamp: MeasuredLamp, share: float) -> MeasuredLamp: ...
def warming(lamp: Lamp | MeasuredLamp, share: float) -> Lamp | MeasuredLamp:
    """Return a lamp on its way from the middle of the lens, looking ahead, to its calibrated place.

    Args:
        lamp: At its place.
        share: Of the way, 0 to 1.
    """
    if isinstance(lamp, MeasuredLamp):
        return replace(lamp, lamp=warming(lamp.lamp, share))
    x, y, z = (share * np.array(lamp.position)).tolist()
    moved = replace(lamp, position=(x, y, z))
    if isinstance(moved, PointLight):
        return moved
    axis = np.array(moved.direction) / np.linalg.norm(moved.direction)
    turned = share * axis + (1 - share) * np.array([0.0, 0.0, 1.0])
    return replace(moved, direction=tuple(turned.tolist()))
