# SPDX-License-Identifier: Apache-2.0
"""Light that arrives at surfels from some directions, and what they return of it (forward shading).

Of each surfel 48 directions over its surface are looked at, as dense as a matte surface weighs them. From
each comes what the environment sends, times the share of it that gets through the other surfels (rays, traced
once), and light of the surfel's own: a sum of harmonics, not below 0, which stands for all else that comes
from there, be it bounced or of a lamp nearby. Returned light is the mean over the directions (Gao et al.,
ECCV 2024, section 3.2, there with 64 directions). There are no metals: f0 is 0.04. A surfel that is seen from
behind looks as it does from its front.
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
from graycard.methods.splat import CENTRES, Surfels, harmonics_basis, image_radius, trace_rays

BASE_COLOR, ROUGHNESS, OWN = "base colour", "roughness", "own incident light"
"""Names of the parameters of surfels: logits ``(N, 3)`` and ``(N, 1)``, and harmonics ``(N, 16, 3)``."""
SKY = "log sky"
"""Cubemap ``(6, N, N, 3)``: logarithm of W/m²/sr times the exposure."""
DEGREE = 3
"""Degree of the harmonics."""
LEAST_ROUGHNESS, ROUGHNESS_SPAN = 0.09, 0.9
"""Roughness as in the paper's code. Sharp lobes still fall between the directions: the limit of such a
mean."""


@dataclass(frozen=True, eq=False)
class Directions:
    """Incident light for N surfels and D directions each; no gradient."""

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
    met = trace_rays(surfels, rays, surfels.centres.new_zeros(len(surfels), 0), near=SLACK * extent)
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
    to_eye = facing_eye(values[CENTRES][rows], directions.normals[rows], eye)[:, None]
    cos_v, cos_l = ((normals * other).sum(dim=-1).clamp(min=1e-3) for other in (to_eye, toward))
    middle = normalize(to_eye + toward, dim=-1)
    fresnel = schlick(alpha.new_tensor(DIELECTRIC_F0), (to_eye * middle).sum(dim=-1).clamp(0, 1))
    facets = ggx_density(normals, middle, alpha) * smith_shadowing(cos_v, alpha)
    facets = facets * smith_shadowing(cos_l, alpha)
    # directions are as dense as cos / pi
    weights = facets * fresnel * torch.pi / (4 * cos_v * cos_l)
    return diffuse + (weights[..., None] * incident).mean(dim=1)


def facing_eye(centres: torch.Tensor, normals: torch.Tensor, eye: torch.Tensor) -> torch.Tensor:
    """Directions to the eye, mirrored to the front of surfels that are seen from behind, ``(R, 3)``, unit."""
    to_eye = normalize(eye - centres, dim=-1)
    return to_eye - 2 * (to_eye * normals).sum(dim=-1, keepdim=True).clamp(max=0) * normals


def from_sky(sky: torch.Tensor, directions: Directions, rows: torch.Tensor) -> torch.Tensor:
    """Return the light that comes from an environment, shape ``(R, D, 3)``, in its unit."""
    return directions.through[rows][..., None] * look_up(sky, directions.toward[rows])


def in_view(values: Mapping[str, torch.Tensor], camera: Camera) -> torch.Tensor:
    """Numbers of the surfels that reach into a picture, were they spheres, shape ``(R,)``."""
    places, depth = camera.project(values[CENTRES].numpy())
    reach = image_radius(values, camera).numpy() * camera.width
    across, down = np.abs(places - np.array([camera.width, camera.height]) / 2).T
    inside = (across < camera.width / 2 + reach) & (down < camera.height / 2 + reach) & (depth > 0)
    return torch.from_numpy(inside.nonzero()[0])
