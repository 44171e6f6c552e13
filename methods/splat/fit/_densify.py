# SPDX-License-Identifier: Apache-2.0
"""More surfels where the picture asks for them, fewer where they do nothing (Kerbl et al. 2023, section 5.2).

Every function takes a state and gives another; nothing is changed in place.
"""

from dataclasses import dataclass, replace

import torch

from graycard.methods.splat._geometry import rotation_matrices
from graycard.methods.splat.fit._optimise import AdamMoments, FitState, nothing_seen
from graycard.methods.splat.fit._parameters import CENTRES, LOG_SCALES, LOGITS, ROTATIONS


@dataclass(frozen=True, slots=True)
class DensityRules:
    """Densification rules; the defaults are those of 2D Gaussian Splatting.

    Times are shares of the budget of steps, sizes are shares of the scene's extent.

    Raises:
        ValueError: A share is outside [0, 1], or a number makes no sense.
    """

    start: float = 1 / 60
    until: float = 0.5
    every: float = 1 / 300
    reset_every: float = 0.1
    """Between resets of the opacity; none happens after ``until``."""
    gradient: float = 2e-4
    """Mean length of the loss's gradient in normalised device coordinates above which a surfel is not
    enough."""
    small: float = 0.01
    """Size limit, a share of the extent: a surfel up to this size is cloned, a larger one is split."""
    children: int = 2
    """Number of parts of a split surfel; each is smaller by 0.8 times their number."""
    least_opacity: float = 0.05
    largest: float | None = 0.1
    """Size limit, a share of the extent: a larger surfel goes, once the opacity was reset; None: none
    goes."""
    largest_on_screen: float | None = None
    """Three standard deviations, of the image's width: as ``largest``."""
    reset_opacity: float = 0.01
    limit: int | None = None
    """No more surfels than these: those with the largest gradient come first. None: no limit."""
    pauses: tuple[tuple[float, float], ...] = ()
    """From and to which share of the budget surfels neither come nor go."""

    def __post_init__(self) -> None:
        shares = (self.start, self.until, self.least_opacity, self.reset_opacity)
        if not all(0 <= share <= 1 for share in shares):
            raise ValueError(f"expected start, until and opacities in [0, 1], got {shares}")
        positive = (self.every, self.reset_every, self.gradient, self.small, self.children - 1)
        if not all(value > 0 for value in positive):
            raise ValueError(
                f"expected positive intervals, gradient and size, and 2 or more children: {self}"
            )
        if self.limit is not None and self.limit < 1:
            raise ValueError(f"expected a limit of 1 or more surfels, got {self.limit}")

    def densifies(self, step: int, budget: int) -> bool:
        """Return whether surfels come and go after ``step`` steps are done."""
        within = self.start * budget < step < self.until * budget
        paused = any(begin * budget < step <= end * budget for begin, end in self.pauses)
        return within and not paused and step % max(1, round(self.every * budget)) == 0

    def resets(self, step: int, budget: int) -> bool:
        """Return whether opacities are reset after ``step`` steps are done."""
        return 0 < step < self.until * budget and step % max(1, round(self.reset_every * budget)) == 0

    def was_reset(self, step: int, budget: int) -> bool:
        """Return whether opacities were reset before ``step``: from then on the sizes are bounded."""
        return step > max(1, round(self.reset_every * budget))


def densify(state: FitState, rules: DensityRules, extent: float) -> FitState:
    """Clone small surfels and split large ones where the mean screen-space gradient is large.

    A clone is an equal surfel at the same place, of which the next steps make two. The children of a split
    take its place: they are drawn from its Gaussian and smaller. New ones come last, without moments;
    the statistics of the screen begin anew.

    Args:
        state: Before.
        rules: Thresholds.
        extent: Of the scene, metres.

    Returns:
        The state after it; the random state has moved on where something was split.
    """
    asked, sizes = _asked(state, rules), state.parameters.surfels[LOG_SCALES].exp().amax(dim=1)
    large = sizes > rules.small * extent
    cloned, split = (asked & ~large).nonzero()[:, 0], (asked & large).nonzero()[:, 0]
    kept = torch.ones_like(large)
    kept[split] = False
    parents = split.repeat(rules.children)
    order = torch.cat([kept.nonzero()[:, 0], cloned, parents])
    fresh = torch.arange(len(order), device=order.device) >= int(kept.sum())
    grown = _rearranged(state, order, fresh)
    return _scatter_children(grown, len(parents), rules.children)


