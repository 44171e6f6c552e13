# SPDX-License-Identifier: Apache-2.0
"""``sunfaded``: take the lamp on the camera out of photographs of dark places (Chang et al., CVPR 2026)."""

from collections.abc import Sequence
from pathlib import Path

import torch

from graycard import Capture, Progress
from graycard.methods._contract import Priors
from graycard.methods.splat import Parameters, Plan, initial_state, scene_extent, train
from graycard.methods.sunfaded._guess import NO_GUESS
from graycard.methods.sunfaded._model import draw
from graycard.methods.sunfaded._objective import Objective, Photograph, photographs
from graycard.methods.sunfaded._scene import METHOD, SunFadedScene, load_scene
from graycard.methods.sunfaded._schedule import density_rules, learning_rates
from graycard.methods.sunfaded._settings import SunFadedSettings
from graycard.methods.sunfaded._start import check_capture, start
from graycard.methods.surfels import fit_checkpoint


class SunFadedMethod:
    """Surfels with an albedo under a light that stays and a lamp that moves with the camera."""

    summary = "surfels with albedo, ambient light and a learnt lamp on the camera (SunFaded)"
    needs = ()
    settings_type = SunFadedSettings

    def fit(
        self, capture: Capture, priors: Priors, settings: SunFadedSettings, seed: int, progress: Progress
    ) -> SunFadedScene:
        """Fit surfels and both lights to the training photographs.

        Raises:
            MethodError: The light is not on the camera, the photographs are black or not finite, there are
                too few sparse points, or the fit has no way on.
        """
        check_capture(capture)
        views = photographs(capture, settings)
        state = initial_state(start(capture, views, settings, seed), seed)
        plan = _plan(capture, views, settings, seed)
        guesses = [NO_GUESS] * len(views)
        parameters = train(state, plan, Objective(views, guesses, settings, seed), progress).parameters
        return SunFadedScene(parameters, settings, capture.exposure, _reach(parameters, views, settings))

    def load(self, folder: Path) -> SunFadedScene:
        """A saved decomposition.

        Raises:
            MethodError: It is missing, damaged, or of another method.
        """
        return load_scene(folder)


def _plan(capture: Capture, views: Sequence[Photograph], settings: SunFadedSettings, seed: int) -> Plan:
    extent = scene_extent([view.camera for view in capture.train])
    checkpoint = fit_checkpoint(METHOD, settings, seed, [(view.camera, view.shown) for view in views])
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
