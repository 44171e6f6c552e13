# SPDX-License-Identifier: Apache-2.0
"""Light that arrives at surfels from some directions, and what they return of it (forward shading).

Of each surfel 48 directions over its surface are looked at, as dense as a matte surface weighs them. From
each comes what the environment sends, times the share of it that gets through the other surfels (rays, traced
once), and light of the surfel's own: a sum of harmonics, not below 0, which stands for all else that comes
from there, be it bounced or of a lamp nearby. Returned light is the mean over the directions (Gao et al.,
ECCV 2024, section 3.2, there with 64 directions). There are no metals: f0 is 0.04.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import torch
from torch.nn.functional import normalize

from graycard import Camera
from graycard.methods.shading import (
    DIELECTRIC_F0,
    SLACK,
    ggx_density,
    hemisphere,
    look_up,
    outward,
    schlick,
    smith_shadowing,
)
from graycard.methods.splat import CENTRES, Surfels, harmonics_basis, trace

BASE_COLOR, ROUGHNESS, OWN = "base colour", "roughness", "own incident light"
"""Names of the parameters of surfels: logits ``(N, 3)`` and ``(N, 1)``, and harmonics ``(N, 16, 3)``."""
SKY = "log sky"
"""Cubemap ``(6, N, N, 3)``: logarithm of W/m²/sr times the exposure."""
DEGREE = 3
"""Of the harmonics."""
LEAST_ROUGHNESS, ROUGHNESS_SPAN = 0.09, 0.9
"""Of surfels: a sharper lobe would fall between the directions (inferred)."""
_ASIDE = 0.3
"""Shares of the picture by which the centre of a surfel may be beside it and still be drawn."""


@dataclass(frozen=True, eq=False)
class Directions:
    """Where light may come from, for N surfels and D directions each; no gradient."""

    normals: torch.Tensor
    """Shape ``(N, 3)``, unit, to the side that is seen."""
    toward: torch.Tensor
    """Shape ``(N, D, 3)``, unit, world."""
    through: torch.Tensor
    """Shape ``(N, D)``: share of the sky's light that gets through."""
    basis: torch.Tensor
    """Shape ``(N, D, 16)``: harmonics."""


@torch.no_grad()
def directions_of(surfels: Surfels, eyes: torch.Tensor, extent: float) -> Directions:
    """Trace rays from all surfels.

    Args:
        surfels: N of them.
        eyes: Shape ``(V, 3)``: where the cameras are, metres.
        extent: Of the scene, metres.
    """
    normals = outward(surfels, eyes)
    rays = hemisphere(surfels.centres, normals, extent)
    met = trace(surfels, rays, surfels.centres.new_zeros(len(surfels), 0), near=SLACK * extent)
    toward = rays.directions.reshape(len(surfels), -1, 3)
    return Directions(normals, toward, met.transmittance.reshape(len(surfels), -1), basis_of(toward))


def basis_of(toward: torch.Tensor) -> torch.Tensor:
    """Harmonics of directions, shape ``(..., 16)``, float32."""
    return torch.from_numpy(harmonics_basis(toward.numpy(), DEGREE).astype(np.float32))


def roughness_from(logits: torch.Tensor) -> torch.Tensor:
    """Roughness of a parameter, of the same shape."""
    return LEAST_ROUGHNESS + ROUGHNESS_SPAN * logits.sigmoid()


def own_light(values: Mapping[str, torch.Tensor], directions: Directions, rows: torch.Tensor) -> torch.Tensor:
    """Incident light that surfels have for themselves, shape ``(R, D, 3)``, exposed, not below 0."""
    return (directions.basis[rows] @ values[OWN][rows]).relu()


def returned(
    values: Mapping[str, torch.Tensor],
    directions: Directions,
    incident: torch.Tensor,
    rows: torch.Tensor,
    eye: torch.Tensor,
) -> torch.Tensor:
    """Radiance that surfels send to an eye, shape ``(R, 3)``, in the unit of ``incident``.

    Args:
        values: Parameters by name.
        directions: Of all surfels.
        incident: Shape ``(R, D, 3)``: radiance out of each direction.
        rows: Shape ``(R,)``: numbers of the surfels.
        eye: Shape ``(3,)``, metres.
    """
    base = values[BASE_COLOR][rows].sigmoid()
    diffuse = base * incident.mean(dim=1)
    alpha = roughness_from(values[ROUGHNESS][rows]).square()
    normals, toward = directions.normals[rows][:, None], directions.toward[rows]
    to_eye = normalize(eye - values[CENTRES][rows], dim=-1)[:, None]
    cos_v = (normals * to_eye).sum(dim=-1)
    seen = cos_v > 0
    cos_v, cos_l = torch.where(seen, cos_v, 1.0), (normals * toward).sum(dim=-1)
    middle = normalize(to_eye + toward, dim=-1)
    fresnel = schlick(torch.tensor(DIELECTRIC_F0), (to_eye * middle).sum(dim=-1).clamp(0, 1))
    facets = ggx_density(normals, middle, alpha) * smith_shadowing(cos_v, alpha)
    facets = facets * smith_shadowing(cos_l, alpha)
    # directions are as dense as cos / pi
    weights = torch.where(seen, facets * fresnel * torch.pi / (4 * cos_v * cos_l.clamp(min=1e-3)), 0.0)
    return diffuse + (weights[..., None] * incident).mean(dim=1)


def from_sky(sky: torch.Tensor, directions: Directions, rows: torch.Tensor) -> torch.Tensor:
    """What comes from an environment, shape ``(R, D, 3)``, in its unit."""
    return directions.through[rows][..., None] * look_up(sky, directions.toward[rows])


def in_view(centres: torch.Tensor, camera: Camera) -> torch.Tensor:
    """Numbers of the surfels whose centres are in a picture or not far beside it, shape ``(R,)``."""
    places, depth = camera.project(centres.numpy())
    column, row = places[:, 0] / camera.width - 0.5, places[:, 1] / camera.height - 0.5
    inside = (np.abs(column) < 0.5 + _ASIDE) & (np.abs(row) < 0.5 + _ASIDE) & (depth > 0)
    return torch.from_numpy(inside.nonzero()[0])
