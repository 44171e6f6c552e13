# SPDX-License-Identifier: Apache-2.0
"""Shading: each surfel is shaded at its centre, and what it sends is drawn.

Light goes straight from the lamp to a surfel and on to the camera: nothing casts a shadow.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import torch
from torch.nn.functional import normalize, softplus

from graycard import Camera
from graycard.methods._priors import Lamp
from graycard.methods.darkgs._lamp import MeasuredLamp, irradiance
from graycard.methods.splat import CENTRES, see, surfels_of

PAINT, NORMALS, AMBIENT = "paint", "shading normals", "log ambient light"
"""Names of the parameters: of each surfel, ``(N, 3)``, whose softplus is the albedo; of each surfel that has
a normal of its own, ``(N, 3)``, world, of any length; of the scene, ``(3,)``, exposed radiance over
albedo."""


@dataclass(frozen=True, eq=False)
class Shaded:
    """Radiance from surfels to a camera; each of shape ``(N, 3)``, radiance times exposure."""

    albedo: torch.Tensor
    """Albedo of the surfels."""
    lamp: torch.Tensor
    """Radiance that they reflect from the lamp."""
    ambient: torch.Tensor
    """Radiance that they reflect from the light that stays."""


def albedo_of(values: Mapping[str, torch.Tensor]) -> torch.Tensor:
    """Albedo of the surfels, shape ``(N, 3)``, linear, above 0."""
    return softplus(values[PAINT])


def shade(
    values: Mapping[str, torch.Tensor], camera: Camera, lamp: Lamp | MeasuredLamp, exposure: float
) -> Shaded:
    """Surfels under a lamp that goes with the camera: ``albedo (L + ambient) max(0, n . w)``.

    The ambient light has the lamp's cosine too, as the paper has it. ``L`` is the irradiance of a surface
    that faces the lamp over pi, so that a calibrated lamp makes the albedo that of a matte surface.

    Args:
        values: Parameters by name.
        camera: The camera.
        lamp: In its axes.
        exposure: Factor from radiance to the range of the fit, 1/(W/m²/sr).
    """
    pose = values[CENTRES].new_tensor(camera.world_to_camera)
    points = values[CENTRES] @ pose[:3, :3].T + pose[:3, 3]
    if NORMALS in values:
        normals = normalize(values[NORMALS] @ pose[:3, :3].T, dim=1)
    else:
        normals = see(surfels_of(values), camera).normals
    toward = normalize(points.new_tensor(lamp.position) - points, dim=1)
    albedo = albedo_of(values)
    reflected = albedo * (normals * toward).sum(dim=1, keepdim=True).relu()
    sent = irradiance(lamp, points) * (exposure / np.pi)
    return Shaded(albedo, reflected * sent, reflected * values[AMBIENT].exp())
