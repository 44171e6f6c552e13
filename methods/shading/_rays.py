# SPDX-License-Identifier: Apache-2.0
"""Occlusion: rays through surfels."""

import numpy as np
import torch
from torch.nn.functional import normalize

from graycard.methods.splat import Rays, Surfels, build_bvh, rotation_matrices, trace_rays

SLACK = 0.04
"""Shares of the scene's extent: surfels are no exact surfaces, so that what is met this close to a point is
the point itself."""
SHORT = 1.5 * SLACK
"""The same along a ray to a point, which may meet its surface at a slant."""
SKY_DIRECTIONS = 48
_HERE = 1e-6
"""Metres: a lamp this close to a point is there."""


def lamp_visibility(
    surfels: Surfels, points: torch.Tensor, lamps: torch.Tensor, extent: float
) -> torch.Tensor:
    """Share of each lamp's light that reaches each point: what passes along one ray, almost to the point.

    Args:
        surfels: In the way.
        points: Shape ``(P, 3)``, metres.
        lamps: Shape ``(K, 3)``, metres.
        extent: Of the scene, metres.

    Returns:
        Shape ``(P, K)``, 0 to 1, without gradient.
    """
    if not len(lamps) or not len(points):
        return torch.ones(len(points), len(lamps))
    with torch.no_grad():
        away = points[None] - lamps[:, None]
        distance = away.norm(dim=-1)
        away = torch.where(distance[..., None] > _HERE, away, torch.eye(3)[2])  # to itself: any direction
        origins = lamps[:, None].expand_as(away).reshape(-1, 3).contiguous()
        almost = (distance - SHORT * extent).clamp(min=0).flatten()
        rays = Rays(origins, normalize(away, dim=-1).reshape(-1, 3), far=almost)
        met = trace_rays(surfels, rays, surfels.centres.new_zeros(len(surfels), 0), bvh=build_bvh(surfels))
        return met.transmittance.reshape(distance.shape).T.contiguous()


def sky_visibility(surfels: Surfels, normals: torch.Tensor, extent: float) -> torch.Tensor:
    """Share of an even sky's irradiance that reaches each surfel, shape ``(N,)``, without gradient.

    Args:
        surfels: N of them.
        normals: Shape ``(N, 3)``, world, unit, to the side that is lit.
        extent: Of the scene, metres.
    """
    with torch.no_grad():
        rays = hemisphere(surfels.centres, normals, extent)
        met = trace_rays(surfels, rays, surfels.centres.new_zeros(len(surfels), 0), near=SLACK * extent)
        return met.transmittance.reshape(len(surfels), -1).mean(dim=1)


def hemisphere(points: torch.Tensor, normals: torch.Tensor, extent: float) -> Rays:
    """Rays over surfaces, as dense as a matte one weighs them, :data:`SKY_DIRECTIONS` a point, one by one.

    Args:
        points: Shape ``(P, 3)``, metres.
        normals: Shape ``(P, 3)``, unit.
        extent: Of the scene, metres: rays begin :data:`SLACK` of it over the surface.
    """
    directions = _cosine_directions(normals)
    origins = (points + SLACK * extent * normals)[:, None].expand_as(directions)
    return Rays(origins.reshape(-1, 3).contiguous(), directions.reshape(-1, 3))


def _cosine_directions(normals: torch.Tensor) -> torch.Tensor:
    """Directions around normals, as dense as a matte surface weighs them, ``(N, SKY_DIRECTIONS, 3)``."""
    number = np.arange(SKY_DIRECTIONS) + 0.5
    radius, angle = np.sqrt(number / SKY_DIRECTIONS), number * np.pi * (3 - np.sqrt(5))
    local = np.stack([radius * np.cos(angle), radius * np.sin(angle), np.sqrt(1 - radius**2)], axis=-1)
    helper = torch.eye(3)[normals.abs().argmin(dim=-1)]
    first = normalize(torch.linalg.cross(normals, helper), dim=-1)
    second = torch.linalg.cross(normals, first)
    frame = torch.stack([first, second, normals], dim=1)
    return normalize(torch.from_numpy(local.astype(np.float32)) @ frame, dim=-1)


def outward(surfels: Surfels, eyes: torch.Tensor) -> torch.Tensor:
    """Return normals of the surfels to the side of most eyes, shape ``(N, 3)``, world, unit.

    Args:
        surfels: N of them.
        eyes: Shape ``(V, 3)``, where the cameras are, metres.
    """
    normals = rotation_matrices(surfels.rotations)[:, :, 2]
    toward = normalize(eyes[None] - surfels.centres[:, None], dim=-1)
    side = (toward * normals[:, None]).sum(dim=(1, 2))
    return torch.where(side[:, None] < 0, -normals, normals).detach()
