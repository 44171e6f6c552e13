# SPDX-License-Identifier: Apache-2.0
"""``r3dg``: Relightable 3D Gaussians (Gao et al., ECCV 2024) on the surfels of this package."""

import numpy as np
import torch

from graycard.methods.r3dg._light import BASE_COLOR, DEGREE, OWN, ROUGHNESS, SKY, Directions, directions_of
from graycard.methods.r3dg._objective import ForwardView, R3dgObjective, forward_views
from graycard.methods.r3dg._scene import METHOD, R3dgScene
from graycard.methods.r3dg._settings import R3dgSettings
from graycard.methods.splat import (
    GEOMETRY,
    LearningRateSchedule,
    Parameters,
    coefficient_count,
    surfels_of,
)
from graycard.methods.surfels import (
    FitTask,
    SceneMethod,
    SurfelSettings,
    check_photographs,
    check_places,
    density_rules,
    fit_surfels,
    photographs,
    sparse_start,
    srgb_decode_tensor,
)

ALBEDO = 0.5
"""Base colour and roughness before the second stage (inferred)."""
_DARKEST = 1e-3
"""Floor of the sky before it: the logarithm of black is infinite."""


class R3dgMethod(SceneMethod[R3dgSettings, R3dgScene]):
    """Surfels that are shaded one by one, each with incident light of its own, without a prior."""

    name = METHOD
    summary = "surfels shaded one by one, each with incident light of its own (Relightable 3D Gaussians)"
    kernels = ("maps 3", "features 16", "photometric", "trace", "Adam")
    settings_type = R3dgSettings
    scene_type = R3dgScene
    checks = (check_places, check_photographs)

    def _fitted(self, task: FitTask[R3dgSettings]) -> R3dgScene:
        """Fit surfels, then materials and light on them.

        Surfels stand still in the second stage, as in the paper's code: rays between them are traced once.
        """
        settings, extent = task.settings, task.extent
        surface = SurfelSettings(
            iterations=settings.geometry_steps,
            surfels=settings.surfels,
            fill=settings.fill,
            backend=settings.backend,
        )
        rules, start = density_rules(settings.surfels), sparse_start(task.capture, surface, task.seed)
        geometry = fit_surfels(METHOD, task.with_settings(surface), start=start, rules=rules)
        eyes = torch.tensor(np.array([view.camera.position for view in task.capture.train])).float()
        directions = directions_of(surfels_of(geometry.surfels), eyes, extent)
        views = photographs(task.capture, surface)
        shots = forward_views(views, geometry.surfels)
        found = _fit_light(task, geometry, shots, directions)
        return R3dgScene(found, directions, settings, task.capture.exposure, extent)


def _fit_light(
    task: FitTask[R3dgSettings], geometry: Parameters, shots: list[ForwardView], directions: Directions
) -> Parameters:
    """Fit materials and light on surfels that stand still."""
    settings = task.settings
    surfaces = {name: geometry.surfels[name] for name in GEOMETRY} | first_surfaces(len(geometry))
    start = Parameters(surfaces, {SKY: first_sky(shots, settings)})
    objective = R3dgObjective(shots, directions, settings, settings.geometry_steps, task.seed)
    steps = settings.iterations - settings.geometry_steps
    return task.train(start, task.config(steps, learning_rates()), objective)


def learning_rates() -> dict[str, LearningRateSchedule]:
    """By the names of parameters (paper's code: 0.01, and 0.1 of the environment, for 20 000 steps; the rest
    is inferred, for some hundreds).
    """
    return {
        BASE_COLOR: LearningRateSchedule(2e-2, 5e-3),
        ROUGHNESS: LearningRateSchedule(1e-2, 5e-3),
        OWN: LearningRateSchedule(1e-2, 2e-3),
        SKY: LearningRateSchedule(5e-2, 1e-2),
    }


def first_surfaces(count: int) -> dict[str, torch.Tensor]:
    """Parameters of so many surfels before the second stage: a little light of their own, alike all round,
    since light that is cut off at 0 could not grow.
    """
    own = torch.zeros(count, coefficient_count(DEGREE), 3)
    own[:, 0] = 0.1
    half = torch.logit(torch.tensor(ALBEDO))
    return {BASE_COLOR: half.expand(count, 3).clone(), ROUGHNESS: half.expand(count, 1).clone(), OWN: own}


def first_sky(shots: list[ForwardView], settings: R3dgSettings) -> torch.Tensor:
    """Return an even one that would make surfaces of that albedo as bright as the photographs."""
    mean = torch.stack([srgb_decode_tensor(shot.shown).mean(dim=(0, 1)) for shot in shots]).mean(dim=0)
    size = settings.sky_size
    return (mean / ALBEDO).clamp(min=_DARKEST).log().expand(6, size, size, 3).clone()
