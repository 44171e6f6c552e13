# SPDX-License-Identifier: Apache-2.0
"""Loss of the second stage: how far shaded layers are from the photographs and from the prior."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, fields

import numpy as np
import torch

from graycard import Camera, Capture
from graycard.io import Room
from graycard.methods.gsid._draw import draw, draw_whole
from graycard.methods.gsid._geometry import agreement
from graycard.methods.gsid._guess import MaterialGuess
from graycard.methods.gsid._lights import lamps_from, sky_from
from graycard.methods.gsid._model import (
    Ground,
    LitPicture,
    Pixels,
    Reach,
    ground_of,
    pixels_of,
    seen_anew,
)
from graycard.methods.gsid._settings import GsidSettings
from graycard.methods.shading import (
    Lamps,
    Surroundings,
    surroundings_of,
    unevenness,
    unevenness_but_for_edges,
)
from graycard.methods.splat import LossResult, Surfels, Window, photometric_map, view_at
from graycard.methods.surfels import srgb_encode_tensor


@dataclass(frozen=True, eq=False)
class DeferredView:
    """A training view as the second stage looks at it."""

    linear: torch.Tensor
    """Shape ``(H, W, 3)``: radiance times exposure."""
    shown: torch.Tensor
    """The same, encoded for a display."""
    ground: Ground
    """Surfaces as the second stage finds them; where surfels move, steps draw them anew."""
    guess: MaterialGuess

    def at(self, window: Window) -> "DeferredView":
        """Return a part of the view."""
        layers = (getattr(self.guess, field.name) for field in fields(MaterialGuess))
        guess = MaterialGuess(*(None if layer is None else window.of(layer) for layer in layers))
        return DeferredView(window.of(self.linear), window.of(self.shown), self.ground.at(window), guess)

    def at_half_size(self, surfels: Surfels, occlusion: torch.Tensor, times: int = 1) -> "DeferredView":
        """Return the view at half its width and height.

        Args:
            surfels: What it shows.
            occlusion: Shape ``(N,)``, see :func:`ground_of`.
            times: How often it is halved, 1 or more.
        """
        camera, linear = self.ground.camera, self.linear
        layers = [getattr(self.guess, field.name) for field in fields(MaterialGuess)]
        for _ in range(times):
            size, half = (camera.width // 2, camera.height // 2), np.diag([0.5, 0.5, 1]) @ camera.K
            camera, linear = Camera(*size, half, camera.camera_to_world), _halved(linear)
            layers = [None if layer is None else _halved(layer) for layer in layers]
        ground = ground_of(surfels, camera, occlusion)
        return DeferredView(linear, srgb_encode_tensor(linear), ground, MaterialGuess(*layers))


def _halved(image: torch.Tensor) -> torch.Tensor:
    """Means of 2 x 2 pixels of an image of shape ``(H, W, ...)``."""
    channels = image.reshape(*image.shape[:2], -1).permute(2, 0, 1)
    mean = torch.nn.functional.avg_pool2d(channels[None], 2)[0].permute(1, 2, 0)
    return mean.reshape(*mean.shape[:2], *image.shape[2:])


def deferred_views(
    capture: Capture, grounds: Iterable[Ground], guesses: Sequence[MaterialGuess]
) -> list[DeferredView]:
    """Return the training views, exposed."""
    found = []
    with Room() as room:
        for view, ground, guess in zip(capture.train, grounds, guesses, strict=True):
            linear = torch.from_numpy(capture.photograph(view).astype("float32") * capture.exposure).float()
            kept = room.keep((linear, srgb_encode_tensor(linear), ground))
            found.append(DeferredView(*kept, guess))
    return found


@dataclass(eq=False)
class Surfaces:
    """Surfaces of tiles for trials that change lights alone: each is drawn once, without gradient."""

    room: Room = field(default_factory=Room)
    drawn: dict[int, tuple[Ground, Pixels]] = field(default_factory=dict)

    def of(self, number: int, draw: Callable[[], tuple[Ground, Pixels]]) -> tuple[Ground, Pixels]:
        """Return the surfaces of a tile."""
        if number not in self.drawn:
            self.drawn[number] = self.room.keep(draw())
        return self.drawn[number]


@dataclass(frozen=True, eq=False)
class GsidObjective:
    """The loss of one tile of one view a step. In a round each tile of each view has its turn once."""

    shots: Sequence[DeferredView]
    """Tiles of all views."""
    reach: Sequence[Reach]
    """One a tile."""
    settings: GsidSettings
    extent: float
    seed: int
    surfaces: Surfaces | None = None
    """Surfaces of all tiles, for the same surfels; None: they are drawn whenever they are looked at."""

    def __call__(self, values: Mapping[str, torch.Tensor], step: int) -> LossResult:
        """Return the loss of a step, with what else the fit is told."""
        return LossResult(self.loss(values, view_at(step, len(self.shots), self.seed)))

    @torch.no_grad()
    def over_all(self, values: Mapping[str, torch.Tensor]) -> float:
        """Return the loss over all pixels of all views, mean of the tiles'."""
        return float(np.mean([float(self.loss(values, number)) for number in range(len(self.shots))]))

    def loss(self, values: Mapping[str, torch.Tensor], number: int) -> torch.Tensor:
        """Return the loss of a tile."""
        shot, settings = self.shots[number], self.settings
        ground, pixels = self._seen(values, number)
        lights, reach = _lights_in(values), self.reach[number]
        picture = draw_whole(values, ground, lights, reach, settings, self.extent, pixels=pixels)
        loss = photometric_map(srgb_encode_tensor(picture.whole), shot.shown, settings.ssim_share).mean()
        loss = loss + prior_loss(pixels, shot, settings)
        if settings.geometry_rate > 0:
            loss = loss + agreement(ground.drawn, ground.camera, shot.guess.normal, settings)
        if settings.smooth_weight > 0:
            loss = loss + settings.smooth_weight * unevenness_but_for_edges(
                material_image(pixels), shot.shown, squared=True
            )
        material = pixels.material
        loss = loss + settings.matte_weight * (1 - material.roughness + material.metallic).mean()
        loss = loss + settings.lamp_weight * few(picture.given)
        return loss + settings.sky_weight * unevenness(sky_from(values))

    @torch.no_grad()
    def picture(self, values: Mapping[str, torch.Tensor], number: int) -> LitPicture:
        """Return a tile under the lights."""
        ground, pixels = self._seen(values, number)
        return draw(
            values, ground, _lights_in(values), self.reach[number], self.settings, self.extent, pixels=pixels
        )

    def _seen(self, values: Mapping[str, torch.Tensor], number: int) -> tuple[Ground, Pixels]:
        """Surfaces of a tile."""
        if self.surfaces is None:
            return self._drawn(values, self.shots[number])
        return self.surfaces.of(number, lambda: self._drawn(values, self.shots[number]))

    def _drawn(self, values: Mapping[str, torch.Tensor], shot: DeferredView) -> tuple[Ground, Pixels]:
        """Surfaces of a tile, drawn anew where they move."""
        if self.settings.geometry_rate > 0:
            return seen_anew(values, shot.ground.camera)
        return shot.ground, pixels_of(values, shot.ground)


