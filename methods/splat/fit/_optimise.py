# SPDX-License-Identifier: Apache-2.0
"""Adam on surfels that come and go: the whole state of a fit is explicit, and a step is a function of it."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import torch

from graycard import MethodError
from graycard.methods.splat._devices import on_device
from graycard.methods.splat.fit._adam import move_all
from graycard.methods.splat.fit._moved import Moved
from graycard.methods.splat.fit._parameters import CENTRES, Parameters

EPSILON = 1e-15
"""Epsilon of Adam: the gradients of surfels are small numbers (Kerbl et al. 2023)."""


@dataclass(frozen=True, slots=True)
class LearningRateSchedule:
    """A learning rate over a fit: from ``start`` to ``end`` exponentially, and zero outside its windows.

    Raises:
        ValueError: A rate is not positive, or a window is not a part of the fit.
    """

    start: float
    end: float | None = None
    """Equal to ``start`` if None."""
    windows: tuple[tuple[float, float], ...] = ((0.0, 1.0),)
    """Shares of the budget, from and until, in which the parameter moves; ends excluded."""

    def __post_init__(self) -> None:
        if not self.start > 0 or not (self.end is None or self.end > 0):
            raise ValueError(f"expected positive rates, got {self.start} and {self.end}")
        if any(not 0 <= first < last <= 1 for first, last in self.windows):
            raise ValueError(f"expected windows within 0 to 1, got {self.windows}")

    def at(self, share: float) -> float:
        """Return the rate when a share of the budget, 0 to 1, is spent."""
        if not any(first <= share < last for first, last in self.windows):
            return 0.0
        end = self.start if self.end is None else self.end
        return self.start * (end / self.start) ** share

    def times(self, factor: float) -> "LearningRateSchedule":
        """Return the rate of a parameter in another unit."""
        return replace(self, start=self.start * factor, end=None if self.end is None else self.end * factor)


@dataclass(frozen=True, eq=False)
class AdamMoments:
    """State that Adam remembers of one parameter."""

    first: torch.Tensor
    """Running mean of the gradient, in the shape of the parameter."""
    second: torch.Tensor
    """Running mean of its square."""
    steps: torch.Tensor
    """Count: how often the parameter was moved, float32, no dimension: corrects the means, which begin at
    zero."""


@dataclass(frozen=True, eq=False)
class ScreenStatistics:
    """Statistics of each surfel on the screen since the last densification, each of shape ``(N,)``."""

    gradient: torch.Tensor
    """Sum over views of the length of the loss's gradient in normalised device coordinates."""
    views: torch.Tensor
    """In how many views the surfel had such a gradient."""
    radius: torch.Tensor
    """The largest radius, three standard deviations, in shares of the width of the image."""


@dataclass(frozen=True, eq=False)
class FitState:
    """Everything that the next step of a fit depends on."""

    step: int
    """Steps that are done."""
    parameters: Parameters
    moments: Mapping[str, AdamMoments]
    """By the names of the parameters, surfels' and shared."""
    screen: ScreenStatistics
    random: torch.Tensor
    """State of a ``torch.Generator``."""


def initial_state(parameters: Parameters, seed: int) -> FitState:
    """Return the state before the first step."""
    parameters = Parameters(_dense(parameters.surfels), _dense(parameters.shared))
    moments = {name: _no_moments(values) for name, values in parameters.all.items()}
    random = torch.Generator().manual_seed(seed).get_state()
    return FitState(0, parameters, moments, nothing_seen(parameters), random)


def state_on(state: FitState, device: torch.device) -> FitState:
    """Return the state with its parameters, moments and statistics on a device.

    Counts of moves and the random state stay on the CPU: what is drawn there is the same for all devices.
    """
    moments = {
        name: replace(m, first=m.first.to(device), second=m.second.to(device))
        for name, m in state.moments.items()
    }
    parameters, screen = (on_device(part, device) for part in (state.parameters, state.screen))
    return replace(state, parameters=parameters, moments=moments, screen=screen)


