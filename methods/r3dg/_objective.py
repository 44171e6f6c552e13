# SPDX-License-Identifier: Apache-2.0
"""What the second stage lowers: how far surfels are from the photographs, and light that is too free."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import torch

from graycard import Camera
from graycard.methods.r3dg._light import (
    BASE_COLOR,
    ROUGHNESS,
    SKY,
    Directions,
    from_sky,
    in_view,
    own_light,
    returned,
    roughness_from,
)
from graycard.methods.r3dg._settings import R3dgSettings
from graycard.methods.shading import look_up, unevenness
from graycard.methods.splat import FeatureMaps, Look, photometric_map, rasterize_features, surfels_of, view_at
from graycard.methods.surfels import encode


@dataclass(frozen=True, eq=False)
class Shot:
    """A training view as the second stage looks at it."""

    camera: Camera
    shown: torch.Tensor
    """Shape ``(H, W, 3)``: radiance times exposure, encoded for a display."""
    eye: torch.Tensor
    """Shape ``(3,)``: of the camera, metres."""
    rays: torch.Tensor
    """Shape ``(H, W, 3)``: away from the camera."""
    rows: torch.Tensor
    """Numbers of the surfels that may be seen."""


def shot_of(camera: Camera, shown: torch.Tensor, centres: torch.Tensor) -> Shot:
    """A view of surfels that stand still."""
    eye, rays = torch.tensor(camera.position).float(), torch.tensor(camera.rays()).float()
    return Shot(camera, shown, eye, rays, in_view(centres, camera))


@dataclass(frozen=True, eq=False)
class Objective:
    """The loss of one view a step."""

    shots: Sequence[Shot]
    directions: Directions
    settings: R3dgSettings
    first: int
    """Steps before this stage."""
    seed: int

    def __call__(self, values: Mapping[str, torch.Tensor], step: int) -> Look:
        """What is to be lowered at a step."""
        settings = self.settings
        shot = self.shots[view_at(step + self.first, len(self.shots), self.seed)]
        sky = values[SKY].exp()
        own = own_light(values, self.directions, shot.rows)
        incident = from_sky(sky, self.directions, shot.rows) + own
        sent = returned(values, self.directions, incident, shot.rows, shot.eye)
        drawn = drawn_layers(values, sent, shot.rows, shot.camera)
        picture, base, roughness = drawn.features.split([3, 3, 1], dim=-1)
        picture = picture + (1 - drawn.alpha[..., None]) * look_up(sky, shot.rays)
        loss = photometric_map(encode(picture), shot.shown, settings.ssim_share).mean()
        smooth = smoothness(torch.cat([base, roughness], dim=-1), shot.shown)
        white = (own - own.mean(dim=-1, keepdim=True)).abs().mean()
        loss = loss + settings.smooth_weight * smooth + settings.white_weight * white
        return Look(loss + settings.sky_weight * unevenness(sky))


def drawn_layers(
    values: Mapping[str, torch.Tensor], sent: torch.Tensor, rows: torch.Tensor, camera: Camera
) -> FeatureMaps:
    """Sent light, base colour and roughness, drawn: 7 channels, weighted by what surfels cover.

    Args:
        values: Parameters by name.
        sent: Shape ``(R, 3)``.
        rows: Shape ``(R,)``: the surfels that send it; what others send is not seen.
        camera: That looks.
    """
    base, roughness = values[BASE_COLOR].sigmoid(), roughness_from(values[ROUGHNESS])
    all_sent = torch.zeros_like(base).index_copy(0, rows, sent)
    features = torch.cat([all_sent, base, roughness], dim=1)
    return rasterize_features(surfels_of(values, features), camera)


def smoothness(layers: torch.Tensor, guide: torch.Tensor) -> torch.Tensor:
    """Mean difference of neighbours, less where a picture differs too: ``|d layers| exp(-|d guide|)``.

    Args:
        layers: Shape ``(H, W, C)``.
        guide: Shape ``(H, W, 3)``.
    """
    total = torch.zeros(())
    for axis in (0, 1):
        edge = torch.exp(-guide.diff(dim=axis).abs().mean(dim=-1, keepdim=True))
        total = total + (layers.diff(dim=axis).abs() * edge).mean()
    return total
