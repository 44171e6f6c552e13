# SPDX-License-Identifier: Apache-2.0
"""The calibrated lamp: what it sends to points, and how it comes to its place."""

from dataclasses import replace

import numpy as np
import torch

from graycard import PointLight
from graycard.methods._priors import Lamp

TAU = 1e-4
"""Square metres, added to the squared distance: a surfel in the lamp must not be infinitely bright. The paper
calibrates it, and the exponent of the sum, to lamps with lenses; here the falloff is that of a point."""
_EDGE = 1e-12
"""Under roots, where they would have no slope at zero."""


def irradiance(lamp: Lamp, points: torch.Tensor) -> torch.Tensor:
    """What a lamp brings to surfaces that face it: ``I(angle) / (tau + d^2)``.

    The paper's network of the angle is fitted to photographs of a calibration; here the calibration states
    the intensity over the angle itself.

    Args:
        lamp: In camera axes.
        points: Shape ``(..., 3)``, camera axes, metres.

    Returns:
        Shape ``(..., 3)``, W/m², 0 or more; differentiable in the points.
    """
    away = points - points.new_tensor(lamp.position)
    squared = (away * away).sum(dim=-1, keepdim=True)
    return points.new_tensor(lamp.intensity) * _share(lamp, away) / (TAU + squared)


def _share(lamp: Lamp, away: torch.Tensor) -> torch.Tensor:
    """Of the intensity on the axis, shape ``(..., 1)``."""
    if isinstance(lamp, PointLight):
        return torch.ones_like(away[..., :1])
    axis = torch.nn.functional.normalize(away.new_tensor(lamp.direction), dim=0)
    along = (away * axis).sum(dim=-1, keepdim=True)
    across = ((away - along * axis) ** 2).sum(dim=-1, keepdim=True)
    angle = torch.rad2deg(torch.atan2((across + _EDGE).sqrt(), along))
    edge = max(lamp.cutoff_angle - lamp.beam_width, 1e-3)
    return ((lamp.cutoff_angle - angle) / edge).clamp(0, 1)


def warming(lamp: Lamp, share: float) -> Lamp:
    """A lamp on its way from the middle of the lens, looking ahead, to its calibrated place.

    Args:
        lamp: At its place.
        share: Of the way, 0 to 1.
    """
    x, y, z = (share * np.array(lamp.position)).tolist()
    moved = replace(lamp, position=(x, y, z))
    if isinstance(moved, PointLight):
        return moved
    axis = np.array(moved.direction) / np.linalg.norm(moved.direction)
    turned = share * axis + (1 - share) * np.array([0.0, 0.0, 1.0])
    return replace(moved, direction=tuple(turned.tolist()))
