# SPDX-License-Identifier: Apache-2.0
"""The first stage: surfels of the whole scene, the object included, then light transport by glossy ones."""

from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import torch

from graycard import Capture, Progress
from graycard.methods._tensors import float_tensor
from graycard.methods.goris._filter import translation_parameters
from graycard.methods.goris._flat import FlatSurface
from graycard.methods.goris._initial_light import InitialLight, initial_light
from graycard.methods.goris._model import (
    BRIGHTEST,
    DIFFUSE,
    FRESNEL,
    LABEL,
    REGION,
    RESIDUAL,
    ROUGHNESS,
    SURROUNDINGS,
)
from graycard.methods.goris._objective import LightObjective, RadianceObjective
from graycard.methods.goris._settings import GorisSettings
from graycard.methods.goris._training_views import TrainingView, tiles_of
from graycard.methods.splat import (
    CENTRES,
    LOGITS,
    SH_DC,
    Checkpoint,
    DensityRules,
    LearningRateSchedule,
    Parameters,
    TrainConfig,
    coefficient_count,
    initial_state,
    scene_extent,
    share_inside,
    surfels_of,
    train,
)
from graycard.methods.surfels import (
    COEFFICIENTS,
    SKY,
    density_rules,
    learning_rates,
    sparse_start,
    srgb_decode_tensor,
    srgb_encode_tensor,
)

FIRST_FRESNEL, FIRST_ROUGHNESS, FIRST_DIFFUSE = 0.3, 0.3, 0.5
"""Initial values of all surfels (released code: 0.5 for all); the last is a share of the colour."""
FIRST_REGION = 0.9
"""Initial region where no prior tells glossy surfaces (released code)."""
_SURE = 0.05
"""Initial regions and diffuse radiance keep this far from 0 and 1, whose logits are infinite."""
_NONE = 1e-3
"""Diffuse radiance of a metal, over ``BRIGHTEST``: nothing is not among the values of a sigmoid."""
FRESNEL_RATE, FOUND_FRESNEL_RATE = LearningRateSchedule(2e-2, 5e-3), LearningRateSchedule(6e-3, 1.5e-3)
"""Learning rates of f0: gradients lead away from what :func:`initial_light` has found."""
CENTRES_RATE = LearningRateSchedule(8e-5, 5e-6)
"""Learning rate of positions in the steps with light transport, in extents of the scene.

It starts above where the radiance-only steps ended (1 % of their start), as most steps are still to come."""
RESERVED = 1 / 8
"""Share of the surfels that are left to densification with light transport, where settings ask for it: after
the radiance-only steps a short fit has as many as it may have."""
RESIDUAL_RATE = LearningRateSchedule(1e-3)
RESIDUAL_SINCE = 0.5
"""Share of the first stage's steps with light transport after which the residual of reflections is fitted:
light transport is to explain what it can."""
_SURE_OF_OBJECT = 0.01
"""The same of labels: less than ``least_effect``, or whatever reflects a surfel that no view sees would be
masked as reflecting the object."""


def as_glossy_as_told(settings: GorisSettings, shots: Sequence[TrainingView]) -> GorisSettings:
    """Return settings for radiance only where a prior says that nothing is glossy, else unchanged."""
    matte = settings.matte_in_colours and all(shot.told and not shot.glossy.any() for shot in shots)
    return replace(settings, radiance_share=1.0, transport=False) if matte else settings


