# SPDX-License-Identifier: Apache-2.0
"""Pictures with one light switched off: they test that each predicted light is the light of one lamp.

Light adds up, so a picture without a lamp is the whole picture less that lamp's share of it. A lamp of the
truth is switched off in the prediction by taking away the share of the one that stands for it. To dim the
whole picture is nearer to that truth than to do nothing, and takes no knowledge of any light: it is what a
light switched off has to beat, too.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from graycard import EnvironmentLight, PredictionError, Predictions, Truth
from graycard.eval.kinds._metric import Metric, Rule, Scorer
from graycard.eval.kinds._records import decibels, share
from graycard.eval.kinds._references import PSNR
from graycard.eval.measures._psnr import psnr
from graycard.eval.measures._spaces import display, same
from graycard.eval.scoring._ceiling import NO_VARIANCE
from graycard.eval.scoring._findings import Finding, SceneFacts, mean, pooled, status_of
from graycard.eval.scoring._readings import PredictedView, TrueView, with_darkness
from graycard.records import Score

PART = "radiance"
LEAST_EFFECT = 1e-5
"""Mean square of what a light adds to a view as displayed: with less (50 dB) nothing is seen of it there."""

_ENOUGH = 10_000
"""Pixels that a factor of a whole picture is found by."""


class Errors(NamedTuple):
    """Mean square errors of one view against the truth without a light, one for each visible light."""

    off: list[float]
    """PSNR of the predicted picture without it."""
    on: list[float]
    """PSNR of the predicted picture with it."""
    dimmed: list[float]
    """PSNR of the predicted picture with it, times the factor in [0, 1] that fits best."""


@dataclass(frozen=True, slots=True)
class LightsOffRule(Rule):
    """Computes one number from the errors of pictures with one light switched off."""

    judge: Callable[[Errors], Finding]
    """From the errors of a view to its finding."""
    finish: Callable[[float], float] = same
    """Applied to the mean over views."""

    @classmethod
    def scorer(
        cls,
        metrics: "Sequence[Metric[LightsOffRule]]",
        predictions: Predictions,
        truth: Truth,
        scene: SceneFacts,
    ) -> "LightsOffScorer":
        """Begin to score; see :class:`Rule`."""
        lights = [light.name for light in truth.lights() if not isinstance(light, EnvironmentLight)]
        return LightsOffScorer(metrics, lights)


@dataclass(slots=True)
class LightsOffScorer(Scorer):
    """Errors without each light, gathered while the test views pass by."""

    metrics: Sequence[Metric[LightsOffRule]]
    lights: Sequence[str]
    """Names of the true lights that have a place."""
    found: dict[str, Errors | str] = field(default_factory=dict)
    """By view: the errors, or why there are none."""
    provided: bool = False
    unreadable: list[str] = field(default_factory=list)

    def observe(self, predicted: PredictedView, true: TrueView, scene: SceneFacts) -> None:
        """Judge a test view; see :class:`Scorer`."""
        layers = [f"{PART}.{light}" for light in self.lights if f"{PART}.{light}" in true.layers]
        mask = true.mask("shading")
        if not layers or not mask.any():
            return
        whole = true.take(PART)[mask].astype(np.float64)
        without = {name: np.maximum(whole - true.take(name)[mask], 0) for name in layers}
        visible = {
            name: left
            for name, left in without.items()
            if _error(whole, left, scene.exposure) >= LEAST_EFFECT
        }
        if not visible:
            return
        self.unreadable += [predicted.fault] if predicted.fault else []
        self.provided |= self._has_shares(predicted, scene)
        try:
            lit = with_darkness(predicted, layers, scene.light_names)
            self.found[true.view.name] = _errors(lit, true, visible, scene.exposure)
        except PredictionError as cause:
            self.found[true.view.name] = str(cause)

    def _has_shares(self, predicted: PredictedView, scene: SceneFacts) -> bool:
        """Tell whether a view has the share of a true light, or of any where the lights are listed."""
        shares = {n.removeprefix(f"{PART}.") for n in predicted.provided if n.startswith(f"{PART}.")}
        names = scene.light_names
        return bool(shares & ({*self.lights} if names is None else {*names.values()}))

    def scores(self) -> list[Score]:
        """Return one score for each metric; none where no light is to be seen at work."""
        return [self._score(metric) for metric in self.metrics] if self.found else []

    def _score(self, metric: Metric[LightsOffRule]) -> Score:
        judge = metric.rule.judge
        findings = {
            view: Finding(reason=errors) if isinstance(errors, str) else judge(errors)
            for view, errors in self.found.items()
        }
        status, reason = status_of(f"{PART}.<light>", findings, self.provided, self.unreadable)
        return pooled(metric.record, metric.rule.finish, findings, status=status, reason=reason)


def _errors(
    predicted: PredictedView, true: TrueView, visible: Mapping[str, np.ndarray], exposure: float
) -> Errors:
    mask = true.mask("shading")
    whole = predicted.take(PART, true.mask(PART))[mask].astype(np.float64)
    found = Errors([], [], [])
    for name, left in visible.items():
        share = predicted.take(name, mask)[mask]
        found.off.append(_error(np.maximum(whole - share, 0), left, exposure))
        found.on.append(_error(whole, left, exposure))
        found.dimmed.append(_error(_dimming(whole, left, exposure) * whole, left, exposure))
    return found


def _dimming(picture: np.ndarray, target: np.ndarray, exposure: float) -> float:
    """Return the factor in [0, 1] that brings a picture nearest to another as displayed, to 1e-4."""
    from scipy.optimize import minimize_scalar

    every = max(1, len(picture) // _ENOUGH)
    some, other = picture[::every], target[::every]
    found = minimize_scalar(
        lambda factor: _error(factor * some, other, exposure),
        bounds=(0.0, 1.0),
        method="bounded",
        options={"xatol": 1e-4},
    )
    return float(found.x)


def _error(first: np.ndarray, second: np.ndarray, exposure: float) -> float:
    """Return the mean square of the difference as displayed."""
    return float(np.mean((display(first, exposure) - display(second, exposure)) ** 2))


def _square(errors: Errors) -> Finding:
    return Finding(mean(errors.off), parts={"left on": mean(errors.on), "dimmed": mean(errors.dimmed)})


def _share_better(errors: Errors) -> Finding:
    than_on = [float(off < on) for off, on, _ in zip(*errors, strict=True)]
    than_both = [float(off < min(on, dimmed)) for off, on, dimmed in zip(*errors, strict=True)]
    return Finding(100 * mean(than_both), parts={"than left on": 100 * mean(than_on)})


_LIGHTS = (PART, f"{PART}.<light>")

METRICS: tuple[Metric[LightsOffRule], ...] = (
    Metric(
        record=decibels(
            "light_off",
            "psnr",
            "One light switched off, PSNR",
            "10·log10(1 / mean over views and over the true local lights of MSE) of radiance - "
            "radiance.<light> as displayed, srgb(L·exposure), over the mask without lights; lights that add "
            f"an MSE of less than {LEAST_EFFECT:g} to a view are not asked for there; one that the "
            "prediction has not stays on",
        ),
        rule=LightsOffRule(_square, psnr),
        layers=_LIGHTS,
        ceiling=NO_VARIANCE,
        references=(PSNR,),
        breakdown=("left on", "dimmed"),
    ),
    Metric(
        record=share(
            "light_off",
            "better",
            "Lights better off than on",
            "mean over views of the share of these lights without which the predicted picture is nearer to "
            "the true one without them than it is with them, and than it is dimmed as a whole by the factor "
            "that brings it nearest to that truth",
            percent=True,
            tolerance=10.0,
        ),
        rule=LightsOffRule(_share_better),
        layers=_LIGHTS,
        ceiling=NO_VARIANCE,
        references=(PSNR,),
        breakdown=("than left on",),
    ),
)