def prune(state: FitState, rules: DensityRules, extent: float, bound_sizes: bool) -> FitState:
    """Take away surfels that are nearly transparent and, if asked to, those that are too large.

    Args:
        state: Before.
        rules: Thresholds.
        extent: Of the scene, metres.
        bound_sizes: Also apply ``largest`` and ``largest_on_screen``.
    """
    surfels = state.parameters.surfels
    gone = surfels[LOGITS].sigmoid() < rules.least_opacity
    if bound_sizes and rules.largest is not None:
        gone |= surfels[LOG_SCALES].exp().amax(dim=1) > rules.largest * extent
    if bound_sizes and rules.largest_on_screen is not None:
        gone |= state.screen.radius > rules.largest_on_screen
    return keep(state, ~gone)


def keep(state: FitState, kept: torch.Tensor) -> FitState:
    """Only some surfels, with their moments and statistics; ``kept`` has shape ``(N,)``, bool."""
    order = kept.nonzero()[:, 0]
    found = _rearranged(state, order, torch.zeros_like(order, dtype=torch.bool))
    screen = state.screen
    seen = replace(
        screen, gradient=screen.gradient[kept], views=screen.views[kept], radius=screen.radius[kept]
    )
    return replace(found, screen=seen)


def reset_opacity(state: FitState, rules: DensityRules) -> FitState:
    """Lower all opacities to ``rules.reset_opacity``: what is needed grows again, the rest is pruned.

    The moments of the opacities begin anew.
    """
    surfels = dict(state.parameters.surfels)
    bound = torch.logit(torch.tensor(rules.reset_opacity)).to(surfels[LOGITS])
    surfels[LOGITS] = torch.minimum(surfels[LOGITS], bound)
    old = state.moments[LOGITS]
    forgotten = AdamMoments(torch.zeros_like(old.first), torch.zeros_like(old.second), old.steps.clone())
    parameters = replace(state.parameters, surfels=surfels)
    return replace(state, parameters=parameters, moments={**state.moments, LOGITS: forgotten})


def _asked(state: FitState, rules: DensityRules) -> torch.Tensor:
    """Return which surfels are not enough, shape ``(N,)``, bool; each of them makes one more."""
    mean = state.screen.gradient / state.screen.views.clamp(min=1)
    asked = mean > rules.gradient
    if rules.limit is None:
        return asked
    room = max(0, rules.limit - len(mean)) // (rules.children - 1)
    best = torch.argsort(mean, descending=True, stable=True)[: min(room, int(asked.sum()))]
    return torch.zeros_like(asked).index_fill(0, best, True)


def _rearranged(state: FitState, order: torch.Tensor, fresh: torch.Tensor) -> FitState:
    """Surfels in a new order, some of them more than once; fresh ones have no moments."""
    names = state.parameters.surfels
    moments = dict(state.moments)
    for name in names:
        old = state.moments[name]
        first, second = old.first[order], old.second[order]
        first[fresh], second[fresh] = 0, 0
        moments[name] = AdamMoments(first, second, old.steps.clone())
    parameters = state.parameters.take(order)
    return replace(state, parameters=parameters, moments=moments, screen=nothing_seen(parameters))


def _scatter_children(state: FitState, count: int, children: int) -> FitState:
    """Move the last ``count`` surfels to where their parents' Gaussians put them, and shrink them."""
    if count == 0:
        return state
    random = torch.Generator()
    random.set_state(state.random)
    surfels = {name: values.clone() for name, values in state.parameters.surfels.items()}
    axes = rotation_matrices(surfels[ROTATIONS][-count:])[:, :, :2]
    scales = surfels[LOG_SCALES][-count:].exp()
    drawn = torch.randn(count, 2, generator=random, dtype=scales.dtype).to(scales.device) * scales
    surfels[CENTRES][-count:] += (axes * drawn[:, None]).sum(dim=2)
    surfels[LOG_SCALES][-count:] -= torch.log(scales.new_tensor(0.8 * children))
    parameters = replace(state.parameters, surfels=surfels)
    return replace(state, parameters=parameters, random=random.get_state())
