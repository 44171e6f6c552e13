# SPDX-License-Identifier: Apache-2.0
"""Training loop: evaluate the loss, take an Adam step, densify and prune; resume from a checkpoint."""

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import torch

from graycard import Progress
from graycard.io import peak_memory_mib
from graycard.methods._resumed import add_resumed
from graycard.methods.splat._devices import CPU, FitBackend, device_of, on_device
from graycard.methods.splat.fit._checkpoint import NOTHING_SPENT, Checkpoint, Spent, load_saved, save_state
from graycard.methods.splat.fit._densify import DensityRules, densify, keep, prune, reset_opacity
from graycard.methods.splat.fit._optimise import (
    FitState,
    LearningRateSchedule,
    adam_step,
    check_loss,
    leaves,
    state_on,
    watch_screen,
)


@dataclass(frozen=True, eq=False)
class LossResult:
    """The loss of one step, and the statistics that densification needs."""

    loss: torch.Tensor
    """The scalar to lower, differentiable in the parameters."""
    offsets: torch.Tensor | None = None
    """Zeros of shape ``(N, 2)`` that require gradients, as they went into the rasteriser: tell densification
    what the picture asks of each surfel. None where nothing is densified."""
    radius: torch.Tensor | None = None
    """Shape ``(N,)``: largest radius on the image, in shares of its width."""
    size: tuple[int, int] = (1, 1)
    """Width and height of the image, pixels."""


Objective = Callable[[Mapping[str, torch.Tensor], int], LossResult]
"""From the parameters by name and the number of the step to what is to be lowered: a function of nothing
else, or a fit that was cut off would go on differently."""


Misplaced = Callable[[Mapping[str, torch.Tensor]], torch.Tensor]
"""From the parameters of the surfels by name to those that cannot be where they are, shape ``(N,)``, bool."""


@dataclass(frozen=True, eq=False)
class TrainConfig:
    """The budget, learning rates and densification of a fit.

    Raises:
        ValueError: There is no step.
    """

    steps: int
    rates: Mapping[str, LearningRateSchedule]
    """By the names of parameters; those without a rate stay as they are."""
    extent: float
    """Extent of the scene, metres."""
    rules: DensityRules | None = None
    """None: no surfel comes or goes."""
    checkpoint: Checkpoint | None = None
    until: int | None = None
    """Stop, and save, after so many of the ``steps``; None: after all of them."""
    misplaced: Misplaced | None = None
    """Names surfels that go whenever ``rules`` take some away, besides theirs; None: no others."""
    backend: FitBackend = "cpu"
    """Device of the fit, see :func:`train`."""

    @property
    def last(self) -> int:
        """Steps that are done in the end."""
        return self.steps if self.until is None else min(self.until, self.steps)

    def __post_init__(self) -> None:
        if self.steps < 1:
            raise ValueError(f"expected 1 or more steps, got {self.steps}")


def train(state: FitState, config: TrainConfig, objective: Objective, progress: Progress) -> FitState:
    """Run a fit to its end, from a state or from what was saved of it.

    Equal states, configurations and objectives end with equal bits on one machine, however often the fit
    was cut off and resumed; on a GPU, whose sums have no fixed order, but for rounding.

    With the back end ``cuda`` parameters, and all tensors that the objective holds, lie on the GPU as long as
    the fit lasts. The objective's own code makes its tensors on the device of the parameters.

    Args:
        state: Before the first step, on the CPU; used up.
        config: Rates, rules and the budget.
        objective: What is to be lowered.
        progress: Called now and then.

    Returns:
        The last state, on the CPU.

    Raises:
        MethodError: A loss or a gradient is not finite, the checkpoint is damaged or of another fit, or the
            back end cannot run here.
        OutputError: The checkpoint cannot be written.
    """
    device = device_of(config.backend)
    saved = None if config.checkpoint is None else load_saved(config.checkpoint)
    state, before = (state, NOTHING_SPENT) if saved is None else saved
    add_resumed(before.seconds, before.peak_mib)
    state, objective = state_on(state, device), on_device(objective, device)
    config = replace(config, misplaced=on_device(config.misplaced, device))
    began = time.perf_counter()
    while state.step < config.last:
        doing = f"fitting, step {state.step + 1:,} of {config.steps:,}, {len(state.parameters):,} surfels"
        progress(state.step / config.steps, doing)
        state = train_step(state, config, objective)
        ends = state.step == config.last
        if config.checkpoint is not None and (ends or state.step % config.checkpoint.every == 0):
            seconds = before.seconds + time.perf_counter() - began
            save_state(
                config.checkpoint,
                state_on(state, CPU),
                Spent(seconds, max(before.peak_mib, peak_memory_mib())),
            )
    return state_on(state, CPU)


def train_step(state: FitState, config: TrainConfig, objective: Objective) -> FitState:
    """One step, and what densification is due after it; ``state`` is used up.

    Raises:
        MethodError: The loss or a gradient is not finite.
    """
    share = state.step / config.steps
    values = leaves(state, config.rates, share)
    result = objective(values, state.step)
    check_loss(result.loss, state.step)
    gradients = _gradients(result, values)
    if result.offsets is not None and result.radius is not None:
        screen = watch_screen(state.screen, gradients.pop(_OFFSETS), result.radius, result.size)
        state = replace(state, screen=screen)
    return _densified(adam_step(state, gradients, config.rates, share), config)


_OFFSETS = "offsets on the image"


def _gradients(result: LossResult, values: Mapping[str, torch.Tensor]) -> dict[str, torch.Tensor]:
    """Gradients of the loss by name; a parameter that moves but was not used has one of zero."""
    asked = {name: v for name, v in values.items() if v.requires_grad}
    if result.offsets is not None:
        asked[_OFFSETS] = result.offsets
    inputs = list(asked.values())
    if not inputs:  # a step in which nothing moves, as a schedule may have
        return {}
    found = torch.autograd.grad(result.loss, inputs, allow_unused=True, materialize_grads=True)
    return dict(zip(asked, found, strict=True))


def _densified(state: FitState, config: TrainConfig) -> FitState:
    if config.rules is None:
        return state
    rules, step, budget = config.rules, state.step, config.steps
    if rules.densifies(step, budget):
        # Pruning comes first: it looks at what was seen on the screen, which densifying forgets.
        state = prune(state, rules, config.extent, rules.was_reset(step, budget))
        if config.misplaced is not None:
            state = keep(state, ~config.misplaced(state.parameters.surfels))
        state = densify(state, rules, config.extent)
    return reset_opacity(state, rules) if rules.resets(step, budget) else state
