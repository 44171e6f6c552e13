# SPDX-License-Identifier: Apache-2.0
"""From an effect to a verdict."""

import math
from collections.abc import Sequence
from itertools import pairwise

from graycard import ClaimVerdict
from graycard.benchmarks.claims._claim import Check
from graycard.benchmarks.claims._effects import Effect

RULES = {
    "better": "reproduced: the sign is as claimed, the 95 % interval over scenes excludes no effect, and the "
    "mean has the claimed size (half to twice the paper's unless said otherwise; any, where the paper names "
    "none). Direction only: all but the size. Not supported: the interval includes no effect. Contradicted: "
    "it excludes it on the other side",
    "within": "reproduced: the whole 95 % interval over scenes lies within the bounds. Contradicted: it lies "
    "outside of them. Not supported: it crosses one, so scenes leave open whether the effect is that small",
    "monotone": "each scene's effect is its change from the first level to the last along the straight line "
    "through all levels. Reproduced: as by `better`, and the means over scenes rise or fall with each level "
    "as claimed. Direction only: the change is as claimed and certain, but some step or the size is not",
    "along a knob": "the effect is its change between two values of a knob, by the straight line through the "
    "scenes, with Student's interval; judged by the check's own rule",
    "all": "a claim is as good as its worst check that decides",
    "any": "a claim is as good as its best check that decides",
    "not checkable": "rows, scenes or scores are missing in this run, an effect has fewer than 3 scenes, or "
    "the claim needs what is not here. A row without a score on one scene is never judged on the others",
    "arithmetic": "the mean of a table's entries is that printed within the rounding of both; rows of "
    "different things are not the same figure by figure",
}
"""What each rule asks for."""

RANKS: tuple[ClaimVerdict, ...] = (
    "contradicted", "not checkable", "not supported", "direction only", "reproduced",
)  # fmt: skip
"""From the worst to the best."""


def verdict_of(check: Check, effect: Effect) -> ClaimVerdict:
    """The verdict on one check."""
    low, high = effect.interval
    if check.rule == "within":
        return _within(check, low, high)
    neutral = neutral_of(check)
    if low <= neutral <= high:
        return "not supported"
    if high < neutral:
        return "contradicted"
    least, most = check.range or (-math.inf, math.inf)
    sized = least <= effect.mean <= most
    rising = all(one < other for one, other in pairwise(effect.course))
    return "reproduced" if sized and rising else "direction only"


def neutral_of(check: Check) -> float:
    """The effect that is none."""
    return 1.0 if check.scale == "ratio" else 0.0


def combined(verdicts: Sequence[ClaimVerdict], by: str) -> ClaimVerdict:
    """The verdict of a claim from those of its deciding checks."""
    ranked = sorted(verdicts, key=RANKS.index)
    return ranked[0] if by == "all" else ranked[-1]


def _within(check: Check, low: float, high: float) -> ClaimVerdict:
    assert check.accepted is not None, "the file was refused without"
    least, most = check.accepted
    if least <= low and high <= most:
        return "reproduced"
    return "contradicted" if high < least or low > most else "not supported"
