# SPDX-License-Identifier: Apache-2.0
"""A whole step of ``2dgs`` on a workload, without and with the losses on geometry: what a user waits for."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from functools import partial

import torch

from graycard.benchmarks.speed._machine import Patience, Timing, time_calls
from graycard.benchmarks.speed.engine._records import StepCost
from graycard.benchmarks.speed.engine._scenes import Workload, engine_camera, engine_surfels
from graycard.methods.splat import (
    FitBackend,
    FitState,
    TrainConfig,
    adam_step,
    device_of,
    initial_state,
    on_device,
    state_on,
    surfels_of,
    train_step,
)
from graycard.methods.surfels import (
    EncodedPhotograph,
    SurfelObjective,
    SurfelSettings,
    colours,
    learning_rates,
    sky_basis,
    with_colours,
)

STILL = 1e-9
"""Factor of all learning rates: one step is taken again and again, and the cloud must not change by it."""
LOSSES: Mapping[str, SurfelSettings] = {
    "photometric": SurfelSettings(normal_weight=0.0, distortion_weight=0.0),
    "and geometry": SurfelSettings(),
}
"""Losses of a step, by their names in the table: the defaults hold the depth-normal loss and distortion."""


def measure_steps(
    workload: Workload, patience: Patience, backend: FitBackend = "cpu"
) -> tuple[StepCost, ...]:
    """Time a step for each of ``LOSSES``, and its stages.

    Args:
        workload: The cloud and the size of its image.
        patience: How long to measure.
        backend: Where; a GPU is waited for after each call.

    Returns:
        The stages are ``colours``: surfels and their colours from the parameters; ``loss``: these, drawing,
        and the losses; ``gradients``: these, and all the way back; ``Adam``: alone. The whole is these with
        what densification remembers.

    Raises:
        MethodError: The back end cannot run here.
    """
    device = device_of(backend)
    return tuple(_cost(workload, name, settings, patience, device) for name, settings in LOSSES.items())


def _cost(
    workload: Workload, losses: str, settings: SurfelSettings, patience: Patience, device: torch.device
) -> StepCost:
    state, plan, objective = _fit(workload, settings)
    state, objective = state_on(state, device), on_device(objective, device)

    def timed(call: Callable[[], object]) -> Timing:
        return time_calls(call if device.type == "cpu" else partial(_finished, call), patience)

    stages = {name: timed(call) for name, call in _stages(state, plan, objective)}
    whole = timed(lambda: train_step(state, plan, objective))
    name = "cpu" if device.type == "cpu" else torch.cuda.get_device_name(device)
    return StepCost(workload.name, losses, whole, stages, name)


def _finished(call: Callable[[], object]) -> object:
    """Call, and wait for the GPU, which returns before it is done."""
    found = call()
    torch.cuda.synchronize()
    return found


def _fit(workload: Workload, settings: SurfelSettings) -> tuple[FitState, TrainConfig, SurfelObjective]:
    """Return a fit shortly before its end, when every loss and every harmonic counts."""
    camera = engine_camera(workload)
    target = torch.rand(workload.size, workload.size, 3, generator=torch.Generator().manual_seed(0))
    view = EncodedPhotograph(camera, target, sky_basis(camera, settings.sky_degree))
    state = initial_state(with_colours(engine_surfels(workload), settings), 0)
    still = {name: rate.times(STILL) for name, rate in learning_rates(1.0, settings).items()}
    plan = TrainConfig(settings.iterations, still, 1.0)
    return replace(state, step=settings.iterations - 1), plan, SurfelObjective([view], settings, 0)


def _stages(
    state: FitState, plan: TrainConfig, objective: SurfelObjective
) -> Iterator[tuple[str, Callable[[], object]]]:
    camera, degree = objective.views[0].camera, objective.settings.degree
    values = {name: p.clone().requires_grad_() for name, p in state.parameters.all.items()}

    def gradients() -> dict[str, torch.Tensor]:
        loss = objective(values, state.step).loss
        found = torch.autograd.grad(loss, list(values.values()), allow_unused=True, materialize_grads=True)
        return dict(zip(values, found, strict=True))

    kept, share = gradients(), state.step / plan.steps
    yield "colours", lambda: surfels_of(values, colours(values, camera.position, degree))
    yield "loss", lambda: objective(values, state.step)
    yield "gradients", gradients
    yield "Adam", lambda: adam_step(state, kept, plan.rates, share)
