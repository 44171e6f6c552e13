# SPDX-License-Identifier: Apache-2.0
"""What is left of a removed object's mirror image apart from its shadow, and the other way round.

On a polished table both lie on the same pixels, and a method that takes one of them away leaves a share of
the whole that says little of either. The truth knows by which lobe each change of the light comes.
"""

from dataclasses import dataclass

import numpy as np

import graycard as gc
from graycard.eval._image_metric import exposed
from graycard.eval._readings import TrueView
from graycard.eval._removal import LAYER, WHERE, region_of
from graycard.eval._view_metrics import Answer, ViewMetric

LEAST_APART = 0.2
"""Sine of the angle between two effects on a region up to which what is left is not told apart."""
_SPECULAR = "specular", "counterfactual.specular"
"""Layers of the specular light with the target and without it."""
_LOBES = {"mirror": "specular", "shadow": "diffuse"}
"""Which lobe the effect that gives a region its name is in."""


@dataclass(frozen=True, slots=True)
class LobeAsked:
    """What is asked in one region of one view, at those of its pixels that are not overexposed."""

    without: np.ndarray
    """True radiance without the object, shape ``(N, 3)``, exposed."""
    weights: np.ndarray
    """What turns a difference from it into the share that is left, shape ``(N, 3)``."""
    region: np.ndarray
    """Which pixels they are, shape ``(H, W)``, bool."""
    exposure: float


def residual_weights(effect: np.ndarray, other: np.ndarray) -> np.ndarray | None:
    """What tells how much of one effect of an object is still in a picture, where another one overlaps it.

    With weights w and what is left r (a prediction less the true picture without the object), ``sum(w * r)``
    is the coefficient of ``effect`` in the least squares fit of r by both effects together: the projection on
    that part of it which is not alike the other (Frisch and Waugh 1933).

    Args:
        effect: What the object changes by one way of light, any shape.
        other: What it changes by another way, same shape, same unit.

    Returns:
        Same shape; None where the effect is so much alike the other, or so faint, that nobody can tell.

    Example:
        >>> import numpy as np
        >>> shadow, mirrored = np.array([-0.2, -0.2, 0.0]), np.array([0.0, 0.1, 0.1])
        >>> round(float((residual_weights(mirrored, shadow) * (shadow + 0.25 * mirrored)).sum()), 3)
        0.25
    """
    effect, other = (np.asarray(values, np.float64) for values in (effect, other))
    energy = float((other**2).sum())
    own = effect - (float((effect * other).sum()) / energy) * other if energy else effect
    if np.linalg.norm(own) <= LEAST_APART * np.linalg.norm(effect):
        return None
    return own / float((effect * own).sum())


def _asked(true: TrueView, exposure: float, name: str) -> LobeAsked | None:
    with_object, without = (true.take(layer) * float(exposure) for layer in ("radiance", LAYER))
    region = region_of(true, name) & (np.maximum(with_object, without).max(axis=-1) <= 1)
    present, emptied = (true.take(layer)[region] * float(exposure) for layer in _SPECULAR)
    specular = present - emptied
    diffuse = (with_object - without)[region] - specular
    order = (specular, diffuse) if _LOBES[name] == "specular" else (diffuse, specular)
    weights = residual_weights(*order)
    return None if weights is None else LobeAsked(without[region], weights, region, exposure)


def _answer(predicted: np.ndarray, asked: LobeAsked) -> Answer:
    left = exposed(predicted[asked.region], asked.exposure) - asked.without
    share = float((asked.weights * left).sum())
    return Answer(abs(share), {"signed": share})


def _metric(region: str) -> ViewMetric:
    lobe = _LOBES[region]
    record = gc.MetricRecord(
        f"counterfactual.residual.{region}.{lobe}",
        f"Object left over, {region}, {lobe} light",
        "counterfactual", "1", False, 0.0,
        "mean over views of |a| in the least squares fit p - c = a·d + b·e (prediction p, truth without "
        f"object c, d what the object changes in {lobe} light, e in all other; linear, L·exposure, pixels "
        f"where no truth is overexposed) {WHERE[region]}: 0 gone, 1 still there, whatever is left of the "
        f"other; views where d and e are alike (sine of the angle up to {LEAST_APART:g}) are not asked",
        headline=False, tolerance=0.02,
    )  # fmt: skip
    needs = LAYER, f"effect.{region}", *_SPECULAR
    return ViewMetric(record, LAYER, needs, lambda true, exposure: _asked(true, exposure, region), _answer)


REMOVAL_LOBE_METRICS: tuple[ViewMetric, ...] = tuple(_metric(region) for region in _LOBES)
