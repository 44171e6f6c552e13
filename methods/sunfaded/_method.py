# SPDX-License-Identifier: Apache-2.0
"""``sunfaded``: take the lamp on the camera out of photographs of dark places (Chang et al., CVPR 2026)."""

from collections.abc import Sequence
from dataclasses import replace

import torch

from graycard.methods.splat import Parameters, TrainConfig, initial_state, train
from graycard.methods.sunfaded._clearing import clearing_of
from graycard.methods.sunfaded._guess import (
    GEOMETRY_ASKS,
    GeometryGuess,
    drawn_albedos,
    exposed_photographs,
    guesses,
)
from graycard.methods.sunfaded._layers import Lighting
from graycard.methods.sunfaded._model import draw
from graycard.methods.sunfaded._objective import DisplayedPhotograph, SunFadedObjective, photographs
from graycard.methods.sunfaded._scene import METHOD, SunFadedScene
from graycard.methods.sunfaded._schedule import ENDS, FitStage, density_rules, learning_rates
from graycard.methods.sunfaded._settings import SunFadedSettings
from graycard.methods.sunfaded._start import check_capture, start
from graycard.methods.surfels import (
    FitTask,
    SceneMethod,
    SweptDepth,
    check_checkpoint,
    fit_checkpoint,
    stereo_depths,
)


class SunFadedMethod(SceneMethod[SunFadedSettings, SunFadedScene]):
    """Surfels with an albedo under a light that stays and a lamp that moves with the camera."""

    name = METHOD
    summary = "surfels with albedo, ambient light and a learnt lamp on the camera (SunFaded)"
    kernels = ("maps 3", "maps 8", "photometric", "depth normal", "Adam")
    asks = GEOMETRY_ASKS
    settings_type = SunFadedSettings
    scene_type = SunFadedScene
    checks = (check_capture,)

    def _fitted(self, task: FitTask[SunFadedSettings]) -> SunFadedScene:
        check_checkpoint(METHOD, task.settings, task.seed)
        views = photographs(task.capture, task.settings)
        parameters = _staged_fit(task, views)
        reach = _reach(parameters, views, task.settings)
        return SunFadedScene(parameters, Lighting(task.settings, task.capture.exposure, reach))


def _staged_fit(task: FitTask[SunFadedSettings], views: Sequence[DisplayedPhotograph]) -> Parameters:
    """Fit all stages; before the fourth the prior is asked anew, with the albedo.

    A fit that was cut off after that finds what the third stage left in a file of its own: so the prior is
    asked with the same images again.
    """
    capture, priors, settings = task.capture, task.priors, task.settings
    asked = settings.geometry_prior != "none" and bool(priors.kinds & {"depth", "normal"})
    lit = guesses(capture, priors, exposed_photographs(capture)) if asked else [GeometryGuess()] * len(views)
    swept = stereo_depths(capture, capture.points(), task.seed) if settings.fill > 0 else None
    state = initial_state(start(capture, views, settings, task.seed, swept), task.seed)
    config = _train_config(task, views, lit, swept)
    objective = SunFadedObjective(views, lit, settings, task.seed)
    if asked and settings.geometry_prior == "albedo":
        until = max(1, round(ENDS[settings.schedule][FitStage.JOINT] * settings.iterations))
        first = replace(config, until=until, checkpoint=config.checkpoint and config.checkpoint.beside("lit"))
        state = train(state, first, objective, task.progress)
        albedos = drawn_albedos(capture, state.parameters.all, settings)
        objective = replace(objective, guesses=guesses(capture, priors, albedos))
    return train(state, config, objective, task.progress).parameters


def _train_config(
    task: FitTask[SunFadedSettings],
    views: Sequence[DisplayedPhotograph],
    lit: Sequence[GeometryGuess],
    swept: Sequence[SweptDepth] | None,
) -> TrainConfig:
    settings = task.settings
    fitted = [
        (view.camera, picture)
        for view, guess in zip(views, lit, strict=True)
        for picture in (view.shown, guess.depth, guess.normal)
        if picture is not None
    ]
    checkpoint = fit_checkpoint(METHOD, settings, task.seed, fitted)
    rates = learning_rates(task.extent, settings)
    clearing = clearing_of(task.capture, lit, settings.clearing, swept) if settings.clearing > 0 else None
    return task.config(settings.iterations, rates, density_rules(settings), checkpoint, clearing)


@torch.no_grad()
def _reach(parameters: Parameters, views: Sequence[DisplayedPhotograph], settings: SunFadedSettings) -> float:
    """Return the median over views of the depth in the middle of the picture, metres."""
    middles = []
    for view in views:
        depth = draw(parameters.all, view.camera, settings).depth
        middles.append(depth[view.camera.height // 2, view.camera.width // 2])
    return float(torch.stack(middles).median())
