# SPDX-License-Identifier: Apache-2.0
"""The interval of a mean from few values of unknown shape, and the test that belongs to it."""

from collections.abc import Sequence
from functools import cache

import numpy as np
from threadpoolctl import ThreadpoolController

LEVEL = 0.95
LEAST_FOR_INTERVAL = 3
"""Two values leave one degree of freedom: an interval of 25 standard deviations says nothing."""
_LEAST_FOR_BOOTSTRAP = 6
"""With fewer, resamples of next to no spread give a bootstrap-t interval of any width."""
_RESAMPLES = 9999
_ROWS = 4
"""Samples whose ratios are made at a time: they fit the cache of a core."""
_SHARE = 1.2
"""Tail of each of the two intervals over that of their hull. A hull covers more than either: of two 94 %
intervals it covers 95 % in simulation."""


def mean_interval(values: Sequence[float] | np.ndarray, level: float = LEVEL) -> tuple[float, float] | None:
    """Return the interval that covers the mean of what the values are a sample of.

    The hull of Student's interval and the bootstrap-t interval (Efron and Tibshirani 1993, chapter 12.5),
    each with tails of 1.2 (1 - level) / 2. Fewer than 6 values, or values most of which are equal, have
    Student's interval alone, at the whole level. Resamples are always the same, so equal values give equal
    intervals.

    Args:
        values: One for each scene, in one unit.
        level: Share of such intervals that cover the mean.

    Returns:
        Its ends in the unit of the values; None for fewer than 3 values, or infinite ones. Equal values have
        an interval of no width: they show no spread to judge by.

    Raises:
        ValueError: The level is not between 0 and 1.

    Examples:
        >>> mean_interval([1.0, 1.0, 1.0])
        (1.0, 1.0)
        >>> mean_interval([1.0, 2.0]) is None
        True
    """
    if not 0 < level < 1:
        raise ValueError(f"expected a level between 0 and 1, got {level}")
    sample = np.asarray(values, np.float64)
    if len(sample) < LEAST_FOR_INTERVAL or not np.isfinite(sample).all():
        return None
    low, high = mean_intervals(sample[:, None], level)
    return float(low[0]), float(high[0])


def mean_p(values: Sequence[float] | np.ndarray) -> float | None:
    """Two-sided p of a mean of 0: 1 less the level at which the end of :func:`mean_interval` is 0.

    A little liberal where differences are skewed: of 8 lognormal ones (sigma 0.5) whose mean is 0, nearly 7 %
    have p < 0.05, as their intervals cover 93 %.

    Returns:
        None where there is no interval; 0 for values that are equal and not 0, 1 if all are 0.
    """
    from scipy import special  # takes a third of a second to import

    sample = np.asarray(values, np.float64)
    if len(sample) < LEAST_FOR_INTERVAL or not np.isfinite(sample).all():
        return None
    mean, error = _mean_and_error(sample[:, None])
    if error[0] == 0:
        return float(mean[0] == 0)
    observed = float(mean[0] / error[0])
    student = 2 * float(special.stdtr(len(sample) - 1, -abs(observed)))
    if len(sample) < _LEAST_FOR_BOOTSTRAP:
        return student
    ratios = _studentised(sample[:, None])
    if _idle(ratios, LEVEL)[0]:
        return student
    beyond = min(int((ratios >= observed).sum()), int((ratios <= observed).sum()))
    bootstrap = 2 * (beyond + 1) / (_RESAMPLES + 1)
    return min(1.0, max(student, bootstrap) / _SHARE)


