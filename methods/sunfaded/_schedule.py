# SPDX-License-Identifier: Apache-2.0
"""What moves when: five stages by shares of the budget (25, 25, 25, 12.5 and 12.5 %)."""

from enum import IntEnum

from graycard.methods.splat import CENTRES, LOG_SCALES, LOGITS, ROTATIONS, DensityRules, Rate
from graycard.methods.sunfaded._light import NETWORK, POSITION, UNITS_PER_METRE
from graycard.methods.sunfaded._model import ALBEDO, AMBIENT
from graycard.methods.sunfaded._settings import SunFadedSettings


class Stage(IntEnum):
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


ENDS = (0.25, 0.5, 0.75, 0.875, 1.0)
"""Shares of the budget at which the stages end."""
ALBEDO_PRIOR = ENDS[Stage.JOINT]
"""From when the geometry prior looks at the albedo."""


def stage_at(share: float) -> Stage:
    """The stage when a share of the budget, below 1, is spent."""
    return next(stage for stage in Stage if share < ENDS[stage])


def learning_rates(extent: float, settings: SunFadedSettings) -> dict[str, Rate]:
    """Learning rates by the names of parameters, for a scene of an extent in metres.

    Those of surfels are 2DGS's, faster where a fit is so much shorter; those of light and albedo are the
    released code's.
    """
    unlit, lamp, joint, opacity, refined = (_window(stage) for stage in Stage)
    released = settings.schedule == "release_40k"
    last = _every_other(settings.iterations) if released else (refined,)
    surfels = (unlit, joint, *last)
    # Without a light that stays there is no unlit picture: the first stage then has the lamp too.
    light = (*(() if settings.ambient else (unlit,)), lamp, joint, *(last if released else ()))
    ambient = (unlit, *((lamp,) if released else ()), joint, *last)
    rates = {
        CENTRES: Rate(5e-4, 5e-6, surfels).times(extent),
        LOG_SCALES: Rate(5e-3, windows=surfels),
        ROTATIONS: Rate(1e-3, windows=surfels),
        LOGITS: Rate(5e-2, windows=(unlit, joint, opacity, *last)),
        ALBEDO: Rate(2.5e-3, windows=surfels),
        POSITION: Rate(2.5e-3, windows=light).times(1 / UNITS_PER_METRE),
    }
    rates |= {name: Rate(2.5e-3, windows=light) for name in NETWORK}
    return rates | ({AMBIENT: Rate(2.5e-3, windows=ambient)} if settings.ambient else {})


def density_rules(settings: SunFadedSettings) -> DensityRules:
    """Surfels are added in the first and third stage, and taken away in the fourth too.

    What is looked at in between moves no surfel, so none is asked to be two.
    """
    return DensityRules(
        start=0.05, every=0.025, until=ENDS[Stage.OPACITY], reset_every=1.0, gradient=1e-4,
        limit=settings.surfels,
    )  # fmt: skip


def _window(stage: Stage) -> tuple[float, float]:
    return (ENDS[stage - 1] if stage else 0.0), ENDS[stage]


def _every_other(steps: int) -> tuple[tuple[float, float], ...]:
    """Every other step of the last stage, as the released code has it."""
    first = round(ENDS[Stage.OPACITY] * steps)
    return tuple((step / steps, (step + 1) / steps) for step in range(first, steps, 2))
