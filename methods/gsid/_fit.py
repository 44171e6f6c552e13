# SPDX-License-Identifier: Apache-2.0
"""The second stage: materials and lights on surfels that stand still."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import torch

from graycard import MethodError, Progress
from graycard.methods.gsid._aggregation import aggregated, without_dim_lamps
from graycard.methods.gsid._bounces import bounces_between
from graycard.methods.gsid._guess import MaterialGuess
from graycard.methods.gsid._lights import (
    AMPLITUDES,
    AXES,
    POSITIONS,
    SHARPNESS,
    SKY,
)
from graycard.methods.gsid._materials import first_materials
from graycard.methods.gsid._model import (
    BASE_COLOR,
    METALLIC,
    OPEN,
    ROUGHNESS,
    SHADOW,
    SIDE,
    ground_of,
    lit_side,
)
from graycard.methods.gsid._objective import deferred_views
from graycard.methods.gsid._settings import GsidSettings
from graycard.methods.gsid._stage import LightStage, objective_in, renewed
from graycard.methods.gsid._start import first_parameters
from graycard.methods.shading import (
    outward,
    sky_visibility,
)
from graycard.methods.splat import (
    CENTRES,
    GEOMETRY,
    FitState,
    LearningRateSchedule,
    Parameters,
    TrainConfig,
    initial_state,
    surfels_of,
    train,
)
from graycard.methods.surfels import FitTask, geometry_rates


def fit_lights(
    task: FitTask[GsidSettings], geometry: Parameters, guesses: Sequence[MaterialGuess]
) -> Parameters:
    """Fit materials and lights that explain the training photographs.

    Args:
        task: The photographs, the settings and the seed of the order of views and of the samples.
        geometry: Of the first stage; it stays.
        guesses: Answers of the prior, one a view.

    Raises:
        MethodError: Surfels cover nothing, or the fit has no way on.
    """
    capture, settings, seed, extent = task.capture, task.settings, task.seed, task.extent
    surfels = surfels_of(geometry.surfels)
    eyes = torch.tensor(np.array([view.camera.position for view in capture.train])).float()
    normals = outward(surfels, eyes)
    opened = sky_visibility(surfels, normals, extent) if settings.occlusion else torch.ones(len(surfels))
    grounds = (ground_of(surfels, view.camera, opened) for view in capture.train)
    between = bounces_between(surfels, normals, extent) if settings.bounces else None
    stage = LightStage(surfels, deferred_views(capture, grounds, guesses), settings, extent, seed, between)
    surface = {name: geometry.surfels[name] for name in GEOMETRY} | {OPEN: opened}
    surface |= first_materials(surfels, normals, stage.shots) | {SIDE: lit_side(surfels, normals)}
    parameters = first_parameters(stage, surface)
    return train_lights(initial_state(parameters, seed), stage, task.progress).parameters


def check_told(guesses: Sequence[MaterialGuess], settings: GsidSettings) -> None:
    """Refuse to keep the materials of a prior that knows none.

    Raises:
        MethodError: ``materials = "prior"``, and the prior was not asked or does not know one of them.
    """
    missing = [
        kind
        for kind in ("base_color", "roughness", "metallic")
        if any(getattr(guess, kind) is None for guess in guesses)
    ]
    if settings.materials == "prior" and missing:
        raise MethodError(
            f"expected a prior that tells {', '.join(missing)}, as materials = 'prior' keeps them, got none. "
            "Hand one in (--priors oracle:2), or fit materials"
        )


def train_lights(state: FitState, stage: LightStage, progress: Progress) -> FitState:
    """Fit lights in chunks: before each, trace rays to the lamps of then, and change lamps.

    After the last change, and before the last chunk in any case, lamps that are next to out are left out for
    good: the others have a chunk or more to make up for them. The scene shows all that are left.
    """
    settings = stage.settings
    config = TrainConfig(stage.steps, learning_rates(stage.extent, settings), stage.extent)
    ends = chunk_ends(stage.steps, settings.aggregate_every)
    for end in ends:
        if state.step > 0:
            stage = renewed(stage, state.parameters)
        changing = state.step <= settings.aggregate_until * stage.steps
        if state.step > 0 and changing:
            state = aggregated(state, stage)
        if state.step > 0 and (not changing or end == ends[-1]):
            state = without_dim_lamps(state, stage)
        objective = objective_in(stage, state.parameters)
        state = train(state, replace(config, until=end), objective, progress)
    return state


def chunk_ends(steps: int, share: float) -> list[int]:
    """Return the steps at which chunks of about a share of all steps end, all of nearly the same length.

    With a rest of a few steps at the end, a lamp that is left out there would leave a hole in the light.
    """
    chunks = min(steps, max(1, round(1 / share)))
    return [number * steps // chunks for number in range(1, chunks + 1)]


def learning_rates(extent: float, settings: GsidSettings) -> dict[str, LearningRateSchedule]:
    """By the names of parameters, for a scene of an extent in metres (all inferred)."""
    windows = ((settings.material_start, 1.0),)
    materials = {
        BASE_COLOR: LearningRateSchedule(4e-2, 1e-2, windows),
        ROUGHNESS: LearningRateSchedule(2e-2, 5e-3, windows),
        METALLIC: LearningRateSchedule(2e-2, 5e-3, windows),
    }
    rates = {
        POSITIONS: LearningRateSchedule(5e-3, 1e-3).times(extent),
        AXES: LearningRateSchedule(2e-2, 5e-3),
        SHARPNESS: LearningRateSchedule(2e-2, 5e-3),
        AMPLITUDES: LearningRateSchedule(3e-2, 5e-3),
        SKY: LearningRateSchedule(2e-2, 5e-3),
    }
    rates |= {SHADOW: LearningRateSchedule(2e-2)} if settings.visibility.startswith("vector") else {}
    first = geometry_rates(extent) if settings.geometry_rate > 0 else {}
    rates |= {name: first[name].times(settings.geometry_rate) for name in first if name != CENTRES}
    return rates | (materials if settings.materials == "fitted" else {})
