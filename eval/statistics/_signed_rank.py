# SPDX-License-Identifier: Apache-2.0
"""The exact signed-rank test, and the correction for testing many pairs."""

from collections.abc import Sequence

import numpy as np

from graycard.eval.statistics._null_distribution import rank_chances


def signed_rank_p(differences: Sequence[float] | np.ndarray) -> float | None:
    """Return the exact two-sided p of Wilcoxon's signed-rank test that differences are symmetric about 0.

    Differences of 0 are left out, and equal ones share their mean rank (Wilcoxon 1945). The distribution over
    all 2^n signs is counted with these very ranks, so ties need no approximation.

    Args:
        differences: One for each scene; may be infinite.

    Returns:
        None where no difference is other than 0.

    Raises:
        ValueError: A difference is not a number.

    Examples:
        >>> signed_rank_p([1.0, 2.0, 3.0, 4.0, 5.0, 6.0])
        0.03125
    """
    from scipy import stats  # takes a second to import

    values = np.asarray(differences, np.float64)
    if np.isnan(values).any():
        raise ValueError(f"expected differences that are numbers, got {values.tolist()}")
    values = values[values != 0]
    if not len(values):
        return None
    ranks = np.rint(2 * stats.rankdata(np.abs(values))).astype(int)  # mean ranks are halves
    chances = rank_chances(ranks)
    positive, negative = int(ranks[values > 0].sum()), int(ranks[values < 0].sum())
    return float(min(1.0, 2 * chances[: min(positive, negative) + 1].sum() / chances.sum()))


def least_scenes(level: float, pairs: int = 1) -> int:
    """Return the fewest scenes with which the signed-rank test of ``pairs`` pairs can fall below 1 - level.

    All differences of one sign have p = 2 / 2^n, and Holm's correction multiplies the least p by the number
    of pairs.

    Raises:
        ValueError: The level is not between 0 and 1, or there is no pair.

    Examples:
        >>> least_scenes(0.95), least_scenes(0.95, pairs=21)
        (6, 10)
    """
    if not 0 < level < 1 or pairs < 1:
        raise ValueError(f"expected a level between 0 and 1 and 1 or more pairs, got {level} and {pairs}")
    count = 1
    while pairs * 2.0 ** (1 - count) >= 1 - level:
        count += 1
    return count


def holm(p_values: Sequence[float | None]) -> list[float | None]:
    """Return p after the step-down correction of Holm 1979: all below 0.05 hold together with 95 %.

    Args:
        p_values: One for each pair; None for one that was not tested, which stays None and does not count.

    Examples:
        >>> holm([0.01, None, 0.04, 0.03])
        [0.03, None, 0.06, 0.06]
    """
    tested = sorted((p, i) for i, p in enumerate(p_values) if p is not None)
    corrected: list[float | None] = [None] * len(p_values)
    largest = 0.0
    for step, (p, index) in enumerate(tested):
        largest = max(largest, min(1.0, (len(tested) - step) * p))
        corrected[index] = largest
    return corrected
