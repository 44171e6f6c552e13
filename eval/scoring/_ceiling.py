# SPDX-License-Identifier: Apache-2.0
"""The best scores that the truth's own noise allows, and how far above them chance may lift a score."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from graycard.eval.measures._spaces import display
from graycard.eval.scoring._readings import TrueView
from graycard.io import blocks
from graycard.records import HOLDS_NOISE

MARGINS: Mapping[str, float] = {"dB": 1.0, "σ": 0.1}
"""By unit: a score that is better than its ceiling by as much owes it to more than chance.

A decibel of an error is a ninth of its root mean square, hence 0.1 σ.
"""


@dataclass(frozen=True, slots=True)
class Ceiling:
    """A statement on the best score that the truth's own noise allows."""

    known: bool
    """Tell whether scores have a noise ceiling."""
    explanation: str
    """Formula, or why there is none."""


AS_DISPLAYED = Ceiling(
    True, "PSNR of the mean variance of the truth as displayed, where that clips and bends too"
)
OF_HALVES = Ceiling(True, "that of (half_a - half_b) / 2, which is as far off as the truth; 1 without halves")
NEIGHBOURHOODS = Ceiling(
    False,
    "none: they look at neighbourhoods, and no formula says what noise costs there; one that was made of the "
    "truth after a filter and new noise accused pictures without any",
)
FITTED_TO = Ceiling(False, "none: a fit has seen the noise of these very pictures")
TOO_COSTLY = Ceiling(
    False, "none: a second pass through the network for each view would cost more than all other scores"
)
NO_VARIANCE = Ceiling(
    False, "none: the truth has no variance and no halves of light by source, lobe or bounce"
)
PROJECTED = Ceiling(
    False,
    "none: noise is projected onto the object's effect, where it averages out; how much of it both true "
    "pictures share is not known",
)
CERTAIN_SHADING = Ceiling(
    False, "none: reflectance is exact; shading below four of its standard deviations is not judged"
)
NO_LIGHT_PATH = Ceiling(False, "needs none: no light path is drawn for this truth")
EXACT_LIGHTS = Ceiling(False, "needs none: the lights are exact")


def noise_as_displayed(true: TrueView, layer: str, mask: np.ndarray, exposure: float) -> float | None:
    """Return the mean variance over a mask of a layer as displayed; None where its noise is not known."""
    if f"{layer}.var" not in true.layers:
        return None
    variance = true.take(f"{layer}.var")
    return mean_variance(true.take(layer)[mask], variance[mask], lambda values: display(values, exposure))


def mean_variance(
    values: np.ndarray, variance: np.ndarray, shown: Callable[[np.ndarray], np.ndarray]
) -> float:
    """Return the mean variance that noisy values have after a curve.

    By three points of Gauss and Hermite (mean and √3 standard deviations to both sides): where a display
    clips or bends, as in dark pictures and near white, a slope alone would give too much or too little.

    Args:
        values: Any shape, linear.
        variance: Same shape, in the unit squared.
        shown: The curve, of each number by itself.
    """
    if not variance.any():
        return 0.0
    values, variance = np.ravel(values), np.ravel(variance)
    sums = [_sum_of_variances(values[b], variance[b], shown) for b in blocks(values.size)]
    return math.fsum(sums) / values.size


def _sum_of_variances(
    values: np.ndarray, variance: np.ndarray, shown: Callable[[np.ndarray], np.ndarray]
) -> float:
    middle, deviation = values.astype(np.float64), np.sqrt(3 * np.asarray(variance, np.float64))
    low, at, high = (shown(middle + step * deviation) for step in (-1, 0, 1))
    mean = (low + 4 * at + high) / 6
    return float(np.sum(4 * (at - mean) ** 2 + (low - mean) ** 2 + (high - mean) ** 2)) / 6


def pooled_ceiling(best: Sequence[float | None], finish: Callable[[float], float]) -> float | None:
    """Return the ceiling of a score from those of its views.

    Args:
        best: Before ``finish``; None where it is not known.
        finish: What makes the score of the mean over views.

    Returns:
        None unless it is known of every view, and for a truth without noise.
    """
    known = [value for value in best if value is not None]
    if not known or len(known) < len(best):
        return None
    mean = math.fsum(known) / len(known)
    return finish(mean) if mean > 0 else None


def excess(value: float, ceiling: float, higher_is_better: bool) -> float:
    """Return by how much a score is better than its ceiling; below 0 where it is worse."""
    return value - ceiling if higher_is_better else ceiling - value


def is_suspicious(above: float, unit: str) -> bool:
    """Tell whether a score exceeds its ceiling by more than chance; never where chance is not known."""
    return unit in MARGINS and above >= MARGINS[unit]


def ceiling_warnings(
    value: float | None, ceiling: float | None, unit: str, higher_is_better: bool
) -> tuple[str, ...]:
    """Return the warning for a score that exceeds its noise ceiling; empty for any other."""
    if value is None or ceiling is None:
        return ()
    above = excess(value, ceiling, higher_is_better)
    if not is_suspicious(above, unit):
        return ()
    digits, named = (1 if unit == "dB" else 3), f" {unit}"
    way = "above" if higher_is_better else "below"
    score, by, best = (f"{number:.{digits}f}{named}" for number in (value, above, ceiling))
    return (
        f"{score} is {by} {way} the {best} that the noise of the truth allows, and chance makes up for less "
        f"than {MARGINS[unit]:g}{named}: {HOLDS_NOISE}",
    )
