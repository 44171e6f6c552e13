# SPDX-License-Identifier: Apache-2.0
"""``r3dg``: Relightable 3D Gaussians (Gao et al., ECCV 2024) on the surfels of this package."""

from pathlib import Path

import numpy as np
import torch

from graycard import Capture, Progress
from graycard.methods._contract import Priors
from graycard.methods.r3dg._light import BASE_COLOR, DEGREE, OWN, ROUGHNESS, SKY, directions_of
from graycard.methods.r3dg._objective import Objective, Shot, shot_of
from graycard.methods.r3dg._scene import R3dgScene, load_scene
from graycard.methods.r3dg._settings import R3dgSettings
from graycard.methods.splat import (
    GEOMETRY,
    Parameters,
    Plan,
    Rate,
    coefficient_count,
    initial_state,
    scene_extent,
    surfels_of,
    train,
)
from graycard.methods.surfels import (
    SurfelSettings,
    check_photographs,
    check_places,
    decode,
    density_rules,
    fit_surfels,
    photographs,
    sparse_start,
)

ALBEDO = 0.5
"""Base colour and roughness before the second stage (inferred)."""
_DARKEST = 1e-3
"""Of the sky before it: the logarithm of black is infinite."""


class R3dgMethod:
    """Surfels that are shaded one by one, each with incident light of its own, without a prior."""

    summary = "surfels shaded one by one, each with incident light of its own (Relightable 3D Gaussians)"
    needs = ()
    kernels = ("maps 3", "features 16", "photometric", "trace")
    settings_type = R3dgSettings

    def fit(
        self, capture: Capture, priors: Priors, settings: R3dgSettings, seed: int, progress: Progress
    ) -> R3dgScene:
        """Fit surfels, then materials and light on them, to the training photographs.

        Surfels stand still in the second stage, as in the paper's code: rays between them are traced once.

        Raises:
            MethodError: All views are from one place, photographs are black or not finite, there are too
                few sparse points, or the fit has no way on.
        """
        check_places(capture)
        check_photographs(capture)
        surface = SurfelSettings(
            iterations=settings.geometry_steps, surfels=settings.surfels, fill=settings.fill
        )
        rules, start = density_rules(settings.surfels), sparse_start(capture, surface, seed)
        geometry = fit_surfels("r3dg", capture, surface, seed, progress, start=start, rules=rules)
        surfels = surfels_of(geometry.surfels)
        extent = scene_extent([view.camera for view in capture.train])
        eyes = torch.tensor(np.array([view.camera.position for view in capture.train])).float()
        directions = directions_of(surfels, eyes, extent)
        views = photographs(capture, surface)
        shots = [shot_of(view.camera, view.encoded, geometry.surfels) for view in views]
        first = Parameters(
            {name: geometry.surfels[name] for name in GEOMETRY} | first_surfaces(len(surfels)),
            {SKY: first_sky(shots, settings)},
        )
        steps = settings.iterations - settings.geometry_steps
        objective = Objective(shots, directions, settings, settings.geometry_steps, seed)
        found = train(initial_state(first, seed), Plan(steps, learning_rates(), extent), objective, progress)
        return R3dgScene(found.parameters, directions, settings, capture.exposure, extent)

    def load(self, folder: Path) -> R3dgScene:
        """A saved decomposition.

        Raises:
            MethodError: It is missing, damaged, or of another method.
        """
        return load_scene(folder)


def learning_rates() -> dict[str, Rate]:
    """By the names of parameters (paper's code: 0.01, and 0.1 of the environment, for 20 000 steps; the rest
    is inferred, for some hundreds).
    """
    return {
        BASE_COLOR: Rate(2e-2, 5e-3),
        ROUGHNESS: Rate(1e-2, 5e-3),
        OWN: Rate(1e-2, 2e-3),
        SKY: Rate(5e-2, 1e-2),
    }


def first_surfaces(count: int) -> dict[str, torch.Tensor]:
    """Parameters of so many surfels before the second stage: a little light of their own, alike all round,
    since light that is cut off at 0 could not grow.
    """
    own = torch.zeros(count, coefficient_count(DEGREE), 3)
    own[:, 0] = 0.1
    half = torch.logit(torch.tensor(ALBEDO))
    return {BASE_COLOR: half.expand(count, 3).clone(), ROUGHNESS: half.expand(count, 1).clone(), OWN: own}


def first_sky(shots: list[Shot], settings: R3dgSettings) -> torch.Tensor:
    """An even one that would make surfaces of that albedo as bright as the photographs."""
    mean = torch.stack([decode(shot.shown).mean(dim=(0, 1)) for shot in shots]).mean(dim=0)
    size = settings.sky_size
    return (mean / ALBEDO).clamp(min=_DARKEST).log().expand(6, size, size, 3).clone()
