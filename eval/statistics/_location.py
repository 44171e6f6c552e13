# SPDX-License-Identifier: Apache-2.0
"""The centre of few values of unknown shape, with the interval of the exact signed-rank test.

The Hodges-Lehmann estimate is the median of all Walsh averages, the means of every two values and of each
value with itself. Counted in from both ends by the exact signed-rank distribution, they bound the centre of a
symmetric distribution (Hollander, Wolfe and Chicken 2014, section 3.2). All three numbers rise with every
value: a scene that is more favourable never makes the interval less so, which an interval around a mean does
not promise.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from graycard.eval.statistics._interval import LEVEL
from graycard.eval.statistics._null_distribution import rank_limit, rank_tail


@dataclass(frozen=True, slots=True)
class Location:
    """The centre of a sample, in the unit of the values."""

    estimate: float
    """Hodges-Lehmann estimate."""
    interval: tuple[float, float]
    """Both ends infinite where so few values allow none at this level."""


def locate(values: Sequence[float] | np.ndarray, level: float = LEVEL) -> Location:
    """Return the Hodges-Lehmann estimate and its exact interval.

    Args:
        values: One for each scene, finite.
        level: Least share of such intervals that hold the centre of a symmetric distribution.

    Raises:
        ValueError: There is no value, one is not finite, or the level is not between 0 and 1.

    Examples:
        >>> locate([1.0, 2.0, 3.0, 4.0, 5.0, 6.0])
        Location(estimate=3.5, interval=(1.0, 6.0))
    """
    sample = np.asarray(values, np.float64)
    if not sample.size or not np.isfinite(sample).all():
        raise ValueError(f"expected finite values, got {sample.tolist()}")
    estimate, low, high = locations(sample[:, None], level)
    return Location(float(estimate[0]), (float(low[0]), float(high[0])))


Ends = tuple[np.ndarray, np.ndarray, np.ndarray]
"""Estimates, lower and upper ends of the intervals of many samples."""


def locations(samples: np.ndarray, level: float = LEVEL) -> Ends:
    """Return estimates and interval ends of many samples of one size.

    Args:
        samples: Shape ``(N, K)``: K samples of N finite values.
        level: As in :func:`locate`.

    Returns:
        Estimates, lower ends and upper ends, each of shape ``(K,)``.
    """
    return locations_at(samples, level)[0]


def locations_at(samples: np.ndarray, *levels: float) -> list[Ends]:
    """Return what :func:`locations` does, for each of several levels."""
    for level in levels:
        if not 0 < level < 1:
            raise ValueError(f"expected a level between 0 and 1, got {level}")
    first, second = np.triu_indices(len(samples))
    walsh = np.asarray(samples, np.float64)[first]
    walsh += samples[second]
    walsh /= 2
    walsh.sort(axis=0)
    last = len(walsh) - 1
    estimates = (walsh[last // 2] + walsh[last - last // 2]) / 2
    limits = [rank_limit(len(samples), level) for level in levels]
    open_ends = np.full_like(estimates, -np.inf), np.full_like(estimates, np.inf)
    return [
        (estimates, walsh[inward], walsh[last - inward]) if inward >= 0 else (estimates, *open_ends)
        for inward in limits
    ]


def location_p(values: Sequence[float] | np.ndarray) -> float:
    """Return the exact two-sided p of a centre of 0, to which the interval of :func:`locate` is the answer.

    It is at most 1 - level where that interval leaves 0 out, with ties and zeros as well: these count against
    either side.

    Args:
        values: One for each scene, finite; one or more.

    Examples:
        >>> location_p([1.0, 2.0, 3.0, 4.0, 5.0, 6.0])
        0.03125
    """
    sample = np.asarray(values, np.float64)
    first, second = np.triu_indices(len(sample))
    sums = sample[first] + sample[second]
    return float(min(1.0, 2 * rank_tail(len(sample))[min((sums <= 0).sum(), (sums >= 0).sum())]))


def least_level(count: int) -> float:
    """Return the highest level at which so many values have an interval.

    Examples:
        >>> least_level(6)
        0.96875
    """
    return 1 - 2.0 ** (1 - count)
