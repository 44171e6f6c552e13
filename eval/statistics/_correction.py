# SPDX-License-Identifier: Apache-2.0
"""The correction of a mean's test for the number of comparisons and for skewed differences."""

import numpy as np

from graycard.eval.statistics._student import MeanTest

MARGIN = 4.0
"""Factor on the corrected p. Student's test of skewed differences is too liberal where its p is small. Of two
lognormal scores (sigma 0.5, standard deviations 1 : 4) it has p < 0.005 nearly three times too often."""
ASSURED = 10.0
"""Standard errors from which on a gap needs less of a margin. Chance makes such a gap in 1 of 5850 pairs of
normal scores with 6 scenes, and in 1 of 47,000 with 8."""
ASSURED_MARGIN = 1.3
"""Factor on the corrected p of such a gap among all pairs. Against a chosen row it has none: its comparisons
have that row in common, so fewer of them are false alarms of their own."""


def correct(test: MeanTest, comparisons: int, assured_margin: float = 1.0) -> np.ndarray:
    """Return p after the single-step correction of Šidák 1967, times a margin for skewed differences.

    It depends on nothing of the other comparisons but their number. So a larger gap of the same spread never
    has a larger p, as it may have by a correction in steps, where the other comparisons change with it.

    Args:
        test: K tests of one family or of a part of it.
        comparisons: Number of comparisons in the family.
        assured_margin: Margin of gaps of ten standard errors or more, between 1 and that of all others.

    Returns:
        shape ``(K,)``; at most 1.

    Raises:
        ValueError: There is no comparison, or the margin is out of its range.
    """
    if comparisons < 1:
        raise ValueError(f"expected 1 or more comparisons, got {comparisons}")
    if not 1 <= assured_margin <= MARGIN:
        raise ValueError(f"expected a margin between 1 and {MARGIN:g}, got {assured_margin:g}")
    with np.errstate(divide="ignore"):  # of p = 1 the logarithm is minus infinity, as it should be
        family = -np.expm1(comparisons * np.log1p(-test.p))
    assured = test.ratio >= ASSURED * (1 - 1e-9)  # ten of them, up to rounding
    return np.minimum(1.0, np.where(assured, assured_margin, MARGIN) * family)
