# SPDX-License-Identifier: Apache-2.0
"""The stages that all radiance-only removals share: surfels of the whole scene, then without the object."""

from collections.abc import Sequence
from dataclasses import fields, replace

import numpy as np
import torch

from graycard import Capture, Progress
from graycard.methods._contract import Ask, Priors
from graycard.methods.removal._filled import Target
from graycard.methods.removal._scene import RemovalScene
from graycard.methods.removal._settings import StagedSettings
from graycard.methods.removal._target import check_masks, target_masks
from graycard.methods.splat import (
    CENTRES,
    DensityRules,
    Parameters,
    Plan,
    Rate,
    initial_state,
    scene_extent,
    train,
)
from graycard.methods.surfels import (
    Objective,
    Photograph,
    SurfelScene,
    SurfelSettings,
    check_checkpoint,
    check_photographs,
    check_places,
    density_rules,
    encode,
    exposed_photograph,
    fit_surfels,
    learning_rates,
    sky_basis,
    sparse_start,
)

ASKS = (Ask("inpainting", ("radiance",)), Ask("mask", ("target",), optional=True))
"""The second only where ``object_masks`` says so."""


FIRST = "2dgs"
"""What the first stage of all radiance-only removals is: they share what it saves."""


def first_settings(settings: SurfelSettings) -> SurfelSettings:
    """The settings of ``2dgs`` for the first stage."""
    return SurfelSettings(**{part.name: getattr(settings, part.name) for part in fields(SurfelSettings)})


def checked(
    capture: Capture, settings: SurfelSettings, seed: int, method: str, first: SurfelSettings
) -> list[np.ndarray]:
    """The masks of the object of a capture that can be fitted.

    Args:
        capture: The photographs.
        settings: Of all stages.
        seed: Of the fit.
        method: Whose name a checkpoint of the first stage has.
        first: Settings that such a checkpoint depends on.

    Raises:
        MethodError: It cannot, or its masks are not sound.
    """
    masks = target_masks(capture, settings.grow if isinstance(settings, StagedSettings) else 0.0)
    check_places(capture)
    check_photographs(capture)
    check_checkpoint(method, first, seed)
    return masks


def checked_for_removal(
    capture: Capture,
    priors: Priors,
    settings: StagedSettings,
    seed: int,
    method: str,
    first: SurfelSettings,
) -> list[np.ndarray]:
    """As :func:`checked`, of a capture whose object can be removed; its masks as the settings want them.

    Raises:
        MethodError: It cannot, masks are not sound, or no prior fills in holes.
    """
    granted = checked(capture, settings, seed, method, first)
    priors.require("inpainting")
    if settings.object_masks == "capture":
        return granted
    masks = [priors.mask(exposed_photograph(capture, view), view, "target") for view in capture.train]
    check_masks(capture, masks, settings.grow)
    return masks


def first_stage(capture: Capture, settings: SurfelSettings, seed: int, progress: Progress) -> Parameters:
    """Surfels of the whole scene, the object included, as ``2dgs`` fits them."""
    own = first_settings(settings)
    start, rules = sparse_start(capture, own, seed), density_rules(own.surfels)
    return fit_surfels(FIRST, capture, own, seed, progress, start=start, rules=rules)


def second_stage(
    start: Parameters,
    views: Sequence[Photograph],
    settings: StagedSettings,
    seed: int,
    progress: Progress,
    rules: DensityRules | None = None,
) -> Parameters:
    """Fit what is left to what views are to show.

    Args:
        start: What is left, and what is new.
        views: See :func:`shown`.
        settings: Of both stages.
        seed: Of the order of views, and of densification.
        progress: Called now and then.
        rules: When surfels come and go: they are then as fast as when a fit begins, for they have a way to
            go. None: none does, and they are as slow as in its end.
    """
    extent = scene_extent([view.camera for view in views])
    steps, done = settings.second_steps, settings.iterations
    rates = learning_rates(extent, settings)
    centres = rates[CENTRES]
    rates[CENTRES] = Rate(centres.start if rules else centres.end or centres.start)
    # as the last steps of a longer fit: all harmonics and weights count from the first step on
    objective = Objective(list(views), replace(settings, iterations=done + steps), seed)
    plan = Plan(steps, rates, extent, rules)
    return train(
        initial_state(start, seed), plan, lambda values, step: objective(values, done + step), progress
    ).parameters


def shown(target: Target, weight: np.ndarray, settings: SurfelSettings) -> Photograph:
    """The target of a view as a fit takes it, in place of the photograph that shows the object.

    Args:
        target: Of the view.
        weight: Shape ``(H, W)``: of the pixels in the loss.
        settings: Of the sky.
    """
    camera = target.behind.view.camera
    picture = encode(torch.from_numpy(target.picture.astype(np.float32)))
    sky = sky_basis(camera, settings.sky_degree)
    return Photograph(camera, picture, sky, torch.from_numpy(weight.astype(np.float32)))


def decomposition(method: str, capture: Capture, before: Parameters, after: Parameters) -> RemovalScene:
    """The scene as a capture shows it, and without the object that it names."""
    assert capture.target is not None, "it was checked"
    scenes = (SurfelScene(method, parameters, capture.exposure) for parameters in (before, after))
    return RemovalScene(*scenes, capture.target)
