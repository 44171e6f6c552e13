# SPDX-License-Identifier: Apache-2.0
"""``darkgs``: an albedo for each surfel under a lamp that was calibrated before (Zhang et al., IROS 2024)."""

from pathlib import Path

import torch

from graycard import Capture, Progress
from graycard.methods._contract import Ask, Priors
from graycard.methods.darkgs._model import AMBIENT, NORMALS, PAINT
from graycard.methods.darkgs._objective import Objective, photographs
from graycard.methods.darkgs._scene import METHOD, DarkGsScene, load_scene
from graycard.methods.darkgs._settings import DarkGsSettings
from graycard.methods.splat import (
    CENTRES,
    LOG_SCALES,
    LOGITS,
    ROTATIONS,
    Parameters,
    Plan,
    Rate,
    initial_state,
    parameters_of,
    rotation_matrices,
    scene_extent,
    train,
)
from graycard.methods.surfels import (
    check_checkpoint,
    check_lamp_on_camera,
    check_photographs,
    check_places,
    density_rules,
    fit_checkpoint,
    sparse_discs,
)

MIDDLE_GRAY = 0.18
"""Albedo of all surfels at the start: how bright they are in photographs is the lamp's doing."""
AMBIENT_START = 0.1
"""Exposed radiance over albedo of the light that stays, at the start; its logarithm is fitted."""


class DarkGsMethod:
    """Surfels with an albedo and a normal for shading, each shaded under a lamp whose calibration is told."""

    summary = "surfels with albedo, each shaded under a calibrated lamp on the camera (as DarkGS)"
    needs = ()
    kernels = ("maps 3",)
    asks = (Ask("light"),)
    settings_type = DarkGsSettings

    def fit(
        self, capture: Capture, priors: Priors, settings: DarkGsSettings, seed: int, progress: Progress
    ) -> DarkGsScene:
        """Fit surfels and the light that stays to the training photographs.

        Raises:
            MethodError: No calibration of the lamp was handed in, the light is not on the camera, photographs
                are black, not finite or all from one place, there are too few sparse points, or the fit has
                no way on.
        """
        check_lamp_on_camera(capture)
        check_places(capture)
        check_photographs(capture)
        lamp, views = priors.light(), photographs(capture)
        check_checkpoint(f"{METHOD} {lamp}", settings, seed)
        extent = scene_extent([view.camera for view in capture.train])
        pictures = [(view.camera, view.exposed) for view in views]
        checkpoint = fit_checkpoint(f"{METHOD} {lamp}", settings, seed, pictures)
        rules = density_rules(settings.surfels)
        plan = Plan(settings.iterations, learning_rates(extent), extent, rules, checkpoint)
        objective = Objective(views, lamp, capture.exposure, settings, seed)
        state = train(initial_state(start(capture, settings, seed), seed), plan, objective, progress)
        return DarkGsScene(state.parameters, lamp, capture.exposure, (lamp,))

    def load(self, folder: Path) -> DarkGsScene:
        """A saved decomposition.

        Raises:
            MethodError: It is missing, damaged, or of another method.
        """
        return load_scene(folder)


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


def learning_rates(extent: float) -> dict[str, Rate]:
    """Learning rates by the names of parameters, for a scene of an extent in metres.

    Those of the geometry are those of ``2dgs``. The lamp has none: it is as it was calibrated.
    """
    return {
        CENTRES: Rate(5e-4, 5e-6).times(extent),
        LOG_SCALES: Rate(5e-3),
        ROTATIONS: Rate(1e-3),
        LOGITS: Rate(5e-2),
        PAINT: Rate(2e-2),
        NORMALS: Rate(5e-3),
        AMBIENT: Rate(1e-2),
    }
