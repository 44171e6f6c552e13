# SPDX-License-Identifier: Apache-2.0
"""``darkgs``: an albedo for each surfel under a lamp that was calibrated before (Zhang et al., IROS 2024)."""

import torch

from graycard import Capture
from graycard.methods._contract import Ask
from graycard.methods.darkgs._calibration import fit_profile, photograph_board
from graycard.methods.darkgs._lamp import MeasuredLamp
from graycard.methods.darkgs._model import AMBIENT, NORMALS, PAINT
from graycard.methods.darkgs._objective import DarkGsObjective, photographs
from graycard.methods.darkgs._scene import METHOD, DarkGsScene
from graycard.methods.darkgs._settings import DarkGsSettings
from graycard.methods.splat import LearningRateSchedule, Parameters, parameters_of, rotation_matrices
from graycard.methods.surfels import (
    FitTask,
    SceneMethod,
    check_checkpoint,
    check_lamp_on_camera,
    check_photographs,
    check_places,
    density_rules,
    fit_checkpoint,
    geometry_rates,
    sparse_discs,
)

MIDDLE_GRAY = 0.18
"""Albedo of all surfels at the start: how bright they are in photographs is the lamp's doing."""
AMBIENT_START = 0.1
"""Exposed radiance over albedo of the light that stays, at the start; its logarithm is fitted."""


class DarkGsMethod(SceneMethod[DarkGsSettings, DarkGsScene]):
    """Surfels with an albedo and a normal for shading, each shaded under a lamp whose calibration is told."""

    name = METHOD
    summary = "surfels with albedo, each shaded under a calibrated lamp on the camera (as DarkGS)"
    kernels = ("maps 3", "Adam")
    asks = (Ask("light"),)
    settings_type = DarkGsSettings
    scene_type = DarkGsScene
    checks = (check_lamp_on_camera, check_places, check_photographs)

    def _fitted(self, task: FitTask[DarkGsSettings]) -> DarkGsScene:
        capture, settings, lamp = task.capture, task.settings, task.priors.light()
        fit_name = f"{METHOD} {lamp}"
        check_checkpoint(fit_name, settings, task.seed)
        views = photographs(capture)
        pictures = [(view.camera, view.exposed) for view in views]
        checkpoint = fit_checkpoint(fit_name, settings, task.seed, pictures)
        rates, rules = learning_rates(task.extent), density_rules(settings.surfels)
        config = task.config(settings.iterations, rates, rules, checkpoint)
        profile = fit_profile(lamp, photograph_board(lamp)) if settings.beam == "measured" else None
        source = lamp if profile is None else MeasuredLamp(lamp, profile)
        objective = DarkGsObjective(views, source, capture.exposure, settings, task.seed)
        parameters = task.train(start(capture, settings, task.seed), config, objective)
        return DarkGsScene(parameters, lamp, capture.exposure, (lamp,), profile=profile)


def start(capture: Capture, settings: DarkGsSettings, seed: int) -> Parameters:
    """Parameters before the first step.

    Normals for shading begin as those of the discs, which face the cameras: those that turn away from the
    lamp have no gradient, and never come back.

    Raises:
        MethodError: There are too few sparse points.
    """
    discs = sparse_discs(capture, settings.surfels, settings.fill, seed)
    paint = torch.full((len(discs), 3), MIDDLE_GRAY).expm1().log()
    normals = rotation_matrices(discs.rotations)[:, :, 2].clone()
    own = {NORMALS: normals} if settings.normals == "own" else {}
    shared = {AMBIENT: torch.full((3,), AMBIENT_START).log()}
    return parameters_of(discs, {PAINT: paint, **own}, shared)


def learning_rates(extent: float) -> dict[str, LearningRateSchedule]:
    """Learning rates by the names of parameters, for a scene of an extent in metres.

    Those of the geometry are those of ``2dgs``. The lamp has none: it is as it was calibrated.
    """
    return {
        **geometry_rates(extent),
        PAINT: LearningRateSchedule(2e-2),
        NORMALS: LearningRateSchedule(5e-3),
        AMBIENT: LearningRateSchedule(1e-2),
    }
