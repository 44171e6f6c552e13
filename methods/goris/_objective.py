# SPDX-License-Identifier: Apache-2.0
"""Losses of the first stage: of radiance alone, and with light transport."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import torch
from torch.nn.functional import binary_cross_entropy, normalize

from graycard import Camera
from graycard.methods.goris._model import SURROUNDINGS, Buffers, drawn_buffers, picture_of
from graycard.methods.goris._settings import GorisSettings
from graycard.methods.goris._training_views import TrainingView
from graycard.methods.shading import unevenness
from graycard.methods.splat import (
    CENTRES,
    LossResult,
    Maps,
    depth_to_normals,
    image_radius,
    no_offsets,
    photometric_map,
    rasterize,
    surfels_of,
    view_at,
)
from graycard.methods.surfels import colours, composed, disagreement

DEGREE_EVERY = 1 / 10
"""Share of the radiance-only steps after which the next degree of the spherical harmonics is fitted, too."""
_INSIDE = 1e-4
_SOBEL = 8.0
"""Sobel's difference on a ramp that rises by one a pixel."""


@dataclass(frozen=True, eq=False)
class RadianceObjective:
    """Radiance only, as ``2dgs``, and the prior's normals on glossy surfaces.

    Without these a reflection becomes a room behind the mirror, which no later step removes.
    """

    shots: Sequence[TrainingView]
    settings: GorisSettings
    seed: int

    def __call__(self, values: Mapping[str, torch.Tensor], step: int) -> LossResult:
        """Return the loss of a step."""
        settings = self.settings
        shot, share = self.shots[view_at(step, len(self.shots), self.seed)], step / settings.radiance_steps
        view = shot.photograph
        seen = colours(values, view.camera.position, min(settings.degree, int(share / DEGREE_EVERY)))
        offsets = no_offsets(seen)
        drawn = rasterize(surfels_of(values, seen), view.camera, offsets=offsets)
        picture = composed(drawn, view.sky, values)
        loss = photometric_map(picture, view.encoded, settings.ssim_share).mean()
        weights = (
            settings.normal_weight if share >= settings.normal_start else 0.0,
            settings.distortion_weight if share >= settings.distortion_start else 0.0,
        )
        loss = loss + disagreement(drawn, view.camera, weights)
        normals = normalize(drawn.normal, dim=-1, eps=_INSIDE)
        loss = loss + settings.weights * settings.normal_prior_weight * normal_difference(normals, shot)
        camera = view.camera
        radius, size = image_radius(values, camera), (camera.width, camera.height)
        return LossResult(loss + cover_loss(drawn, settings), offsets, radius, size)


@dataclass(frozen=True, eq=False)
class LightObjective:
    """Pictures with light transport: one tile of one view a step. In a round each has its turn once."""

    shots: Sequence[TrainingView]
    """Tiles of all views."""
    settings: GorisSettings
    extent: float
    """Extent of the scene, metres."""
    seed: int

    def __call__(self, values: Mapping[str, torch.Tensor], step: int) -> LossResult:
        """Return the loss of a step, counted from the first with light transport."""
        settings = self.settings
        shot = self.shots[view_at(settings.radiance_steps + step, len(self.shots), self.seed)]
        view = shot.photograph
        offsets = screen_offsets(values, step < settings.light_density * settings.light_steps)
        buffers = drawn_buffers(values, view.camera, view.sky, settings, offsets)
        picture = picture_of(values, buffers, settings, self.extent)
        loss = photometric_map(picture.encoded, view.encoded, settings.ssim_share).mean()
        loss = loss + surface_loss(buffers, shot, settings, step)
        loss = loss + settings.weights * settings.smooth_weight * surface_unevenness(buffers, shot)
        loss = loss + settings.sky_weight * unevenness(values[SURROUNDINGS])
        return watched(loss + settings.label_weight * label_loss(buffers, shot), values, view.camera, offsets)


def screen_offsets(values: Mapping[str, torch.Tensor], densifies: bool) -> torch.Tensor | None:
    """Zeros of shape ``(N, 2)`` whose gradient tells densification of each surfel; None where it is over."""
    return torch.zeros(len(values[CENTRES]), 2, requires_grad=True) if densifies else None


