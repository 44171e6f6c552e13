# SPDX-License-Identifier: Apache-2.0
"""Losses, stage by stage."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
import torch

from graycard import Camera, Capture
from graycard.io import Room
from graycard.methods.splat import (
    CENTRES,
    LossResult,
    Maps,
    depth_normal_map,
    depth_to_normals,
    image_radius,
    l1_map,
    no_offsets,
    photometric_map,
    view_at,
)
from graycard.methods.sunfaded._guess import GeometryGuess
from graycard.methods.sunfaded._model import albedo_of, draw, picture_of, unlit_picture
from graycard.methods.sunfaded._schedule import FitStage, adds_surfels, stage_at
from graycard.methods.sunfaded._settings import Space, SunFadedSettings
from graycard.methods.sunfaded._tiles import lens_of
from graycard.methods.sunfaded._weight import unlit_weight
from graycard.methods.surfels import srgb_encode_tensor


@dataclass(frozen=True, eq=False)
class DisplayedPhotograph:
    """A training view as a fit looks at it."""

    camera: Camera
    shown: torch.Tensor
    """Shape ``(H, W, 3)``: exposed and encoded for a display."""
    weight: torch.Tensor
    """Shape ``(H, W, 1)``: of the pixel in the first stage."""
    lens: torch.Tensor
    """Shape ``(H, W, 3)``: of its pixels, see :func:`lens_of`."""


def photographs(capture: Capture, settings: SunFadedSettings) -> list[DisplayedPhotograph]:
    """Return the training views, exposed, encoded and weighted."""
    found = []
    with Room() as room:
        for view in capture.train:
            exposed = np.asarray(capture.photograph(view), np.float32) * np.float32(capture.exposure)
            shown = srgb_encode_tensor(torch.from_numpy(exposed))
            linear = settings.space == "linear" and settings.weight == "log_minmax"
            picture = exposed if linear else shown.numpy()
            weight = torch.from_numpy(unlit_weight(picture, settings))[..., None]
            found.append(room.keep(DisplayedPhotograph(view.camera, shown, weight, lens_of(view.camera))))
    return found


def displayed(picture: torch.Tensor, space: Space) -> torch.Tensor:
    """Picture as displayed, from the space of the fit."""
    return srgb_encode_tensor(picture) if space == "linear" else picture


@dataclass(frozen=True, eq=False)
class SunFadedObjective:
    """The loss of one view a step, each view once in a round, in an order that the seed decides."""

    views: Sequence[DisplayedPhotograph]
    guesses: Sequence[GeometryGuess]
    """One a view."""
    settings: SunFadedSettings
    seed: int
    _kept: dict[int, Maps] = field(default_factory=dict, init=False, repr=False)
    """Drawn layers of surfels that stand still, by the number of the view."""
    _room: Room = field(default_factory=Room, init=False, repr=False)

    def __call__(self, values: Mapping[str, torch.Tensor], step: int) -> LossResult:
        """Return the loss of a step, with what else the fit is told."""
        share = step / self.settings.iterations
        number = view_at(step, len(self.views), self.seed)
        stage = stage_at(share, self.settings.schedule)
        if stage is FitStage.LAMP:
            return LossResult(self._lit_loss(values, self._still(values, number), number))
        view = self.views[number]
        offsets = None
        if adds_surfels(stage, self.settings.schedule):
            offsets = no_offsets(values[CENTRES])
        drawn = draw(values, view.camera, self.settings, offsets)
        if stage is FitStage.UNLIT and self.settings.ambient:
            loss = self._unlit_loss(values, drawn, number)
        else:
            loss = self._lit_loss(values, drawn, number)
        loss = loss + self._geometry_loss(drawn, number, share)
        loss = loss + self.settings.cover_weight * (1 - drawn.alpha).mean()
        loss = loss + self.settings.albedo_weight * albedo_of(values).var(dim=0, correction=0).mean()
        if offsets is None:
            return LossResult(loss)
        size = view.camera.width, view.camera.height
        return LossResult(loss, offsets, image_radius(values, view.camera), size)

    def _still(self, values: Mapping[str, torch.Tensor], number: int) -> Maps:
        """Surfels of the second stage: nothing of them moves, so each view is drawn once.

        Not so with light on surfels, which is drawn with them.
        """
        view = self.views[number]
        if self.settings.shading == "surfel":
            return draw(values, view.camera, self.settings)
        if number not in self._kept:
            with torch.no_grad():
                self._kept[number] = self._room.keep(draw(values, view.camera, self.settings))
        return self._kept[number]

    def _unlit_loss(self, values: Mapping[str, torch.Tensor], drawn: Maps, number: int) -> torch.Tensor:
        view, settings = self.views[number], self.settings
        picture = displayed(unlit_picture(drawn, values), settings.space)
        return settings.unlit_weight * (view.weight * l1_map(picture, view.shown)).mean()

    def _lit_loss(self, values: Mapping[str, torch.Tensor], drawn: Maps, number: int) -> torch.Tensor:
        view, settings = self.views[number], self.settings
        picture = picture_of(drawn, values, view.camera, view.lens, settings).whole
        shown = displayed(picture, settings.space)
        if settings.ssim_share == 0:
            return l1_map(shown, view.shown).mean()
        return photometric_map(shown, view.shown, settings.ssim_share).mean()

    def _geometry_loss(self, drawn: Maps, number: int, share: float) -> torch.Tensor:
        """Surfels that do not agree with each other, and with what the prior says."""
        settings, guess, camera = self.settings, self.guesses[number], self.views[number].camera
        loss = torch.zeros(())
        stage = stage_at(share, settings.schedule)
        if guess.depth is not None and _asks_for_depth(stage, settings):
            loss = loss + settings.depth_weight * (1 - correlation(drawn.depth, guess.depth, drawn.alpha))
        if share < settings.geometry_start:
            return loss
        own = depth_normal_map(drawn.depth, drawn.normal, drawn.alpha, camera).mean()
        loss = loss + settings.distortion_weight * drawn.distortion.mean() + settings.normal_weight / 2 * own
        if guess.normal is None:
            return loss
        agreement = (depth_to_normals(drawn.depth, camera) * guess.normal).sum(dim=-1)
        return loss + settings.normal_weight / 2 * (1 - agreement).mean()


def _asks_for_depth(stage: FitStage, settings: SunFadedSettings) -> bool:
    """In the first stage and the last ones; in the released code in the first alone."""
    return stage is FitStage.UNLIT or (settings.geometry_prior != "release" and stage >= FitStage.OPACITY)


def correlation(depth: torch.Tensor, guess: torch.Tensor, alpha: torch.Tensor) -> torch.Tensor:
    """Pearson's correlation of two depths over the pixels that surfels cover and the guess knows, in [-1, 1].

    Args:
        depth: Shape ``(H, W)``, metres.
        guess: Shape ``(H, W)``; finite where it knows.
        alpha: Shape ``(H, W)``: covered where above one half.
    """
    known = (alpha > 0.5) & torch.isfinite(guess)
    if not bool(known.any()):
        return depth.sum() * 0 + 1
    mine, other = depth[known] - depth[known].mean(), guess[known] - guess[known].mean()
    return (mine * other).sum() / (mine.norm() * other.norm()).clamp(min=1e-12)
