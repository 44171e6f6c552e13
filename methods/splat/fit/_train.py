# SPDX-License-Identifier: Apache-2.0
"""The loop of a fit: look, move, now and then add and take away surfels; resume where it was cut off."""

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import torch

from graycard import Progress
from graycard.io import peak_memory_mib
from graycard.methods._resumed import add_resumed
from graycard.methods.splat.fit._checkpoint import NOTHING_SPENT, Checkpoint, Spent, load_saved, save_state
from graycard.methods.splat.fit._densify import DensityRules, densify, prune, reset_opacity
from graycard.methods.splat.fit._optimise import (
    FitState,
    Rate,
    adam_step,
    check_loss,
    leaves,
    watch_screen,
)


@dataclass(frozen=True, eq=False)
class Look:
    """What one step has looked at."""

    loss: torch.Tensor
    """The scalar to lower, differentiable in the parameters."""
    offsets: torch.Tensor | None = None
    """Zeros of shape ``(N, 2)`` that require gradients, as they went into the rasteriser: tell densification
    what the picture asks of each surfel. None where nothing is densified."""
    radius: torch.Tensor | None = None
    """Shape ``(N,)``: largest radius on the image, in shares of its width."""
    size: tuple[int, int] = (1, 1)
    """Width and height of the image, pixels."""


Objective = Callable[[Mapping[str, torch.Tensor], int], Look]
"""From the parameters by name and the number of the step to what is to be lowered: a function of nothing
else, or a fit that was cut off would go on differently."""


@dataclass(frozen=True, eq=False)
class Plan:
    """How a fit goes on.

    Raises:
        ValueError: There is no step.
    """

    steps: int
    rates: Mapping[str, Rate]
    """By the names of parameters; those without a rate stay as they are."""
    extent: float
    """Of the scene, metres."""
    rules: DensityRules | None = None
    """None: no surfel comes or goes."""
    checkpoint: Checkpoint | None = None
    until: int | None = None
    """Stop, and save, after so many of the ``steps``; None: after all of them."""

    @property
    def last(self) -> int:
        """Steps that are done in the end."""
        return self.steps if self.until is None else min(self.until, self.steps)

    def __post_init__(self) -> None:
        if self.steps < 1:
            raise ValueError(f"expected 1 or more steps, got {self.steps}")


def train(state: FitState, plan: Plan, objective: Objective, progress: Progress) -> FitState:
    """Run a fit to its end, from a state or from what was saved of it.

    Equal states, plans and objectives end with equal bits on one machine, however often the fit was cut
    off and resumed.

    Args:
        state: Before the first step; used up.
        plan: Rates, rules and the budget.
        objective: What is to be lowered.
        progress: Called now and then.

    Raises:
        MethodError: A loss or a gradient is not finite, or the checkpoint is damaged or of another fit.
        OutputError: The checkpoint cannot be written.
    """
    saved = None if plan.checkpoint is None else load_saved(plan.checkpoint)
    state, before = (state, NOTHING_SPENT) if saved is None else saved
    add_resumed(before.seconds, before.peak_mib)
    began = time.perf_counter()
    while state.step < plan.last:
        progress(state.step / plan.steps, f"fitting {len(state.parameters)} surfels")
        state = train_step(state, plan, objective)
        ends = state.step == plan.last
        if plan.checkpoint is not None and (ends or state.step % plan.checkpoint.every == 0):
            seconds = before.seconds + time.perf_counter() - began
            save_state(plan.checkpoint, state, Spent(seconds, max(before.peak_mib, peak_memory_mib())))
    return state


def train_step(state: FitState, plan: Plan, objective: Objective) -> FitState:
    """One step, and what densification is due after it; ``state`` is used up.

    Raises:
        MethodError: The loss or a gradient is not finite.
    """
    share = state.step / plan.steps
    values = leaves(state, plan.rates, share)
    look = objective(values, state.step)
    check_loss(look.loss, state.step)
    gradients = _gradients(look, values)
    if look.offsets is not None and look.radius is not None:
        screen = watch_screen(state.screen, gradients.pop(_OFFSETS), look.radius, look.size)
        state = replace(state, screen=screen)
    return _densified(adam_step(state, gradients, plan.rates, share), plan)


_OFFSETS = "offsets on the image"


def _gradients(look: Look, values: Mapping[str, torch.Tensor]) -> dict[str, torch.Tensor]:
    """Gradients of the loss by name; a parameter that moves but was not used has one of zero."""
    asked = {name: v for name, v in values.items() if v.requires_grad}
    if look.offsets is not None:
        asked[_OFFSETS] = look.offsets
    inputs = list(asked.values())
    if not inputs:  # a step in which nothing moves, as a schedule may have
        return {}
    found = torch.autograd.grad(look.loss, inputs, allow_unused=True, materialize_grads=True)
    return dict(zip(asked, found, strict=True))


def _densified(state: FitState, plan: Plan) -> FitState:
    if plan.rules is None:
        return state
    rules, step, budget = plan.rules, state.step, plan.steps
    if rules.densifies(step, budget):
        # Pruning comes first: it looks at what was seen on the screen, which densifying forgets.
        state = prune(state, rules, plan.extent, rules.was_reset(step, budget))
        state = densify(state, rules, plan.extent)
    return reset_opacity(state, rules) if rules.resets(step, budget) else state
