# SPDX-License-Identifier: Apache-2.0
"""Schedule: five stages by shares of the budget."""

from collections.abc import Mapping
from enum import IntEnum

from graycard.methods.splat import CENTRES, LOG_SCALES, LOGITS, ROTATIONS, DensityRules, LearningRateSchedule
from graycard.methods.sunfaded._light import NETWORK, POSITION, UNITS_PER_METRE
from graycard.methods.sunfaded._model import ALBEDO, AMBIENT
from graycard.methods.sunfaded._settings import Schedule, SunFadedSettings


class FitStage(IntEnum):
    """The stages of a fit, in their order."""

    UNLIT = 0
    """Surfels, albedo and the light that stays, where the lamp does not reach."""
    LAMP = 1
    """The lamp alone."""
    JOINT = 2
    """Everything."""
    OPACITY = 3
    """Opacities, and away with surfels that are nearly transparent: those that stood in for light."""
    REFINED = 4
    """Everything but the lamp."""


_PAPER = (0.25, 0.5, 0.75, 0.875, 1.0)
ENDS: Mapping[Schedule, tuple[float, ...]] = {
    "short": (0.01, 0.08, 0.8, 0.9, 1.0),
    "paper": _PAPER,
    "release_40k": _PAPER,
}
"""Shares of the budget at which the stages end. From the end of the joint one on the geometry prior looks at
the albedo."""

LIGHT_RATE, LAMP_END, AMBIENT_END = 2.5e-3, 2.5e-4, 2.5e-5
"""Learning rate of both lights at the start (released code), and of lamp and ambient light in the end."""


def stage_at(share: float, schedule: Schedule) -> FitStage:
    """Return the stage when a share of the budget, below 1, is spent."""
    return next(stage for stage in FitStage if share < ENDS[schedule][stage])


def learning_rates(extent: float, settings: SunFadedSettings) -> dict[str, LearningRateSchedule]:
    """Learning rates by the names of parameters, for a scene of an extent in metres.

    Those of surfels are 2DGS's, faster where a fit is so much shorter. That of albedo, in logits, is half of
    the released code's where albedo begins: what is smooth is left to the lamp. The centres of surfels still
    move when the lamp is known: before, little is seen of them. Those of light begin as in the released code
    and fall over the fit, but for ``release_40k``: a lamp that never comes to rest is another one at each
    step, and surfels and albedo run after it.
    """
    unlit, lamp, joint, opacity, refined = (_window(stage, settings) for stage in FitStage)
    released = settings.schedule == "release_40k"
    last = _every_other(settings) if released else (refined,)
    surfels = (unlit, joint, *last)
    # Without a light that stays there is no unlit picture: the first stage then has the lamp too.
    light = (*(() if settings.ambient else (unlit,)), lamp, joint, *(last if released else ()))
    ambient = (unlit, *((lamp,) if released else ()), joint, *last)
    lamp_end, ambient_end = (LIGHT_RATE, LIGHT_RATE) if released else (LAMP_END, AMBIENT_END)
    rates = {
        CENTRES: LearningRateSchedule(5e-4, 5e-5, surfels).times(extent),
        LOG_SCALES: LearningRateSchedule(5e-3, windows=surfels),
        ROTATIONS: LearningRateSchedule(1e-3, windows=surfels),
        LOGITS: LearningRateSchedule(5e-2, windows=(unlit, joint, opacity, *last)),
        ALBEDO: LearningRateSchedule(5e-3, windows=surfels),
        POSITION: LearningRateSchedule(LIGHT_RATE, lamp_end, light).times(1 / UNITS_PER_METRE),
    }
    rates |= {name: LearningRateSchedule(LIGHT_RATE, lamp_end, light) for name in NETWORK}
    if settings.ambient:
        rates[AMBIENT] = LearningRateSchedule(LIGHT_RATE, ambient_end, ambient)
    return rates


def density_rules(settings: SunFadedSettings) -> DensityRules:
    """Surfels are added in the first and third stage, and taken away in the fourth too.

    In the second they stand still. In the fourth, of the released schedule, they are added as well; else
    nothing is looked at that would ask for more.
    """
    return DensityRules(
        start=0.05, every=0.025, until=ENDS[settings.schedule][FitStage.OPACITY], reset_every=1.0,
        gradient=1e-4, limit=settings.surfels, pauses=(_window(FitStage.LAMP, settings),),
    )  # fmt: skip


def adds_surfels(stage: FitStage, schedule: Schedule) -> bool:
    """Return whether what surfels look like on the screen is watched, to add some."""
    return stage in (FitStage.UNLIT, FitStage.JOINT) or (
        stage is FitStage.OPACITY and schedule == "release_40k"
    )


def _window(stage: FitStage, settings: SunFadedSettings) -> tuple[float, float]:
    ends = ENDS[settings.schedule]
    return (ends[stage - 1] if stage else 0.0), ends[stage]


def _every_other(settings: SunFadedSettings) -> tuple[tuple[float, float], ...]:
    """Every other step of the last stage, as the released code has it."""
    steps = settings.iterations
    first = round(ENDS[settings.schedule][FitStage.OPACITY] * steps)
    return tuple((step / steps, (step + 1) / steps) for step in range(first, steps, 2))
