# SPDX-License-Identifier: Apache-2.0
"""Pictures with one light switched off: is what a method calls one light really the light of that lamp?

Light adds up, so a picture without a lamp is the whole picture less that lamp's share of it. A lamp of the
truth is switched off in the prediction by taking away the share of the one that stands for it.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

import graycard as gc
from graycard.eval._assembly import Finding, Scene, status_of
from graycard.eval._image_metric import display
from graycard.eval._psnr import psnr
from graycard.eval._readings import PredictedView, TrueView, with_darkness
from graycard.eval._view_metrics import mean, pooled

PART = "radiance"
LEAST_EFFECT = 1e-5
"""Mean square of what a light adds to a view as displayed: with less (50 dB) nothing is seen of it there."""

_PSNR = gc.MetricRecord(
    "light_off.psnr", "One light switched off, PSNR", "light_off", "dB", True, math.inf,
    "10·log10(1 / mean over views and over the true local lights of MSE) of radiance - radiance.<light> as "
    "displayed, srgb(L·exposure), over the mask without lights; lights that add an MSE of less than "
    f"{LEAST_EFFECT:g} to a view are not asked for there; one that the prediction has not stays on",
    headline=False, tolerance=0.3,
)  # fmt: skip
_BETTER = gc.MetricRecord(
    "light_off.better", "Lights better off than on", "light_off", "%", True, 100.0,
    "mean over views of the share of these lights without which the predicted picture is nearer to the true "
    "one without them than it is with them", headline=False, tolerance=10.0,
)  # fmt: skip
OFF_METRICS: tuple[gc.MetricRecord, ...] = (_PSNR, _BETTER)


class Errors(NamedTuple):
    """Mean square errors of one view against the truth without a light, one for each that is asked for."""

    off: list[float]
    """Of the predicted picture without it."""
    on: list[float]
    """Of the predicted picture with it."""


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
        shown = display(whole, scene.exposure)
        without = {name: _less(whole, true.take(name)[mask], scene.exposure) for name in layers}
        asked = {name: left for name, left in without.items() if _error(shown, left) >= LEAST_EFFECT}
        if not asked:
            return
        self.unreadable += [predicted.fault] if predicted.fault else []
        self.provided |= any(name in predicted.layers for name in layers)
        try:
            lit = with_darkness(predicted, layers, self.names)
            self.found[true.view.name] = _errors(lit, asked, mask, scene.exposure)
        except gc.PredictionError as cause:
            self.found[true.view.name] = str(cause)

    def scores(self) -> list[gc.Score]:
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
    on = display(whole, exposure)
    off = [_less(whole, predicted.take(name)[mask], exposure) for name in asked]
    return Errors(
        [_error(p, t) for p, t in zip(off, asked.values(), strict=True)],
        [_error(on, t) for t in asked.values()],
    )


def _less(whole: np.ndarray, share: np.ndarray, exposure: float) -> np.ndarray:
    """A picture without the share of a light, as displayed."""
    return display(np.maximum(whole - share, 0), exposure)


def _error(first: np.ndarray, second: np.ndarray) -> float:
    return float(np.mean((first - second) ** 2))


def _finding(found: Errors | str, judge: Callable[[Errors], Finding]) -> Finding:
    return Finding(reason=found) if isinstance(found, str) else judge(found)


def _square(errors: Errors) -> Finding:
    return Finding(mean(errors.off), parts={"left on": mean(errors.on)})


def _share_better(errors: Errors) -> Finding:
    return Finding(100 * mean([float(off < on) for off, on in zip(errors.off, errors.on, strict=True)]))