def fit_colours(
    capture: Capture,
    shots: Sequence[TrainingView],
    settings: GorisSettings,
    seed: int,
    progress: Progress,
    *,
    flat: FlatSurface | None = None,
    saved: Checkpoint | None = None,
) -> Parameters:
    """Fit radiance alone: surfels with spherical harmonics that show the training photographs.

    Args:
        capture: It.
        shots: Its training views.
        settings: Of the method.
        seed: Of all that is random.
        progress: Told of steps.
        flat: A surface on which surfels are initialised; None: by stereo alone.
        saved: Where the fit is saved, and goes on from; None: nowhere.

    Raises:
        MethodError: There are too few sparse points, or the loss or a gradient is not finite.
    """
    extent = scene_extent([shot.photograph.camera for shot in shots])
    config = TrainConfig(
        settings.radiance_steps,
        learning_rates(extent, settings),
        extent,
        density_rules(settings.surfels - reserved(settings)),
        saved,
        backend=settings.backend,
    )
    known = None if flat is None else flat.depths
    state = initial_state(sparse_start(capture, settings, seed, known), seed)
    return train(state, config, RadianceObjective(shots, settings, seed), progress).parameters


class FittedLight(NamedTuple):
    """Surfels with light transport."""

    parameters: Parameters
    metal: bool = False
    """True if glossy surfaces are of a metal: their diffuse radiance then stays where it began."""


def fit_light(
    coloured: Parameters,
    shots: Sequence[TrainingView],
    settings: GorisSettings,
    seed: int,
    progress: Progress,
    saved: Checkpoint | None = None,
) -> FittedLight:
    """Fit light transport, and go on with geometry and radiance.

    Args:
        coloured: Of :func:`fit_colours`.
        shots: The training views.
        settings: Of the method.
        seed: Of the order of views, and of the blur's network.
        progress: Called now and then.
        saved: Where the fit is saved: this stage in a file beside it.

    Raises:
        MethodError: The loss or a gradient is not finite.
    """
    extent = scene_extent([shot.photograph.camera for shot in shots])
    start, found = with_light(coloured, shots, settings, seed), None
    if settings.transport and settings.first_light and all(shot.told for shot in shots):
        found = initial_light(start.all, shots, settings, extent)
        start = as_photographs_allow(start, found)
    metal = found is not None and found.reflectance.metal
    if settings.light_steps == 0:
        return FittedLight(start, metal)
    rates = light_rates(extent, settings, found is not None) | {CENTRES: CENTRES_RATE.times(extent)}
    if RESIDUAL in rates:
        rates[RESIDUAL] = replace(rates[RESIDUAL], windows=((RESIDUAL_SINCE, 1.0),))
    rules = light_density_rules(settings) if settings.light_density else None
    beside = saved and saved.beside("light")
    steps = settings.light_steps
    config = TrainConfig(steps, rates, extent, rules, beside, backend=settings.backend)
    if metal:
        rates.pop(DIFFUSE)
    objective = LightObjective(tiles_of(shots, settings.tile), settings, extent, seed)
    return FittedLight(train(initial_state(start, seed), config, objective, progress).parameters, metal)


def reserved(settings: GorisSettings) -> int:
    """Return number of surfels that the radiance-only steps leave to densification with light transport."""
    return round(RESERVED * settings.surfels) if settings.light_density else 0


def light_density_rules(settings: GorisSettings) -> DensityRules:
    """Return when surfels come and go in the steps with light transport: as before, and from the first on."""
    return replace(density_rules(settings.surfels), start=0.0, until=settings.light_density)


def own_stage(
    saved: Checkpoint | None, stage: str, looked_at: Iterable[torch.Tensor], settings: GorisSettings
) -> Checkpoint | None:
    """File in which a stage is saved that depends on all settings; None in a folder, as no other fit would
    share it.

    Args:
        saved: Where the first stage is saved.
        stage: Its name.
        looked_at: What it depends on besides settings and the first stage.
        settings: Of the method.
    """
    if saved is None or saved.shared:
        return None
    return saved.beside(stage, looked_at, str(replace(settings, checkpoint="")))


