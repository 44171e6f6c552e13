# SPDX-License-Identifier: Apache-2.0
"""The first stage: surfels with view-dependent colours, their normals beside those of a prior."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import torch

from graycard import Camera
from graycard.methods.gsid._guess import MaterialGuess
from graycard.methods.gsid._settings import GsidSettings
from graycard.methods.splat import (
    LossResult,
    Maps,
    Parameters,
    image_radius,
    no_offsets,
    photometric_map,
    rasterize,
    surfels_of,
    view_at,
)
from graycard.methods.surfels import (
    EncodedPhotograph,
    FitTask,
    SurfelSettings,
    colours,
    composed,
    density_rules,
    disagreement,
    learning_rates,
    photographs,
    sparse_start,
)

DEGREE = 2
"""Degree of the harmonics of the surfels' colours: highlights must not become holes."""
_DEGREE_EVERY = 1 / 10


def fit_geometry(task: FitTask[GsidSettings], guesses: Sequence[MaterialGuess]) -> Parameters:
    """Fit surfels that show the training photographs.

    Raises:
        MethodError: There are too few sparse points, or the fit has no way on.
    """
    settings, surface = task.settings, _surfel_settings(task.settings)
    views = photographs(task.capture, surface)
    rates, rules = learning_rates(task.extent, surface), density_rules(settings.surfels)
    config = task.config(settings.geometry_steps, rates, rules)
    objective = GeometryObjective(views, guesses, settings, task.seed)
    return task.train(sparse_start(task.capture, surface, task.seed), config, objective)


def _surfel_settings(settings: GsidSettings) -> SurfelSettings:
    return SurfelSettings(
        iterations=settings.geometry_steps,
        surfels=settings.surfels,
        fill=settings.fill,
        degree=DEGREE,
        backend=settings.backend,
    )


@dataclass(frozen=True, eq=False)
class GeometryObjective:
    """The loss of one view a step."""

    views: Sequence[EncodedPhotograph]
    guesses: Sequence[MaterialGuess]
    """One a view."""
    settings: GsidSettings
    seed: int

    def __call__(self, values: Mapping[str, torch.Tensor], step: int) -> LossResult:
        """Return the loss of a step, with what else the fit is told."""
        number, settings = view_at(step, len(self.views), self.seed), self.settings
        view, share = self.views[number], step / settings.geometry_steps
        seen = colours(values, view.camera.position, min(DEGREE, int(share / _DEGREE_EVERY)))
        offsets = no_offsets(seen)
        drawn = rasterize(surfels_of(values, seen), view.camera, offsets=offsets)
        picture = composed(drawn, view.sky, values)
        loss = photometric_map(picture, view.encoded, settings.ssim_share).mean()
        loss = loss + settings.cover_weight * (1 - drawn.alpha.mean())
        guess = self.guesses[number].normal
        if share >= settings.geometry_start:
            loss = loss + agreement(drawn, view.camera, guess, settings)
        elif guess is not None:
            loss = loss + settings.normal_prior_weight * normal_difference(drawn, guess)
        size = view.camera.width, view.camera.height
        return LossResult(loss, offsets, image_radius(values, view.camera), size)


def agreement(
    drawn: Maps, camera: Camera, guess: torch.Tensor | None, settings: GsidSettings
) -> torch.Tensor:
    """Return the weighted disagreement of surfels with each other, and with the normals of a prior.

    Args:
        drawn: A view.
        camera: It.
        guess: Shape ``(H, W, 3)``, see :func:`normal_difference`; None: there is none.
        settings: The weights.
    """
    loss = disagreement(drawn, camera, (settings.normal_weight, settings.distortion_weight))
    if guess is not None:
        loss = loss + settings.normal_prior_weight * normal_difference(drawn, guess)
    return loss


def normal_difference(drawn: Maps, guess: torch.Tensor) -> torch.Tensor:
    """Mean of 1 - cosine between drawn normals and a prior's, where the prior knows one.

    Args:
        drawn: A view.
        guess: Shape ``(H, W, 3)``, world, unit, or zero.
    """
    known = guess.square().sum(dim=-1) > 0.5
    cosine = (torch.nn.functional.normalize(drawn.normal, dim=-1, eps=1e-6) * guess).sum(dim=-1)
    return torch.where(known, drawn.alpha.detach() * (1 - cosine), 0.0).mean()
