# SPDX-License-Identifier: Apache-2.0
"""One whole step of a fit, stage by stage: what a user waits for is no kernel but this."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import torch

from graycard.benchmarks.speed._engine_scenes import WORKLOADS, Workload, engine_camera, engine_surfels
from graycard.benchmarks.speed._machine import Patience, Timing, time_calls
from graycard.methods.splat import FitState, Plan, adam_step, initial_state, surfels_of, train_step
from graycard.methods.surfels import (
    Objective,
    Photograph,
    SurfelSettings,
    colours,
    learning_rates,
    sky_basis,
    with_colours,
)

STILL = 1e-9
"""Factor of all learning rates: one step is taken again and again, and the cloud must not change by it."""


@dataclass(frozen=True, slots=True)
class StepCost:
    """The time of one stage of a training step, or of the whole."""

    stage: str
    timing: Timing


def training_step_cost(
    workload: Workload = WORKLOADS[3],
    patience: Patience | None = None,
    settings: SurfelSettings | None = None,
) -> list[StepCost]:
    """Time a step of ``2dgs``, with all its losses, on a cloud of surfels.

    Args:
        workload: The cloud and the size of its image; D by default.
        patience: How long to measure.
        settings: Of the method.

    Returns:
        ``colours``: surfels and their colours from the parameters; ``loss``: these, drawing, and all losses;
        ``gradients``: these, and all the way back; ``adam``: alone; ``step``: the whole, with what
        densification remembers. Each stage but Adam holds those before it.
    """
    patience, settings = patience or Patience(), settings or SurfelSettings()
    state, plan, objective = _fit(workload, settings)
    return [StepCost(name, time_calls(call, patience)) for name, call in _stages(state, plan, objective)]


def _fit(workload: Workload, settings: SurfelSettings) -> tuple[FitState, Plan, Objective]:
    """A fit shortly before its end, when every loss and every harmonic counts."""
    camera = engine_camera(workload)
    target = torch.rand(workload.size, workload.size, 3, generator=torch.Generator().manual_seed(0))
    view = Photograph(camera, target, sky_basis(camera, settings.sky_degree))
    state = initial_state(with_colours(engine_surfels(workload), settings), 0)
    still = {name: rate.times(STILL) for name, rate in learning_rates(1.0, settings).items()}
    plan = Plan(settings.iterations, still, 1.0)
    return replace(state, step=settings.iterations - 1), plan, Objective([view], settings, 0)


def _stages(state: FitState, plan: Plan, objective: Objective) -> Iterator[tuple[str, Callable[[], object]]]:
    camera, degree = objective.views[0].camera, objective.settings.degree
    values = {name: p.clone().requires_grad_() for name, p in state.parameters.all.items()}
    share = state.step / plan.steps

    def gradients() -> dict[str, torch.Tensor]:
        loss = objective(values, state.step).loss
        found = torch.autograd.grad(loss, list(values.values()), allow_unused=True, materialize_grads=True)
        return dict(zip(values, found, strict=True))

    kept = gradients()
    yield "colours", lambda: surfels_of(values, colours(values, camera.position, degree))
    yield "loss", lambda: objective(values, state.step)
    yield "gradients", gradients
    yield "adam", lambda: adam_step(state, kept, plan.rates, share)
    yield "step", lambda: train_step(state, plan, objective)
