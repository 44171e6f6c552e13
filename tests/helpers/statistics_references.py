# SPDX-License-Identifier: Apache-2.0
"""Second computations of the tests and intervals of a run: by a library, by counting, from the definition."""

from itertools import product
from typing import Any

import numpy as np
from scipy import stats

from graycard.eval.statistics import mean_interval, mean_p, signed_rank_p
from layer_references import Pair

SAMPLES = [np.random.default_rng(n).lognormal(0, 0.8, n) - 1.6 for n in (6, 8, 13)]
TAIL, RESAMPLES = 1.2 * 0.025, 9999
"""Tail of each interval of the hull, and resamples of the bootstrap."""


def _p(result: Any) -> float:
    """Return p of one of scipy's tests, whose stubs name no type."""
    return float(result.pvalue)


def signed_rank() -> Pair:
    ours = [signed_rank_p(values) for values in SAMPLES]
    return np.array(ours), np.array([_p(stats.wilcoxon(v, method="exact")) for v in SAMPLES])


def signed_rank_with_ties() -> Pair:
    """The lesser rank sum of all 2^n signs is at most the one found."""
    ours, counted = [], []
    for seed in range(6):
        values = np.random.default_rng(seed).integers(-2, 4, 9)
        values = values[values != 0]
        ranks = stats.rankdata(np.abs(values))
        sums = np.array([ranks[np.array(s) > 0].sum() for s in product((-1, 1), repeat=len(values))])
        least = np.minimum(sums, ranks.sum() - sums)
        found = min(ranks[values > 0].sum(), ranks[values < 0].sum())
        ours.append(signed_rank_p(values.astype(float)))
        counted.append(np.mean(least <= found + 1e-9))
    return np.array(ours), np.array(counted)


def bootstrap_t() -> Pair:
    """The ends of the hull of both intervals (Efron and Tibshirani 1993, chapter 12.5)."""
    ours, ends = [], []
    for values in SAMPLES:
        mean, error, ratios = _ratios(values)
        last = round(TAIL * (RESAMPLES + 1)) - 1
        student = stats.t.ppf(1 - TAIL, len(values) - 1)
        upper, lower = max(student, -ratios[last]), max(student, ratios[RESAMPLES - 1 - last])
        ours.append(mean_interval(values))
        ends.append((mean - lower * error, mean + upper * error))
    return np.array(ours), np.array(ends)


def test_of_mean() -> Pair:
    ours, other = [], []
    for values in SAMPLES:
        mean, error, ratios = _ratios(values)
        beyond = min(np.sum(ratios >= mean / error), np.sum(ratios <= mean / error))
        bootstrap = 2 * (beyond + 1) / (RESAMPLES + 1)
        ours.append(mean_p(values))
        other.append(min(1, max(_p(stats.ttest_1samp(values, 0)), bootstrap) / 1.2))
    return np.array(ours), np.array(other)


def _ratios(values: np.ndarray) -> tuple[float, float, np.ndarray]:
    """Mean, its standard error, and the sorted ratios of the resamples, which are the same as ours."""
    count, found = len(values), []
    draws = np.random.default_rng(20090).multinomial(count, np.full(count, 1 / count), size=RESAMPLES)
    mean, error = float(np.mean(values)), float(stats.sem(values))
    for draw in draws:
        again = np.repeat(values, draw)
        off, spread = again.mean() - mean, stats.tstd(again) if len(set(again)) > 1 else 0.0
        found.append(off / (spread / count**0.5) if spread else np.copysign(np.inf, off))
    return mean, error, np.sort(found)
