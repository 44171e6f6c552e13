# SPDX-License-Identifier: Apache-2.0
"""``sunfaded``: take the lamp on the camera out of photographs of dark places (Chang et al., CVPR 2026)."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import torch

from graycard import Capture, Progress
from graycard.methods._contract import Priors
from graycard.methods.splat import Parameters, Plan, initial_state, scene_extent, train
from graycard.methods.sunfaded._guess import (
    GEOMETRY_ASKS,
    Guess,
    drawn_albedos,
    exposed_photographs,
    guesses,
)
from graycard.methods.sunfaded._layers import Lighting
from graycard.methods.sunfaded._model import draw
from graycard.methods.sunfaded._objective import Objective, Photograph, photographs
from graycard.methods.sunfaded._scene import METHOD, SunFadedScene, load_scene
from graycard.methods.sunfaded._schedule import ENDS, Stage, density_rules, learning_rates
from graycard.methods.sunfaded._settings import SunFadedSettings
from graycard.methods.sunfaded._start import check_capture, start
from graycard.methods.surfels import check_checkpoint, fit_checkpoint


class SunFadedMethod:
    """Surfels with an albedo under a light that stays and a lamp that moves with the camera."""

    summary = "surfels with albedo, ambient light and a learnt lamp on the camera (SunFaded)"
    needs = ()
    kernels = ("maps 3", "maps 8", "photometric", "depth normal")
    asks = GEOMETRY_ASKS
    settings_type = SunFadedSettings

    def fit(
        self, capture: Capture, priors: Priors, settings: SunFadedSettings, seed: int, progress: Progress
    ) -> SunFadedScene:
        """Fit surfels and both lights to the training photographs.

        Raises:
            MethodError: The light is not on the camera, the photographs are black or not finite, there are
                too few sparse points, an answer of the prior is not sound, or the fit has no way on.
        """
        check_capture(capture)
        check_checkpoint(METHOD, settings, seed)
        views = photographs(capture, settings)
        parameters = _fitted(capture, priors, views, settings, seed, progress)
        reach = _reach(parameters, views, settings)
        return SunFadedScene(parameters, Lighting(settings, capture.exposure, reach))

    def load(self, folder: Path) -> SunFadedScene:
        """A saved decomposition.

        Raises:
            MethodError: It is missing, damaged, or of another method.
        """
        return load_scene(folder)


def _fitted(
    capture: Capture,
    priors: Priors,
    views: Sequence[Photograph],
    settings: SunFadedSettings,
    seed: int,
    progress: Progress,
) -> Parameters:
    """All stages; before the fourth the prior is asked anew, with the albedo.

    A fit that was cut off after that finds what the third stage left in a file of its own: so the prior is
    asked with the same images again.
    """
    asked = settings.geometry_prior != "none" and bool(priors.kinds & {"depth", "normal"})
    lit = guesses(capture, priors, exposed_photographs(capture)) if asked else [Guess()] * len(views)
    state = initial_state(start(capture, views, settings, seed), seed)
    plan = _plan(capture, views, lit, settings, seed)
    objective = Objective(views, lit, settings, seed)
    if asked and settings.geometry_prior == "albedo":
        until = max(1, round(ENDS[settings.schedule][Stage.JOINT] * settings.iterations))
        first = replace(plan, until=until, checkpoint=plan.checkpoint and plan.checkpoint.beside("lit"))
        state = train(state, first, objective, progress)
        albedos = drawn_albedos(capture, state.parameters.all, settings)
        objective = replace(objective, guesses=guesses(capture, priors, albedos))
    return train(state, plan, objective, progress).parameters


def _plan(
    capture: Capture, views: Sequence[Photograph], lit: Sequence[Guess], settings: SunFadedSettings, seed: int
) -> Plan:
    extent = scene_extent([view.camera for view in capture.train])
    fitted = [
        (view.camera, picture)
        for view, guess in zip(views, lit, strict=True)
        for picture in (view.shown, guess.depth, guess.normal)
        if picture is not None
    ]
    checkpoint = fit_checkpoint(METHOD, settings, seed, fitted)
    rates = learning_rates(extent, settings)
    return Plan(settings.iterations, rates, extent, density_rules(settings), checkpoint)


@torch.no_grad()
def _reach(parameters: Parameters, views: Sequence[Photograph], settings: SunFadedSettings) -> float:
    """The median over views of the depth in the middle of the picture, metres."""
    middles = []
    for view in views:
        depth = draw(parameters.all, view.camera, settings).depth
        middles.append(depth[view.camera.height // 2, view.camera.width // 2])
    return float(torch.stack(middles).median())