def _lights_in(values: Mapping[str, torch.Tensor]) -> tuple[Lamps, Surroundings]:
    return lamps_from(values), surroundings_of(sky_from(values))


def few(given: torch.Tensor) -> torch.Tensor:
    """Sum of the roots of what lamps give, mean irradiance ``(K,)``: less, where fewer give the same."""
    return (given + 1e-6).sqrt().sum()


def material_image(pixels: Pixels) -> torch.Tensor:
    """Return base colour, roughness and metallic of a view, shape ``(H, W, 5)``."""
    material = pixels.material
    return torch.cat(
        [material.base_color, material.roughness[..., None], material.metallic[..., None]], dim=-1
    )


def prior_loss(pixels: Pixels, shot: DeferredView, settings: GsidSettings) -> torch.Tensor:
    """Weighted mean absolute differences to what the prior says, over what surfels cover."""
    material, guess, loss = pixels.material, shot.guess, torch.zeros(())
    cover = pixels.cover
    for mine, other, weight in (
        (material.base_color, guess.base_color, settings.base_color_weight),
        (material.roughness, guess.roughness, settings.roughness_weight),
        (material.metallic, guess.metallic, settings.metallic_weight),
    ):
        if other is not None:
            weighing = cover if mine.ndim == cover.ndim else cover[..., None]
            loss = loss + weight * (weighing * (mine - other).abs()).mean()
    return loss