def watched(
    loss: torch.Tensor, values: Mapping[str, torch.Tensor], camera: Camera, offsets: torch.Tensor | None
) -> LossResult:
    """Return a loss with the statistics that densification needs; a tile counts as a picture of its own."""
    if offsets is None:
        return LossResult(loss)
    return LossResult(loss, offsets, image_radius(values, camera), (camera.width, camera.height))


def surface_loss(
    buffers: Buffers, shot: TrainingView, settings: GorisSettings, step: int, kept: torch.Tensor | float = 1.0
) -> torch.Tensor:
    """Regularisers of surfaces and of the region, in all stages with light transport.

    Args:
        buffers: Of the view.
        shot: It.
        settings: Of the method.
        step: Counted from the first with light transport.
        kept: Shape ``(H, W)``: 1 where the photograph is not masked out.
    """
    drawn = buffers.drawn
    weights = settings.normal_weight, settings.distortion_weight
    loss = cover_loss(drawn, settings) + disagreement(drawn, buffers.camera, weights)
    held = settings.weights * normal_prior_weight(settings, step)
    loss = loss + held * normal_difference(buffers.normal, shot, kept)
    if buffers.residual is not None:
        added = buffers.glossy[..., None] * buffers.residual
        loss = loss + settings.residual_weight * added.abs().mean()
    if not shot.told:
        return loss
    lacking = drawn.alpha.detach() * shot.glossy - buffers.glossy
    differs = lacking.abs() if settings.region_loss == "both" else lacking.clamp(min=0) * shot.glossy
    return loss + settings.region_weight * (differs * kept).mean()


def cover_loss(drawn: Maps, settings: GorisSettings) -> torch.Tensor:
    """Mean transmittance of pixels, weighted."""
    return settings.cover_weight * (1 - drawn.alpha.mean())


def normal_prior_weight(settings: GorisSettings, step: int) -> float:
    """Weight of the prior's normals after some steps with light transport."""
    first, last = settings.normal_prior_weight, settings.least_normal_prior_weight
    share = min(1.0, step / (settings.decay_share * settings.iterations))
    if first <= last:
        return first
    if settings.decay == "linear":
        return first + share * (last - first)
    return first * (last / first) ** share


def normal_difference(
    normal: torch.Tensor, shot: TrainingView, kept: torch.Tensor | float = 1.0
) -> torch.Tensor:
    """Mean absolute difference from the prior's normals where surfaces are glossy, summed over axes.

    Args:
        normal: Shape ``(H, W, 3)``, world, unit.
        shot: Of a view.
        kept: Shape ``(H, W)``: weights of pixels.
    """
    if shot.normal is None:
        return torch.zeros(())
    known = (shot.normal.square().sum(dim=-1) > 0.5) * shot.glossy * kept
    return ((normal - shot.normal).abs().sum(dim=-1) * known).mean()


def label_loss(buffers: Buffers, shot: TrainingView) -> torch.Tensor:
    """Mean cross entropy between rendered labels and the mask of the object."""
    return binary_cross_entropy(buffers.label.clamp(_INSIDE, 1 - _INSIDE), shot.target)


def surface_unevenness(buffers: Buffers, shot: TrainingView) -> torch.Tensor:
    """Edge-aware smoothness of f0, roughness, normals and normals of depth on glossy surfaces.

    ``|d x| exp(-8 |d i|)`` with differences d of neighbours, of the means over channels: Sobel's, which the
    released code takes, are eight times as large.
    """
    drawn = buffers.drawn
    depth_normal = depth_to_normals(drawn.depth, buffers.camera)
    layers = torch.stack(
        [
            buffers.f0.mean(dim=-1),
            buffers.roughness,
            buffers.normal.mean(dim=-1),
            depth_normal.mean(dim=-1),
        ],
        dim=-1,
    )
    guide, total = shot.photograph.encoded.mean(dim=-1), torch.zeros(())
    for axis in (0, 1):
        length = shot.glossy.shape[axis] - 1
        glossy = shot.glossy.narrow(axis, 0, length) * shot.glossy.narrow(axis, 1, length)
        edge = glossy * torch.exp(-_SOBEL * guide.diff(dim=axis).abs())
        total = total + (layers.diff(dim=axis).abs() * edge[..., None]).sum(dim=-1).mean()
    return total
