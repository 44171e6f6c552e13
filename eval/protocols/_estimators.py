# SPDX-License-Identifier: Apache-2.0
"""Fits of the factors that published code takes off a predicted albedo.

Each estimator takes the pixels that it may see, predicted and true, each of shape ``(N, 3)``, linear, and
gives the factors for R, G, B, shape ``(3,)``.
"""

from collections.abc import Callable, Mapping
from typing import Literal

import numpy as np

from graycard import PredictionError
from graycard.eval.protocols._encoding import ENCODED, GAMMA

Estimator = Literal[
    "none",
    "least squares, one factor",
    "least squares, per channel",
    "least squares, per channel, black as white",
    "median ratio, per channel",
    "median ratio, per channel, prediction cut at 1",
    "median ratio, per channel, where the truth is above 0",
    "median ratio of red",
    "ratio of means",
    "least absolute error, exposure and balance",
]
Estimate = Callable[[np.ndarray, np.ndarray], np.ndarray]

_FAINT = 1e-6
"""Least prediction that a ratio is formed with, and most of a sum of squares that is called black."""


def estimate(kind: Estimator, predicted: np.ndarray, true: np.ndarray) -> np.ndarray:
    """Return the factors of one fit, shape ``(3,)``.

    Raises:
        PredictionError: The prediction is black, or the fit gives a factor that is negative.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        factors = ESTIMATORS[kind](predicted, true)
    if not (np.isfinite(factors) & (factors >= 0)).all():
        raise PredictionError(
            "expected base_color that positive factors can bring to the truth, got the factors "
            f"{', '.join(f'{f:.3g}' for f in factors)}. Predict positive base_color"
        )
    return factors


def lower_median(values: np.ndarray) -> np.ndarray:
    """Return the median over the first axis; of two middle values the lower one, as torch has it."""
    middle = (len(values) - 1) // 2
    return np.partition(values, middle, axis=0)[middle]


def _none(predicted: np.ndarray, true: np.ndarray) -> np.ndarray:
    return np.ones(3)


def _one_factor(predicted: np.ndarray, true: np.ndarray) -> np.ndarray:
    return np.repeat((predicted * true).sum() / (predicted * predicted).sum(), 3)


def _per_channel(predicted: np.ndarray, true: np.ndarray) -> np.ndarray:
    return (predicted * true).sum(axis=0) / (predicted * predicted).sum(axis=0)


def _black_as_white(predicted: np.ndarray, true: np.ndarray) -> np.ndarray:
    black = (predicted * predicted).sum(axis=0) <= _FAINT
    return _per_channel(np.where(black, 1.0, predicted), true)


def _median_ratio(predicted: np.ndarray, true: np.ndarray) -> np.ndarray:
    return lower_median(true / np.maximum(predicted, _FAINT))


def _median_ratio_cut(predicted: np.ndarray, true: np.ndarray) -> np.ndarray:
    return lower_median(true / np.clip(predicted, _FAINT, 1))


def _median_ratio_of_coloured(predicted: np.ndarray, true: np.ndarray) -> np.ndarray:
    coloured = (true > 0).all(axis=1)
    return _median_ratio(predicted[coloured], true[coloured]) if coloured.any() else np.full(3, np.nan)


def _median_ratio_of_red(predicted: np.ndarray, true: np.ndarray) -> np.ndarray:
    return np.repeat(_median_ratio(predicted[:, :1], true[:, :1]), 3)


def _ratio_of_means(predicted: np.ndarray, true: np.ndarray) -> np.ndarray:
    return np.repeat(true.mean() / predicted.mean(), 3)


def _exposure_and_balance(predicted: np.ndarray, true: np.ndarray) -> np.ndarray:
    """Return one exposure, then a balance of each channel in [0.5, 2], of least mean |difference|.

    Both images are compared as displayed, ``min(x^(1/2.2), 1)``. Pixels in which the truth is white do not
    enter.
    """
    fair = true.max(axis=1) < 1
    shown, goal = (ENCODED["gamma 2.2"](image[fair]) for image in (predicted, true))
    if not (shown.min(axis=1) > 0).any():
        return np.full(3, np.nan)
    most = 1 / shown[shown > 0].min()  # beyond it every pixel is white
    exposure = least_absolute_factor(shown.ravel(), goal.ravel(), 0.0, most)
    bounds = 0.5 ** (1 / GAMMA), 2 ** (1 / GAMMA)
    balance = [least_absolute_factor(exposure * shown[:, c], goal[:, c], *bounds) for c in range(3)]
    return (exposure * np.array(balance)) ** GAMMA


def least_absolute_factor(values: np.ndarray, goal: np.ndarray, low: float, high: float) -> float:
    """Return the factor u in [low, high] of least ``Σ |min(u v, 1) - g|``, exactly.

    The sum is piecewise linear in u: each term falls with slope -v up to u = g / v, rises with slope v up
    to u = 1 / v, and stays. So its least value lies at one of these places or at a bound.

    Args:
        values: v, shape ``(N,)``, 0 or more.
        goal: g, shape ``(N,)``, in [0, 1].
        low: Least factor.
        high: Greatest factor.
    """
    v, g = values[values > 0], goal[values > 0]
    places = np.concatenate([g / v, 1 / v])
    order = np.argsort(places)
    places, bends = places[order], np.concatenate([2 * v, -v])[order]
    slopes = np.cumsum(bends) - v.sum()  # to the right of each place
    heights = g.sum() - v.sum() * places[0] + np.append(0, np.cumsum(slopes[:-1] * np.diff(places)))
    inner = (places > low) & (places < high)
    tried = np.concatenate([[low, high], places[inner]])
    sums = np.concatenate(
        [np.interp([low, high], np.append(0, places), np.append(g.sum(), heights)), heights[inner]]
    )
    return float(tried[np.argmin(sums)])


ESTIMATORS: Mapping[Estimator, Estimate] = {
    "none": _none,
    "least squares, one factor": _one_factor,
    "least squares, per channel": _per_channel,
    "least squares, per channel, black as white": _black_as_white,
    "median ratio, per channel": _median_ratio,
    "median ratio, per channel, prediction cut at 1": _median_ratio_cut,
    "median ratio, per channel, where the truth is above 0": _median_ratio_of_coloured,
    "median ratio of red": _median_ratio_of_red,
    "ratio of means": _ratio_of_means,
    "least absolute error, exposure and balance": _exposure_and_balance,
}
