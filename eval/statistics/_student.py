# SPDX-License-Identifier: Apache-2.0
"""The tests of many paired samples at once: of their means, and of their signs and ranks."""

from functools import reduce
from typing import NamedTuple

import numpy as np

from graycard.eval.statistics._signed_rank import signed_rank_p


class MeanTest(NamedTuple):
    """Student's test of the mean of each sample, arrays of shape ``(K,)``."""

    mean: np.ndarray
    """In the unit of the values."""
    error: np.ndarray
    """Standard error of the mean, in the same unit; 0 for equal values."""
    p: np.ndarray
    """Two-sided p of a mean of 0. It has no floor: it falls as long as the gap grows."""

    @property
    def ratio(self) -> np.ndarray:
        """Return the means in standard errors, without sign; equal values other than 0 have infinity."""
        flat = self.error == 0
        size = np.abs(self.mean) / np.where(flat, 1.0, self.error)
        return np.where(flat & (self.mean != 0), np.inf, size)


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
    """Return the p of :func:`signed_rank_p` of many samples of one size.

    It depends on ranks and signs alone, which few samples do not share, and is counted once for each.

    Args:
        samples: shape ``(N, K)``: K samples of N values, which may be infinite.

    Returns:
        shape ``(K,)``; not a number for a sample in which no value is other than 0.
    """
    if not samples.size:
        return np.full(samples.shape[1], np.nan)
    ranks = _doubled_ranks(samples)
    positive = np.where(samples > 0, ranks, 0).sum(axis=0)
    lesser = np.minimum(positive, ranks.sum(axis=0) - positive)
    keys = np.vstack([np.sort(ranks, axis=0), lesser])
    _, first, inverse = np.unique(keys, axis=1, return_index=True, return_inverse=True)
    found = [signed_rank_p(column) for column in np.where(samples > 0, ranks, -ranks)[:, first].T]
    return np.array([np.nan if p is None else p for p in found])[inverse.reshape(-1)]


def _doubled_ranks(samples: np.ndarray) -> np.ndarray:
    """Return twice the mean rank of each value's size among those other than 0; 0 for a value of 0."""
    size = np.abs(samples)
    counts = [
        ((size < own) & (size > 0)).sum(axis=0) + ((size <= own) & (size > 0)).sum(axis=0) for own in size
    ]
    return np.where(size > 0, np.array(counts) + 1, 0)
