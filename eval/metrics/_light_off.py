# SPDX-License-Identifier: Apache-2.0
"""Pictures with one light switched off: is what a method calls one light really the light of that lamp?

Light adds up, so a picture without a lamp is the whole picture less that lamp's share of it. A lamp of the
truth is switched off in the prediction by taking away the share of the one that stands for it. To dim the
whole picture is nearer to that truth than to do nothing, and takes no knowledge of any light: it is what a
light switched off has to beat, too.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from graycard import PredictionError
from graycard.eval.measures._psnr import psnr
from graycard.eval.metrics._image_metric import display
from graycard.eval.metrics._view_metrics import mean, pooled
from graycard.eval.scoring._assembly import Finding, Scene, status_of
from graycard.eval.scoring._readings import PredictedView, TrueView, with_darkness
from graycard.records import MetricRecord, Score

PART = "radiance"
LEAST_EFFECT = 1e-5
"""Mean square of what a light adds to a view as displayed: with less (50 dB) nothing is seen of it there."""

_ENOUGH = 10_000
"""Pixels that a factor of a whole picture is found by."""

_PSNR = MetricRecord(
    "light_off.psnr", "One light switched off, PSNR", "light_off", "dB", True, math.inf,
    "10·log10(1 / mean over views and over the true local lights of MSE) of radiance - radiance.<light> as "
    "displayed, srgb(L·exposure), over the mask without lights; lights that add an MSE of less than "
    f"{LEAST_EFFECT:g} to a view are not asked for there; one that the prediction has not stays on",
    headline=False, tolerance=0.3,
)  # fmt: skip
_BETTER = MetricRecord(
    "light_off.better", "Lights better off than on", "light_off", "%", True, 100.0,
    "mean over views of the share of these lights without which the predicted picture is nearer to the true "
    "one without them than it is with them, and than it is dimmed as a whole by the factor that brings it "
    "nearest to that truth", headline=False, tolerance=10.0,
)  # fmt: skip
OFF_METRICS: tuple[MetricRecord, ...] = (_PSNR, _BETTER)


class Errors(NamedTuple):
    """Mean square errors of one view against the truth without a light, one for each that is asked for."""

    off: list[float]
    """Of the predicted picture without it."""
    on: list[float]
    """Of the predicted picture with it."""
    dimmed: list[float]
    """Of the predicted picture with it, times the factor in [0, 1] that fits best."""


@dataclass(slots=True)
class LightsOff:
    """What is found while the test views pass by."""

    lights: Sequence[str]
    """Names of the true lights that have a place."""
    names: Mapping[str, str] | None = None
    """True names of lights by predicted ones; None where they are as they are."""
    found: dict[str, Errors | str] = field(default_factory=dict)
    """By view: the errors, or why there are none."""
    provided: bool = False
    unreadable: list[str] = field(default_factory=list)

    def observe(self, predicted: PredictedView, true: TrueView, scene: Scene) -> None:
        """Judge a test view; a fault of the prediction is found, not raised.

        Raises:
            DatasetError: The truth of the view is broken.
        """
        layers = [f"{PART}.{light}" for light in self.lights if f"{PART}.{light}" in true.layers]
        mask = true.mask("shading")
        if not layers or not mask.any():
            return
        whole = true.take(PART)[mask].astype(np.float64)
        without = {name: np.maximum(whole - true.take(name)[mask], 0) for name in layers}
        asked = {
            name: left
            for name, left in without.items()
            if _error(whole, left, scene.exposure) >= LEAST_EFFECT
        }
        if not asked:
            return
        self.unreadable += [predicted.fault] if predicted.fault else []
        self.provided |= self._tells(predicted)
        try:
            lit = with_darkness(predicted, layers, self.names)
            self.found[true.view.name] = _errors(lit, asked, mask, scene.exposure)
        except PredictionError as cause:
            self.found[true.view.name] = str(cause)

    def _tells(self, predicted: PredictedView) -> bool:
        """Whether a view has shares of lights: of a true one, or of any where the lights are listed."""
        shares = {name.removeprefix(f"{PART}.") for name in predicted.layers if name.startswith(f"{PART}.")}
        return bool(shares & ({*self.lights} if self.names is None else {*self.names.values()}))

    def scores(self) -> list[Score]:
        """None where no light is to be seen at work."""
        if not self.found:
            return []
        squares = {view: _finding(found, _square) for view, found in self.found.items()}
        shares = {view: _finding(found, _share_better) for view, found in self.found.items()}
        status, reason = status_of(f"{PART}.<light>", squares, self.provided, self.unreadable)
        return [
            pooled(_PSNR, psnr, squares, status=status, reason=reason),
            pooled(_BETTER, float, shares, status=status, reason=reason),
        ]


def _errors(
    predicted: PredictedView, asked: Mapping[str, np.ndarray], mask: np.ndarray, exposure: float
) -> Errors:
    whole = predicted.take(PART)[mask].astype(np.float64)
    found = Errors([], [], [])
    for name, left in asked.items():
        found.off.append(_error(np.maximum(whole - predicted.take(name)[mask], 0), left, exposure))
        found.on.append(_error(whole, left, exposure))
        found.dimmed.append(_error(_dimming(whole, left, exposure) * whole, left, exposure))
    return found


def _dimming(picture: np.ndarray, target: np.ndarray, exposure: float) -> float:
    """The factor in [0, 1] that brings a picture nearest to another as displayed, to 1e-4."""
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
    """Mean square of what differs as displayed."""
    return float(np.mean((display(first, exposure) - display(second, exposure)) ** 2))


def _finding(found: Errors | str, judge: Callable[[Errors], Finding]) -> Finding:
    return Finding(reason=found) if isinstance(found, str) else judge(found)


def _square(errors: Errors) -> Finding:
    return Finding(mean(errors.off), parts={"left on": mean(errors.on), "dimmed": mean(errors.dimmed)})


def _share_better(errors: Errors) -> Finding:
    than_on = [float(off < on) for off, on, _ in zip(*errors, strict=True)]
    than_both = [float(off < min(on, dimmed)) for off, on, dimmed in zip(*errors, strict=True)]
    return Finding(100 * mean(than_both), parts={"than left on": 100 * mean(than_on)})