def with_light(
    coloured: Parameters, shots: Sequence[TrainingView], settings: GorisSettings, seed: int
) -> Parameters:
    """Surfels with the initial parameters of light transport (inferred but for the region).

    Diffuse radiance starts at half the encoded colour of degree 0; regions and labels at the share of a
    surfel's blending weights in the photographs that lies in masks.
    """
    surfels = surfels_of(coloured.surfels)
    cameras = [shot.photograph.camera for shot in shots]

    def inside(masks: Sequence[torch.Tensor]) -> torch.Tensor:
        return share_inside(surfels, cameras, [np.asarray(mask, bool) for mask in masks])[:, None]

    base = coloured.surfels[COEFFICIENTS][:, 0] * SH_DC + 0.5
    even = torch.ones(len(coloured), 1)
    told = all(shot.told for shot in shots)
    rough = 1 - inside([shot.glossy for shot in shots]) if told else FIRST_REGION * even
    own = {
        DIFFUSE: torch.logit(FIRST_DIFFUSE * base / BRIGHTEST, eps=_SURE),
        FRESNEL: torch.logit(FIRST_FRESNEL * even).repeat(1, 3),
        ROUGHNESS: torch.logit(FIRST_ROUGHNESS * even),
        REGION: torch.logit(rough, eps=_SURE),
        LABEL: torch.logit(inside([shot.target for shot in shots]), eps=_SURE_OF_OBJECT),
    }
    if settings.residual_degree and settings.transport:
        own[RESIDUAL] = torch.zeros(len(coloured), coefficient_count(settings.residual_degree) - 1, 3)
    size = settings.sky_size
    sky = srgb_decode_tensor(coloured.shared[SKY][0] * SH_DC + 0.5).clamp(min=_SURE)
    shared = {SURROUNDINGS: sky.log().expand(6, size, size, 3).contiguous()}
    if settings.filter != "none":
        shared |= translation_parameters(settings.filter, seed)
    return Parameters({**coloured.surfels, **own}, {**coloured.shared, **shared})


def as_photographs_allow(start: Parameters, found: InitialLight | None) -> Parameters:
    """Surfels with f0, diffuse radiance and environment map as they were found."""
    if found is None:
        return start
    diffuse, fresnel = (start.surfels[name].clone() for name in (DIFFUSE, FRESNEL))
    glossy = start.surfels[REGION][:, 0] < 0
    fresnel[glossy] = torch.logit(float_tensor(found.reflectance.f0))
    if found.reflectance.metal:
        diffuse[glossy] = torch.logit(torch.tensor(_NONE))
    else:
        diffuse[found.surfels] = torch.logit(srgb_encode_tensor(found.diffuse) / BRIGHTEST, eps=_SURE)
    own = {DIFFUSE: diffuse, FRESNEL: fresnel}
    return Parameters(
        {**start.surfels, **own}, {**start.shared, SURROUNDINGS: found.surroundings.log().contiguous()}
    )


def light_rates(extent: float, settings: GorisSettings, found: bool) -> dict[str, LearningRateSchedule]:
    """Learning rates by the names of parameters (inferred).

    Geometry and radiance go on at the rates that they ended with, opacities at a fifth of theirs; new
    parameters as a short fit needs.

    Args:
        extent: Of the scene, metres.
        settings: Of the method.
        found: Whether f0 was found by :func:`initial_light`, or fitted by a stage before.
    """
    rates = learning_rates(extent, settings)
    rates = {name: LearningRateSchedule(rate.end or rate.start) for name, rate in rates.items()}
    rates[LOGITS] = LearningRateSchedule(1e-2)
    rates |= {
        DIFFUSE: LearningRateSchedule(2e-2, 5e-3),
        FRESNEL: FOUND_FRESNEL_RATE if found else FRESNEL_RATE,
        ROUGHNESS: LearningRateSchedule(2e-2, 5e-3),
        REGION: LearningRateSchedule(2e-2),
        LABEL: LearningRateSchedule(2e-2),
        SURROUNDINGS: LearningRateSchedule(2e-2, 5e-3),
    }
    if settings.residual_degree and settings.transport:
        rates[RESIDUAL] = RESIDUAL_RATE
    if settings.filter != "none":
        names = translation_parameters(settings.filter, 0)
        rates |= {name: LearningRateSchedule(1e-3) for name in names}
    return rates
