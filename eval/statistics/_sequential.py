# SPDX-License-Identifier: Apache-2.0
"""Looks at growing numbers of scenes, with an error that stays bounded over all of them.

Whoever looks after each new scene, and stops at the first p below 5 %, is wrong far more often. Here every
look has one stricter level, the same for all (Pocock 1977). Under the null hypothesis signs are fair coins
and ranks a random permutation, whatever the distribution of a symmetric effect. So the joint distribution of
the signed-rank statistic over the looks is known, and simulating it gives the level.

Intervals at that level are repeated confidence intervals (Jennison and Turnbull 1989): with 95 % all of them
hold the centre at once. So every verdict that is a statement about the interval may be read at every look.

A level for looks after every scene up to N also holds for a claim about some of the scenes, and where looks
are skipped: those are looks at fewer of the same counts.
"""

import math
from collections.abc import Sequence
from functools import cache
from itertools import pairwise

import numpy as np

from graycard.eval.statistics._null_distribution import two_sided

ERROR = 0.05
"""Greatest chance that any of the looks is wrong."""
_KEPT = 0.01
"""Part of the error that is kept for effects that are not symmetric.

The least, in steps of 0.1 %, that keeps exponential and lognormal effects (sigma 0.75) below 5 % in all.
Simulated for looks up to 52 scenes. More skew (lognormal, sigma 1) gives 5.2 %."""
_PATHS, _AT_A_TIME, _SEED = 200_000, 20_000, 30_1989


def sequential_level(looks: Sequence[int], error: float = ERROR) -> float:
    """Return the level of the interval at each look with which all of them hold the centre at once.

    The level is found by Monte Carlo with a fixed seed, and three standard errors of it are given away.

    Args:
        looks: Number of scenes at each look, rising.
        error: Greatest chance that some interval misses the centre.

    Raises:
        ValueError: There is no look, one is below 1, they do not rise, the error is out of range, or so few
            scenes cannot decide anything.

    Examples:
        >>> round(sequential_level([8]), 3) >= 0.95
        True
    """
    counts = tuple(looks)
    if not counts or counts[0] < 1 or any(b <= a for a, b in pairwise(counts)):
        raise ValueError(f"expected numbers of scenes from 1 up that rise, got {list(counts)}")
    if not 2 * _KEPT < error < 1:
        raise ValueError(f"expected an error between {2 * _KEPT:g} and 1, got {error}")
    least = _threshold(counts, error)
    if not least:
        raise ValueError(f"expected enough scenes for a p below {error:g}, got {counts[-1]}. Plan for more")
    return 1 - least


def level_up_to(scenes: int) -> float:
    """Return the level for looks after every scene up to a number of them, whichever are made.

    Raises:
        ValueError: So few cannot decide anything.
    """
    return sequential_level(range(1, scenes + 1))


@cache
def _threshold(looks: tuple[int, ...], error: float) -> float:
    """Return the greatest p at which a look may decide; 0 if there is none."""
    least = np.sort(np.concatenate([_least_p(looks, part) for part in range(_PATHS // _AT_A_TIME)]))
    share = error - _KEPT
    share -= 3 * math.sqrt(share * (1 - share) / _PATHS)
    reached = least[int(share * _PATHS)]
    below = int(np.searchsorted(least, reached, side="left"))
    return float(least[below - 1]) if below else 0.0


def _least_p(looks: tuple[int, ...], part: int) -> np.ndarray:
    """Return the least p over the looks of simulated scenes without an effect, shape ``(paths,)``."""
    chance = np.random.default_rng((_SEED, part))
    effects = chance.uniform(-1, 1, (_AT_A_TIME, looks[-1])).astype(np.float32)
    return p_after_each(effects)[:, [count - 1 for count in looks]].min(axis=1)


def p_after_each(samples: np.ndarray) -> np.ndarray:
    """Return the exact two-sided signed-rank p of the first value, of the first two, and so on.

    A new value takes its rank among those before it and lifts the ranks of larger ones by one, so that
    nothing is ranked anew. Values are taken to be without ties and zeros.

    Args:
        samples: Shape ``(samples, N)``, values in the order in which they come.

    Returns:
        Shape ``(samples, N)``.
    """
    sizes, positive = np.abs(samples), samples > 0
    statistic = np.zeros(len(samples), np.int64)
    found = np.empty(samples.shape)
    for last in range(samples.shape[1]):
        larger = sizes[:, :last] > sizes[:, last : last + 1]
        statistic += np.count_nonzero(larger & positive[:, :last], axis=1)
        statistic += positive[:, last] * (last + 1 - np.count_nonzero(larger, axis=1))
        found[:, last] = two_sided(last + 1)[statistic]
    return found
