# SPDX-License-Identifier: Apache-2.0
"""Adaptive aggregation: lamps are pruned, merged, split and moved where that lowers the loss.

The paper says that lamps are aggregated adaptively, and its figures show that some are out; not how. Here
changes are tried on all views at half their size, and the best of a kind is kept if the loss over all pixels
of all views falls (inferred). Views larger than a tile are made smaller for it: its cost does not grow.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import torch

from graycard.methods.gsid._candidates import CLEAR
from graycard.methods.gsid._lights import (
    AMPLITUDES,
    DARK,
    DIMMEST,
    FIRST_SHARPNESS,
    LAMPS,
    POSITIONS,
    SHARPNESS,
    lamps_from,
)
from graycard.methods.gsid._model import LitPicture
from graycard.methods.gsid._objective import DeferredView, GsidObjective, Surfaces
from graycard.methods.gsid._settings import GsidSettings
from graycard.methods.gsid._stage import LightStage, at_half_size, at_tile_size, objective_in
from graycard.methods.splat import FitState, Parameters

HEIGHT = 0.25
"""Shares of the extent: how far over the place that lacks light a lamp begins anew."""
APART = 0.1
"""Shares of the extent: how far the halves of a lamp begin from its place."""
STRENGTHS = (1.0, 0.3)
"""Shares of the missing light with which a moved lamp is tried."""
_SMOOTH = 3
"""Pixels, of views of half the size, over which missing light is averaged: a highlight is no lamp."""

Lights = Mapping[str, torch.Tensor]
"""The parameters of all lights by name."""


@dataclass(frozen=True, eq=False)
class Lack:
    """A place that lacks light."""

    position: torch.Tensor
    """Place where a lamp would help, shape ``(3,)``, metres."""
    intensity: torch.Tensor
    """Intensity of a lamp there that shines alike all round, shape ``(3,)``, W/sr times exposure."""


@torch.no_grad()
def aggregated(state: FitState, stage: LightStage) -> FitState:
    """Return a state whose lamps were changed wherever that lowers the loss over all views.

    In turn: the weakest lamp is put out; the two that are nearest become one; the brightest becomes two; and
    one that is out shines where light is missing. The best of each kind is kept, if it lowers the loss.

    Args:
        state: Of the second stage; used up.
        stage: What is looked at.
    """
    if stage.settings.lamps == 0:
        return state
    parameters = state.parameters
    kept = _trial_of(parameters, stage)
    for proposals in (_pruned, _merged, _split, _put):
        kept = kept.best(proposals(kept))
    changed = torch.zeros(stage.settings.lamps, dtype=torch.bool)
    for name in LAMPS:
        changed |= (kept.lights[name] != parameters.shared[name]).flatten(1).any(dim=1)
    for name in LAMPS:
        state.moments[name].first[changed] = 0
        state.moments[name].second[changed] = 0
    return replace(state, parameters=replace(parameters, shared=dict(kept.lights)))


@torch.no_grad()
def without_dim_lamps(state: FitState, stage: LightStage) -> FitState:
    """Return a state without the lamps that give less than a share of what all lamps give to the views.

    A lamp may send most of its light to where no camera looks, so what it sends says little.

    Args:
        state: Of the second stage.
        stage: What is looked at; ``least_share`` of its settings is the share.
    """
    if stage.settings.lamps == 0:
        return state
    given = _trial_of(state.parameters, stage).given
    kept = given >= stage.settings.least_share * given.sum()
    shared = {name: v[kept] if name in LAMPS else v for name, v in state.parameters.shared.items()}
    moments = {
        name: replace(m, first=m.first[kept], second=m.second[kept]) if name in LAMPS else m
        for name, m in state.moments.items()
    }
    return replace(state, parameters=replace(state.parameters, shared=shared), moments=moments)


def _trial_of(parameters: Parameters, stage: LightStage) -> "_Trial":
    """Return the lights as they are, with views of no more than one and a half tiles a side."""
    whole = at_tile_size(stage, parameters)
    return _Trial(whole, at_half_size(whole, parameters), parameters)


@dataclass(frozen=True, eq=False)
class _Trial:
    """Lights, and how well they explain all views."""

    stage: LightStage
    """Stage with views of no more than one and a half tiles a side."""
    half: LightStage
    """Stage with views of half the size, on which all proposals are tried."""
    parameters: Parameters
    seen: Surfaces = field(default_factory=Surfaces)
    """Surfaces in the views of :attr:`stage`; proposals change lights alone, and share it."""
    half_seen: Surfaces = field(default_factory=Surfaces)
    """Surfaces in the views of :attr:`half`."""

    @property
    def lights(self) -> Lights:
        return self.parameters.shared

    @property
    def settings(self) -> GsidSettings:
        return self.stage.settings

    @cached_property
    def loss(self) -> float:
        """Loss over all pixels of all views."""
        objective = replace(objective_in(self.stage, self.parameters), surfaces=self.seen)
        return objective.over_all(self.parameters.all)

    @cached_property
    def half_objective(self) -> GsidObjective:
        return replace(objective_in(self.half, self.parameters), surfaces=self.half_seen)

    @cached_property
    def half_loss(self) -> float:
        return self.half_objective.over_all(self.parameters.all)

    def best(self, proposals: Iterator[Lights]) -> "_Trial":
        """Return the best proposal at half the size, if it is better than this at half and full size; else
        this.
        """
        trials = [replace(self, parameters=replace(self.parameters, shared=dict(p))) for p in proposals]
        best = min(trials, key=lambda trial: trial.half_loss, default=self)
        return best if best.half_loss < self.half_loss and best.loss < self.loss else self

    def pictures(self) -> Iterator[LitPicture]:
        """Yield all tiles of all views."""
        objective = self.half_objective
        return (objective.picture(self.parameters.all, number) for number in range(len(objective.shots)))

    @cached_property
    def given(self) -> torch.Tensor:
        """Mean brightness that each lamp gives to what is seen, shape ``(K,)``."""
        return torch.stack([p.by_lamp.mean(dim=(0, 1, 3)) for p in self.pictures()]).mean(dim=0)

    @property
    def shining(self) -> torch.Tensor:
        """Lamps that give a share worth the name, by number, brightest first."""
        order = self.given.argsort(descending=True)
        return order[self.given[order] >= max(self.settings.least_share * float(self.given.sum()), 1e-12)]

    @property
    def out(self) -> int | None:
        """The number of the lamp that gives least, if it is next to out."""
        least = int(self.given.argmin())
        return least if self.given[least] < self.settings.least_share * self.given.sum() else None


def _changed(lights: Lights) -> dict[str, torch.Tensor]:
    return {name: values.clone() for name, values in lights.items()}


def _pruned(trial: _Trial) -> Iterator[Lights]:
    """Yield the lights without the weakest lamp that shines."""
    shining = trial.shining
    if len(shining):
        lights = _changed(trial.lights)
        lights[AMPLITUDES][shining[-1]] = DARK
        yield lights


def _merged(trial: _Trial) -> Iterator[Lights]:
    """Yield the lights with the two nearest lamps as one, between them, that sends what both sent."""
    shining = trial.shining
    if len(shining) < 2:
        return
    places = trial.lights[POSITIONS][shining]
    apart = torch.cdist(places, places) + torch.diag(torch.full((len(places),), torch.inf))
    one, other = (int(shining[i]) for i in divmod(int(apart.argmin()), len(places)))
    flux = lamps_from(trial.lights).flux().sum(dim=-1)[[one, other]]
    share = flux / flux.sum()
    lights = _changed(trial.lights)
    for name in LAMPS:
        mean = (lights[name][[one, other]] * share.reshape(-1, *[1] * (lights[name].ndim - 1))).sum(dim=0)
        lights[name][one] = mean
    lights[AMPLITUDES][one] = trial.lights[AMPLITUDES][[one, other]].exp().sum(dim=0).log()
    lights[AMPLITUDES][other] = DARK
    yield lights


def _split(trial: _Trial) -> Iterator[Lights]:
    """Yield the lights with the brightest lamp as two halves beside its place, if another lamp is out."""
    shining, other = trial.shining, trial.out
    if other is None or not len(shining):
        return
    brightest = int(shining[0])
    for axis in torch.eye(3):
        lights = _changed(trial.lights)
        for name in LAMPS:
            lights[name][other] = lights[name][brightest]
        for half, way in ((brightest, 1), (other, -1)):
            lights[POSITIONS][half] += way * APART * trial.stage.extent * axis
            lights[AMPLITUDES][half] += torch.tensor(0.5).log()
        yield lights


def _put(trial: _Trial) -> Iterator[Lights]:
    """Yield the lights with a lamp more where light is missing, unless one is there that does not help."""
    out, extent = trial.out, trial.stage.extent
    if out is None:
        return
    lack = largest_lack(trial.half_objective.shots, trial.pictures(), extent)
    if _is_near(lack.position, trial, CLEAR * extent):
        return
    lobes = trial.settings.lobes
    for strength in STRENGTHS:
        lights = _changed(trial.lights)
        lights[POSITIONS][out] = lack.position
        steps = torch.linspace(0, 0.5 * (lobes - 1), lobes)
        lights[SHARPNESS][out] = torch.tensor(FIRST_SHARPNESS).log() + steps
        lights[AMPLITUDES][out] = (strength * lack.intensity / lobes).log().clamp(min=DIMMEST)
        yield lights


def _is_near(place: torch.Tensor, trial: _Trial, reach: float) -> bool:
    others = trial.lights[POSITIONS][trial.shining]
    return bool(len(others)) and float((others - place).norm(dim=-1).min()) < reach


def largest_lack(shots: Sequence[DeferredView], pictures: Iterable[LitPicture], extent: float) -> Lack:
    """Return the place where photographs are brighter than pictures by most, over a few pixels."""
    most, position, lacking, height = -torch.inf, torch.zeros(3), torch.zeros(3), HEIGHT * extent
    for shot, picture in zip(shots, pictures, strict=True):
        missing = _blurred(shot.linear - picture.whole)
        covered = torch.where(shot.ground.drawn.alpha > 0.9, missing.mean(dim=-1), -torch.inf)
        row, column = divmod(int(covered.argmax()), covered.shape[1])
        if float(covered[row, column]) >= most:
            most, lacking = float(covered[row, column]), missing[row, column]
            position = shot.ground.points[row, column] + height * shot.ground.normal[row, column]
    # what a surface of the mean albedo returns, turned round
    return Lack(position, lacking.clamp(min=1e-4) * torch.pi * height**2 / 0.4)


def _blurred(image: torch.Tensor) -> torch.Tensor:
    padded = image.permute(2, 0, 1)[None]
    mean = torch.nn.functional.avg_pool2d(padded, _SMOOTH, 1, _SMOOTH // 2, count_include_pad=False)
    return mean[0].permute(1, 2, 0)