def nothing_seen(parameters: Parameters) -> ScreenStatistics:
    """Statistics before the first view."""
    zeros = parameters.surfels[CENTRES].new_zeros(len(parameters), dtype=torch.float32)
    return ScreenStatistics(zeros, zeros.clone(), zeros.clone())


def leaves(
    state: FitState, rates: Mapping[str, LearningRateSchedule], share: float
) -> dict[str, torch.Tensor]:
    """All parameters by name for one step; those with a rate above zero require gradients."""
    moving = {name for name, rate in rates.items() if rate.at(share) > 0}
    return {name: p.detach().requires_grad_(name in moving) for name, p in state.parameters.all.items()}


def adam_step(
    state: FitState,
    gradients: Mapping[str, torch.Tensor],
    rates: Mapping[str, LearningRateSchedule],
    share: float,
) -> FitState:
    """Move the parameters that have a gradient (Kingma and Ba 2015), and count the step.

    The tensors of ``state`` are changed in place: it is used up, and only what is returned counts.

    Args:
        state: Before the step.
        gradients: By name; a parameter without one stays, and so do its moments.
        rates: By name.
        share: What is spent of the budget, 0 to 1.

    Raises:
        MethodError: A gradient is not finite.
        ValueError: A parameter is not float32.
    """
    everything, moved = state.parameters.all, []
    _check_finite(gradients, state.step)
    for name, gradient in gradients.items():
        m = state.moments[name]
        m.steps.add_(1)
        means, rate = (m.first, m.second), rates[name].at(share)
        moved.append(Moved(everything[name], gradient.contiguous(), *means, rate, int(m.steps)))
    move_all(moved, EPSILON)
    return replace(state, step=state.step + 1)


def check_loss(loss: torch.Tensor, step: int) -> None:
    """Stop where there is no way on.

    Raises:
        MethodError: The loss is not finite.
    """
    if not bool(torch.isfinite(loss)):
        raise MethodError(
            f"expected a finite loss, got {float(loss.detach())} at step {step}. Lower the learning rates, "
            "or look for photographs with values that are not finite"
        )


def watch_screen(
    screen: ScreenStatistics, to_offsets: torch.Tensor, radius: torch.Tensor, size: tuple[int, int]
) -> ScreenStatistics:
    """Add what one view says about the surfels.

    Args:
        screen: What the views before said.
        to_offsets: shape ``(N, 2)``: the loss's gradient in x and y on the image, per pixel. A surfel
            without any was not seen.
        radius: shape ``(N,)``: on the image, in shares of its width.
        size: Width and height of the image, pixels. The gradient is counted per half an image, so that the
            same threshold holds at every resolution (Kerbl et al. 2023, their code).
    """
    lengths = (to_offsets * to_offsets.new_tensor([size[0] / 2, size[1] / 2])).norm(dim=1)
    seen = lengths > 0
    return ScreenStatistics(
        screen.gradient + lengths,
        screen.views + seen,
        torch.maximum(screen.radius, torch.where(seen, radius, 0.0)),
    )


def _dense(values: Mapping[str, torch.Tensor]) -> dict[str, torch.Tensor]:
    """Return Copies, which steps may change, in C order: the kernel of Adam reads memory as it lies."""
    return {name: v.clone(memory_format=torch.contiguous_format) for name, v in values.items()}


def _no_moments(values: torch.Tensor) -> AdamMoments:
    return AdamMoments(torch.zeros_like(values), torch.zeros_like(values), torch.zeros(()))


def _check_finite(gradients: Mapping[str, torch.Tensor], step: int) -> None:
    """Refuse gradients that are not finite. A sum is finite if its terms are: look closer only
    where one is not.
    """
    sums = [gradient.sum() for gradient in gradients.values()]
    if not sums or bool(torch.stack(sums).isfinite().all()):
        return
    for name, gradient in gradients.items():
        if bool(torch.isfinite(gradient).all()):
            continue
        row = int((~torch.isfinite(gradient)).nonzero()[0, 0]) if gradient.ndim else 0
        raise MethodError(
            f"expected finite gradients, got one of {name!r} that is not at step {step} (row {row}). "
            "Lower its learning rate"
        )
