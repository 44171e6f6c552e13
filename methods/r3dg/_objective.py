# SPDX-License-Identifier: Apache-2.0
"""Loss of the second stage: how far surfels are from the photographs, and light that is too free."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import torch

from graycard import Camera
from graycard.io import Room
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
from graycard.methods.shading import look_up, unevenness, unevenness_but_for_edges
from graycard.methods.splat import (
    FeatureMaps,
    LossResult,
    photometric_map,
    rasterize_features,
    surfels_of,
    view_at,
)
from graycard.methods.surfels import EncodedPhotograph, srgb_encode_tensor


@dataclass(frozen=True, eq=False)
class ForwardView:
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


def forward_views(
    photographs: Sequence[EncodedPhotograph], values: Mapping[str, torch.Tensor]
) -> list[ForwardView]:
    """Return views of surfels that stand still."""
    found, room = [], Room()
    for view in photographs:
        eye, rays = torch.tensor(view.camera.position).float(), torch.tensor(view.camera.rays()).float()
        rows = in_view(values, view.camera)
        found.append(ForwardView(view.camera, view.encoded, eye, room.keep(rays), rows))
    return found


@dataclass(frozen=True, eq=False)
class R3dgObjective:
    """The loss of one view a step."""

    shots: Sequence[ForwardView]
    directions: Directions
    settings: R3dgSettings
    first: int
    """Steps before this stage."""
    seed: int

    def __call__(self, values: Mapping[str, torch.Tensor], step: int) -> LossResult:
        """Return the loss of a step, with what else the fit is told."""
        settings = self.settings
        shot = self.shots[view_at(step + self.first, len(self.shots), self.seed)]
        sky = values[SKY].exp()
        own = own_light(values, self.directions, shot.rows)
        incident = from_sky(sky, self.directions, shot.rows) + own
        sent = returned(values, self.directions, incident, shot.rows, shot.eye)
        arrived = incident.mean(dim=1)
        drawn = drawn_layers(values, torch.cat([sent, arrived], dim=1), shot.rows, shot.camera)
        base, roughness, picture, light = drawn.features.split([3, 1, 3, 3], dim=-1)
        picture = picture + (1 - drawn.alpha[..., None]) * look_up(sky, shot.rays)
        loss = photometric_map(srgb_encode_tensor(picture), shot.shown, settings.ssim_share).mean()
        for layer, weight in (
            (base, settings.base_color_smooth_weight),
            (roughness, settings.roughness_smooth_weight),
            (light, settings.light_smooth_weight),
        ):
            loss = loss + weight * unevenness_but_for_edges(layer, shot.shown)
        colour = (arrived - arrived.mean(dim=-1, keepdim=True)).abs().sum() / max(1, arrived.numel())
        loss = loss + settings.white_weight * colour
        return LossResult(loss + settings.sky_weight * unevenness(sky))


def drawn_layers(
    values: Mapping[str, torch.Tensor], sent: torch.Tensor, rows: torch.Tensor, camera: Camera
) -> FeatureMaps:
    """Return base colour, roughness and light, drawn: 4 + C channels, weighted by what surfels cover.

    Args:
        values: Parameters by name.
        sent: Shape ``(R, C)``.
        rows: Shape ``(R,)``: the surfels that it is of, :func:`in_view`; others are not seen.
        camera: That looks.
    """
    base, roughness = values[BASE_COLOR].sigmoid(), roughness_from(values[ROUGHNESS])
    all_sent = sent.new_zeros(len(base), sent.shape[1]).index_copy(0, rows, sent)
    features = torch.cat([base, roughness, all_sent], dim=1)
    return rasterize_features(surfels_of(values, features), camera)
