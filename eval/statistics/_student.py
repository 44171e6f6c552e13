# SPDX-License-Identifier: Apache-2.0
"""The tests of many paired samples at once: of their means, and of their signs and ranks."""

from functools import reduce
from typing import NamedTuple

import numpy as np

from graycard.eval.statistics._null_distribution import rank_tail


class MeanTest(NamedTuple):
    """Student's test of the mean of each sample, arrays of shape ``(K,)``."""

    mean: np.ndarray
    """In the unit of the values."""
    error: np.ndarray
    """Standard error of the mean, in the same unit; 0 for equal values."""
    p: np.ndarray
    """Two-sided p of a mean of 0. It has no floor: it falls as long as the gap grows."""


def student_test(samples: np.ndarray) -> MeanTest:
    """Return Student's one-sample test of many samples of one size.

    Values are added one after another, so a sample has the same result among others as alone.

    Args:
        samples: shape ``(N, K)``: K samples of N values, finite, N at least 2.
    """
    from scipy import special  # takes a third of a second to import

    count = len(samples)
    equal = np.ptp(samples, axis=0) == 0
    mean = np.where(equal, samples[0], reduce(np.add, samples) / count)
    error = np.sqrt(reduce(np.add, (samples - mean) ** 2) / (count * (count - 1)))
    ratio = np.abs(mean) / np.where(error > 0, error, 1.0)
    p = np.where(error > 0, 2 * special.stdtr(count - 1, -ratio), mean == 0)
    return MeanTest(mean, error, p)


def signed_rank_ps(samples: np.ndarray) -> np.ndarray:
    """Return the exact two-sided p of the signed-rank test of many samples, on the side of their means.

    Values of 0 and of equal size count against the mean: ranks among equals go to the other sign first. That
    keeps the test exact or careful. It makes it monotone, too: a sample moved away from 0 never has a larger
    p. By mean ranks it may, as their distribution changes with every tie (Wilcoxon 1945; Pratt 1959).

    Args:
        samples: shape ``(N, K)``: K samples of N values, which may be infinite.

    Returns:
        shape ``(K,)``; 1 where ranks speak for the other side or the mean is 0 or none, not a number where
        every value is 0.
    """
    with np.errstate(invalid="ignore"):  # both infinities have no mean
        total = reduce(np.add, samples, np.zeros(samples.shape[1]))
    turned = np.where(total > 0, samples, -samples)
    other = turned <= 0
    order = np.lexsort((other, np.abs(turned)), axis=0)
    ranks = np.arange(1, len(samples) + 1)[:, None]
    lost = (np.take_along_axis(other, order, axis=0) * ranks).sum(axis=0)
    p = np.minimum(1.0, 2 * rank_tail(len(samples))[lost])
    p = np.where((total > 0) | (total < 0), p, 1.0)
    return np.where((samples != 0).any(axis=0), p, np.nan)
