# SPDX-License-Identifier: Apache-2.0
"""The distribution of the signed-rank statistic without an effect: signs are fair coins, ranks are given."""

from collections.abc import Iterable
from functools import cache

import numpy as np


def rank_chances(ranks: Iterable[int]) -> np.ndarray:
    """Return the chance of each sum of the ranks whose sign is positive, every sign a fair coin.

    Chances are halved rank by rank, so no number of ranks overflows. Up to 53 ranks they are exact.

    Args:
        ranks: From 1 up; ranks that are halves come doubled.

    Returns:
        By the sum, shape ``(sum of all ranks + 1,)``.
    """
    steps = [int(rank) for rank in ranks]
    chances = np.zeros(sum(steps) + 1)
    chances[0] = 1
    reached = 0
    for rank in steps:
        reached += rank
        chances[rank : reached + 1] += chances[: reached + 1 - rank].copy()
        chances[: reached + 1] /= 2
    return chances


@cache
def rank_tail(count: int) -> np.ndarray:
    """Return the chance of each sum of ranks 1 to ``count`` or a lesser one.

    Returns:
        By the sum, shape ``(count * (count + 1) / 2 + 1,)``; not to be written to.
    """
    tail = np.cumsum(rank_chances(range(1, count + 1)))
    tail.flags.writeable = False
    return tail


def two_sided(count: int) -> np.ndarray:
    """Return the exact two-sided p of each signed-rank statistic of so many values without ties.

    Returns:
        By the sum of the ranks of positive values, shape ``(count * (count + 1) / 2 + 1,)``.
    """
    lower = rank_tail(count)
    return np.minimum(1, 2 * np.minimum(lower, lower[::-1]))


def rank_limit(count: int, level: float) -> int:
    """Return the largest sum of ranks that an interval of a level leaves out at either end; -1 for none.

    So many of the mean of every two values, sorted, lie outside of the interval on each side.

    Examples:
        >>> rank_limit(6, 0.95), rank_limit(5, 0.95)
        (0, -1)
    """
    lower = 2 * rank_tail(count)[: count * (count + 1) // 4 + 1]
    return int(np.searchsorted(lower, (1 - level) * (1 + 1e-12), side="right")) - 1
