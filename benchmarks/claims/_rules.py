# SPDX-License-Identifier: Apache-2.0
"""From an effect to a verdict."""

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import Final

import numpy as np

from graycard.benchmarks.claims._claim import Check
from graycard.benchmarks.claims._effects import Effect
from graycard.eval.statistics import LEVEL, least_scenes
from graycard.records import ClaimVerdict

_LEAST: Final = least_scenes(LEVEL)

RULES = {
    "better": "reproduced: the sign is as claimed and certain, and the mean has the claimed size (half to "
    "twice the paper's unless said otherwise; any, where the paper names none). Direction only: all but the "
    "size. Not supported: the sign is not certain, or the effect is negligible. Contradicted: the opposite "
    "is certain",
    "certain": "the 95 % interval over scenes excludes no effect, and so does the exact signed-rank test at "
    f"5 % (from {_LEAST} scenes that have any, below which it cannot): a mean that few scenes make is not it",
    "negligible": "the whole interval is nearer to no effect than the check says that anyone would care for",
    "within": "reproduced: the whole 95 % interval over scenes lies within the bounds. Contradicted: it lies "
    "outside of them. Not supported: it crosses one, so scenes leave open whether the effect is that small",
    "monotone": "each scene's effect is its change from the first level to the last along the straight line "
    "through all levels. Reproduced: as by `better`, and the means over scenes rise or fall with each level "
    "as claimed. Direction only: the change is as claimed and certain, but some step or the size is not",
    "along a knob": "the effect is its change between two values of a knob, by the straight line through the "
    "scenes, with Student's interval and no ranks; judged by the check's own rule",
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
    neutral = check.neutral
    if low <= neutral <= high or is_negligible(check, effect) or not signs_agree(check, effect):
        return "not supported"
    if high < neutral:
        return "contradicted"
    least, most = check.range or (-math.inf, math.inf)
    sized = least <= effect.mean <= most
    rising = all(one < other for one, other in pairwise(effect.course))
    return "reproduced" if sized and rising else "direction only"


def is_negligible(check: Check, effect: Effect) -> bool:
    """Whether the whole interval is so near to no effect that the check calls it none."""
    low, high = effect.interval
    neutral = check.neutral
    return max(abs(low - neutral), abs(high - neutral)) <= check.negligible


def signs_agree(check: Check, effect: Effect) -> bool:
    """Tell whether scenes have the sign of the mean more often than by chance, as far as so many can tell."""
    from scipy.stats import rankdata  # takes a second to import

    scale = np.log if check.scale == "ratio" else np.asarray
    values = scale(list(effect.scenes.values()))
    if effect.p_rank is None or np.count_nonzero(values) < _LEAST:
        return True
    ranks = float((rankdata(np.abs(values)) * np.sign(values)).sum())
    return effect.p_rank < 1 - LEVEL and (ranks > 0) is (effect.mean > check.neutral)


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
