# SPDX-License-Identifier: Apache-2.0
"""The stages that all radiance-only removals share: surfels of the whole scene, then without the object."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import TypeVar

import numpy as np
import torch

from graycard import Capture
from graycard.io import Room
from graycard.methods._contract import Ask
from graycard.methods.removal._filled import Target
from graycard.methods.removal._scene import RemovalScene
from graycard.methods.removal._settings import StagedSettings
from graycard.methods.removal._target import check_masks, target_masks
from graycard.methods.splat import (
    CENTRES,
    DensityRules,
    LearningRateSchedule,
    LossResult,
    Parameters,
    TrainConfig,
    scene_extent,
)
from graycard.methods.surfels import (
    EncodedPhotograph,
    FitTask,
    SurfelObjective,
    SurfelScene,
    SurfelSettings,
    check_checkpoint,
    check_photographs,
    check_places,
    density_rules,
    exposed_photograph,
    fit_surfels,
    learning_rates,
    sky_basis,
    sparse_start,
    srgb_encode_tensor,
)

ASKS = (Ask("inpainting", ("radiance",)), Ask("mask", ("target",), optional=True))
"""The second only where ``object_masks`` says so."""

SurfelSettingsT = TypeVar("SurfelSettingsT", bound=SurfelSettings)
StagedSettingsT = TypeVar("StagedSettingsT", bound=StagedSettings)

FIRST = "2dgs"
"""Identity of the first stage of all radiance-only removals, which share what it saves."""


def first_settings(settings: SurfelSettings) -> SurfelSettings:
    """Return the settings of ``2dgs`` for the first stage."""
    return SurfelSettings(**{part.name: getattr(settings, part.name) for part in fields(SurfelSettings)})


def checked(task: FitTask[SurfelSettingsT], method: str, first: SurfelSettings) -> list[np.ndarray]:
    """Return the masks of the object of a capture that can be fitted.

    Args:
        task: The photographs, and the settings of all stages.
        method: Whose name a checkpoint of the first stage has.
        first: Settings that such a checkpoint depends on.

    Raises:
        MethodError: It cannot, or its masks are not sound.
    """
    capture, settings = task.capture, task.settings
    masks = target_masks(capture, settings.grow if isinstance(settings, StagedSettings) else 0.0)
    check_places(capture)
    check_photographs(capture)
    check_checkpoint(method, first, task.seed)
    return masks


def checked_for_removal(
    task: FitTask[StagedSettingsT], method: str, first: SurfelSettings
) -> list[np.ndarray]:
    """Check a task as :func:`checked` does, and that its object can be removed; return masks by the settings.

    Raises:
        MethodError: It cannot, masks are not sound, or no prior fills in holes.
    """
    granted, capture, priors = checked(task, method, first), task.capture, task.priors
    priors.require("inpainting")
    if task.settings.object_masks == "capture":
        return granted
    masks = [priors.mask(exposed_photograph(capture, view), view, "target") for view in capture.train]
    check_masks(capture, masks, task.settings.grow)
    return masks


def first_stage(task: FitTask[SurfelSettingsT]) -> Parameters:
    """Fit surfels of the whole scene, the object included, as ``2dgs`` does."""
    own = first_settings(task.settings)
    start, rules = sparse_start(task.capture, own, task.seed), density_rules(own.surfels)
    return fit_surfels(FIRST, task.with_settings(own), start=start, rules=rules)


def second_stage(
    task: FitTask[StagedSettingsT],
    start: Parameters,
    views: Sequence[EncodedPhotograph],
    rules: DensityRules | None = None,
) -> Parameters:
    """Fit what is left to what views are to show.

    Args:
        task: The settings of both stages, and the seed of the order of views and of densification.
        start: What is left, and what is new.
        views: See :func:`shown`.
        rules: When surfels come and go: they are then as fast as when a fit begins, for they have a way to
            go. None: none does, and they are as slow as in its end.
    """
    settings, extent = task.settings, scene_extent([view.camera for view in views])
    steps, done = settings.second_steps, settings.iterations
    rates = learning_rates(extent, settings)
    centres = rates[CENTRES]
    rates[CENTRES] = LearningRateSchedule(centres.start if rules else centres.end or centres.start)
    # as the last steps of a longer fit: all harmonics and weights count from the first step on
    objective = SurfelObjective(list(views), replace(settings, iterations=done + steps), task.seed)
    config = TrainConfig(steps, rates, extent, rules, backend=settings.backend)
    return task.train(start, config, LaterSteps(objective, done))


@dataclass(frozen=True, eq=False)
class LaterSteps:
    """An objective whose steps are counted from a later one on."""

    objective: SurfelObjective
    done: int

    def __call__(self, values: Mapping[str, torch.Tensor], step: int) -> LossResult:
        """Return the loss of a step, with what else the fit is told."""
        return self.objective(values, self.done + step)


def shown(
    targets: Sequence[Target], weights: Iterable[np.ndarray], settings: SurfelSettings
) -> list[EncodedPhotograph]:
    """Return the targets of views as a fit takes them, in place of photographs that show the object.

    Args:
        targets: Of the views.
        weights: Shape ``(H, W)`` each: of the pixels in the loss.
        settings: Of the sky.
    """
    found = []
    with Room() as room:
        for target, weight in zip(targets, weights, strict=True):
            camera = target.behind.view.camera
            picture = srgb_encode_tensor(torch.from_numpy(target.picture.astype(np.float32)))
            sky = sky_basis(camera, settings.sky_degree)
            weigh = torch.from_numpy(weight.astype(np.float32))
            found.append(room.keep(EncodedPhotograph(camera, picture, sky, weigh)))
    return found


def decomposition(method: str, capture: Capture, before: Parameters, after: Parameters) -> RemovalScene:
    """Return the scene as a capture shows it, and without the object that it names."""
    assert capture.target is not None, "it was checked"
    whole, emptied = (SurfelScene(parameters, method, capture.exposure) for parameters in (before, after))
    return RemovalScene(whole, emptied, capture.target)