def mean_intervals(samples: np.ndarray, level: float = LEVEL) -> tuple[np.ndarray, np.ndarray]:
    """Return the intervals of many samples of one size at once.

    Args:
        samples: shape ``(N, K)``: K samples of N values, finite, N at least 3.
        level: Share of such intervals that cover the mean.

    Returns:
        Lower and upper ends, each of shape ``(K,)``.
    """
    from scipy import special  # takes a third of a second to import

    count = len(samples)
    mean, error = _mean_and_error(samples)
    tail = (1 - level) / 2
    if count < _LEAST_FOR_BOOTSTRAP:
        reach = -special.stdtrit(count - 1, tail) * error
        return mean - reach, mean + reach
    ratios = _studentised(samples)
    idle = _idle(ratios, level)
    reach = np.where(idle, -special.stdtrit(count - 1, tail), -special.stdtrit(count - 1, _SHARE * tail))
    last = round(_SHARE * tail * (_RESAMPLES + 1)) - 1
    upper = np.where(idle, reach, np.maximum(reach, -_of_rank(ratios, last)))
    lower = np.where(idle, reach, np.maximum(reach, _of_rank(ratios, last, largest=True)))
    return mean - lower * error, mean + upper * error


def _mean_and_error(samples: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Means and their standard errors; equal values have an error of exactly 0, rounding or not."""
    mean = np.where(np.ptp(samples, axis=0) == 0, samples[0], samples.mean(axis=0))
    return mean, (samples - mean).std(axis=0, ddof=1) / np.sqrt(len(samples))


def _studentised(samples: np.ndarray) -> np.ndarray:
    """(mean* - mean) / error* of each resample, shape ``(K, B)``; infinite where a resample has no spread."""
    count = len(samples)
    centred = (samples - samples.mean(axis=0)).T
    largest = np.abs(centred).max(axis=1, keepdims=True)
    scaled = centred / np.where(largest > 0, largest, 1)
    weights = _resampling(count)
    with _libraries().limit(limits=1, user_api="blas"):  # more would wait longer than work, and differ
        means, squares = scaled @ weights, scaled**2 @ weights
    for start in range(0, len(scaled), _ROWS):
        part = slice(start, start + _ROWS)
        means[part] = _ratios(means[part], squares[part], count)
    return means


def _ratios(mean: np.ndarray, squares: np.ndarray, count: int) -> np.ndarray:
    """Return mean over error of resamples from means of values of the order of 1, and of their squares."""
    variance = (squares - mean**2) / (count - 1)
    flat = variance <= 1e-14  # rounding
    if not flat.any():
        return mean / np.sqrt(variance)
    ratio = mean / np.sqrt(np.where(flat, 1, variance))
    ratio[flat] = np.where(np.abs(mean[flat]) < 1e-9, 0.0, np.copysign(np.inf, mean[flat]))
    return ratio


def _of_rank(ratios: np.ndarray, rank: int, *, largest: bool = False) -> np.ndarray:
    """Return the value of a rank in each row, counted from 0 at the smallest or at the largest, ``(K,)``.

    Only values at least as far out as one that every sixteenth of them suggests are looked at.
    """
    sign = -1.0 if largest else 1.0
    some = sign * ratios[:, ::16]
    share = rank / ratios.shape[1] * some.shape[1]
    near = min(some.shape[1] - 1, int(share + 4 * share**0.5) + 2)  # four standard deviations too far in
    limit = sign * np.partition(some, near, axis=1)[:, near, None]
    out = ratios >= limit if largest else ratios <= limit
    counts = np.count_nonzero(out, axis=1)
    if counts.min() <= rank:
        return sign * np.partition(sign * ratios, rank, axis=1)[:, rank]
    tails = np.full((len(ratios), counts.max()), np.inf)
    tails[np.arange(counts.max()) < counts[:, None]] = sign * ratios[out]
    return sign * np.partition(tails, rank, axis=1)[:, rank]


def _idle(ratios: np.ndarray, level: float) -> np.ndarray:
    """Return samples whose resamples lack spread so often that bootstrap-t has an infinite end, shape
    ``(K,)``.
    """
    return np.isinf(ratios).mean(axis=1) >= _SHARE * (1 - level) / 2


@cache
def _libraries() -> ThreadpoolController:
    """Return the libraries of this process that have threads; finding them takes as long as an interval."""
    return ThreadpoolController()


@cache
def _resampling(count: int) -> np.ndarray:
    """Return how often each resample draws each value, over their number, ``(N, B)``; always the same."""
    even = np.full(count, 1 / count)
    drawn = np.random.default_rng(20090).multinomial(count, even, size=_RESAMPLES)
    return np.ascontiguousarray(drawn.T / count)
