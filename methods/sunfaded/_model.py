# SPDX-License-Identifier: Apache-2.0
"""Shading: what surfels reflect of a light that stays, and of the lamp on the camera."""

from collections.abc import Mapping
from dataclasses import dataclass

import torch

from graycard import Camera
from graycard.methods.splat import FeatureMaps, Maps, rasterize, see, surfels_of
from graycard.methods.sunfaded._light import cosine_to_lamp, lamp_intensity
from graycard.methods.sunfaded._settings import SunFadedSettings
from graycard.methods.sunfaded._tiles import lamp_map, points_of, tile_side

ALBEDO, AMBIENT = "albedo", "ambient light"
"""Names of the parameters: logits of each surfel, shape ``(N, 3)``, and of the scene, shape ``(3,)``."""


def albedo_of(values: Mapping[str, torch.Tensor]) -> torch.Tensor:
    """Albedo of each surfel, in (0, 1), shape ``(N, 3)``.

    The released code cuts its numbers off at 0 and 1. What is beyond has no gradient and never comes back.
    """
    return values[ALBEDO].sigmoid()


@dataclass(frozen=True, eq=False)
class LampPicture:
    """A view in the space of the fit; each of shape ``(H, W, 3)``."""

    albedo: torch.Tensor
    """Sum of weights times albedo: darker where surfels do not cover a pixel."""
    unlit: torch.Tensor
    """Without the lamp."""
    lit: torch.Tensor
    """By the lamp alone."""

    @property
    def whole(self) -> torch.Tensor:
        """Photographed picture."""
        return self.unlit + self.lit


def draw(
    values: Mapping[str, torch.Tensor],
    camera: Camera,
    settings: SunFadedSettings,
    offsets: torch.Tensor | None = None,
) -> Maps:
    """Return the surfels' albedo, depth and normals as a camera sees them.

    With shading ``surfel`` three more channels follow the albedo: what each surfel reflects of the lamp.
    """
    albedo = albedo_of(values)
    features = albedo
    if settings.shading == "surfel":
        features = torch.cat([albedo, albedo * _surfel_light(values, camera)], dim=1)
    return rasterize(surfels_of(values, features), camera, offsets=offsets)


def unlit_picture(drawn: FeatureMaps, values: Mapping[str, torch.Tensor]) -> torch.Tensor:
    """Light reflected from the light that stays, shape ``(H, W, 3)``."""
    return drawn.features[..., :3] * values[AMBIENT]


def picture_of(
    drawn: Maps,
    values: Mapping[str, torch.Tensor],
    camera: Camera,
    lens: torch.Tensor,
    settings: SunFadedSettings,
) -> LampPicture:
    """Light on what was drawn.

    Args:
        drawn: By :func:`draw`, with these settings.
        values: Parameters by name.
        camera: The camera that it was drawn for.
        lens: Of that camera, by :func:`lens_of`.
        settings: How light is found for pixels.
    """
    albedo = drawn.features[..., :3]
    if settings.shading == "surfel":
        lit = drawn.features[..., 3:]
    else:
        lit = albedo * lamp_light(drawn, values, camera, lens, settings)
    return LampPicture(albedo, unlit_picture(drawn, values), lit)


def lamp_light(
    drawn: Maps,
    values: Mapping[str, torch.Tensor],
    camera: Camera,
    lens: torch.Tensor,
    settings: SunFadedSettings,
) -> torch.Tensor:
    """Light that the lamp brings to each pixel, over its albedo, shape ``(H, W, 3)``: intensity times cosine.

    The intensity is that of the tile, the direction that of the pixel; depth gets no gradient from it,
    normals do.
    """
    points = points_of(drawn.depth, lens)
    side = tile_side(camera.width, settings.tile)
    normals = drawn.normal @ drawn.normal.new_tensor(camera.camera_to_world[:3, :3])  # to camera axes
    return lamp_map(values, points, side, settings.light_map) * cosine_to_lamp(values, points, normals)


def _surfel_light(values: Mapping[str, torch.Tensor], camera: Camera) -> torch.Tensor:
    """Light that the lamp brings to each surfel's centre, over its albedo, shape ``(N, 3)``."""
    seen = see(surfels_of(values), camera)
    return lamp_intensity(values, seen.centres) * cosine_to_lamp(values, seen.centres, seen.normals)
