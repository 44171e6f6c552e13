# SPDX-License-Identifier: Apache-2.0
"""What the second stage lowers: how far shaded layers are from the photographs and from the prior."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import torch

from graycard import Capture
from graycard.methods.gsid._draw import draw
from graycard.methods.gsid._guess import MaterialGuess
from graycard.methods.gsid._lights import lamps_from, sky_from
from graycard.methods.gsid._model import Ground, LitPicture, Pixels, Reach, picture_of, pixels_of
from graycard.methods.gsid._settings import GsidSettings
from graycard.methods.shading import surroundings_of, unevenness, unevenness_but_for_edges
from graycard.methods.splat import LossResult, view_at
from graycard.methods.surfels import srgb_encode_tensor


@dataclass(frozen=True, eq=False)
class DeferredView:
    """A training view as the second stage looks at it."""

    linear: torch.Tensor
    """Shape ``(H, W, 3)``: radiance times exposure."""
    shown: torch.Tensor
    """The same, encoded for a display."""
    ground: Ground
    guess: MaterialGuess


def deferred_views(
    capture: Capture, grounds: Sequence[Ground], guesses: Sequence[MaterialGuess]
) -> list[DeferredView]:
    """The training views, exposed."""
    found = []
    for view, ground, guess in zip(capture.train, grounds, guesses, strict=True):
        linear = torch.from_numpy(capture.photograph(view).astype("float32") * capture.exposure).float()
        found.append(DeferredView(linear, srgb_encode_tensor(linear), ground, guess))
    return found


@dataclass(frozen=True, eq=False)
class GsidObjective:
    """The loss of one view a step."""

    shots: Sequence[DeferredView]
    reach: Sequence[Reach]
    """One a view."""
    settings: GsidSettings
    extent: float
    seed: int

    def __call__(self, values: Mapping[str, torch.Tensor], step: int) -> LossResult:
        """What is to be lowered at a step."""
        number, settings = view_at(step, len(self.shots), self.seed), self.settings
        shot, sky = self.shots[number], sky_from(values)
        whole = pixels_of(values, shot.ground)
        rows = self._rows(shot, step)
        picture = self._picture(values, whole, rows, number)
        loss = (srgb_encode_tensor(picture.whole) - shot.shown.flatten(0, 1)[rows]).abs().mean()
        loss = loss + prior_loss(whole, shot, settings)
        if settings.smooth_weight > 0:
            loss = loss + settings.smooth_weight * unevenness_but_for_edges(
                material_image(whole), shot.shown, squared=True
            )
        loss = loss + settings.matte_weight * (1 - whole.material.roughness + whole.material.metallic).mean()
        loss = loss + settings.lamp_weight * few(picture.irradiance)
        return LossResult(loss + settings.sky_weight * unevenness(sky))

    def _picture(
        self, values: Mapping[str, torch.Tensor], whole: Pixels, rows: torch.Tensor, number: int
    ) -> LitPicture:
        """Some pixels of a view under the lights, row by row."""
        lights = lamps_from(values), surroundings_of(sky_from(values))
        reach, settings = self.reach[number], self.settings
        if settings.shading == "deferred":
            return picture_of(whole.at(rows), *lights, reach.at(rows), settings.visibility, self.extent)
        return draw(values, self.shots[number].ground, lights, reach, settings, self.extent).at(rows)

    def _rows(self, shot: DeferredView, step: int) -> torch.Tensor:
        """Pixels that are shaded at a step, as the seed decides."""
        count = shot.shown.shape[0] * shot.shown.shape[1]
        random = np.random.default_rng([self.seed, step])
        return torch.from_numpy(random.permutation(count)[: max(1, round(self.settings.pixels * count))])


def few(irradiance: torch.Tensor) -> torch.Tensor:
    """Sum of the square roots of what lamps give, ``(..., K, 3)``: less, where fewer lamps give the same."""
    given = irradiance.flatten(0, -3).mean(dim=(0, 2))
    return (given + 1e-6).sqrt().sum()


def material_image(pixels: Pixels) -> torch.Tensor:
    """Base colour, roughness and metallic of a view, shape ``(H, W, 5)``."""
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
