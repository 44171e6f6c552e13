# SPDX-License-Identifier: Apache-2.0
"""From an effect to a verdict."""

import math
from collections.abc import Iterable, Mapping, Sequence
from functools import reduce
from typing import Final

import numpy as np

from graycard.benchmarks.claims._claim import Check, Claim
from graycard.benchmarks.claims._effects import Effect, Effects
from graycard.eval.statistics import LEVEL, least_scenes
from graycard.records import ClaimVerdict

_LEAST: Final = least_scenes(LEVEL)

STABLE: Final = 0.9
"""Share of refits that have to give the same verdict."""

_SHARED: Final = 0.75
"""Part of the error of one check that several checks share."""

RULES = {
    "interval": "of the centre of effects over scenes (Hodges-Lehmann), at the level of the ledger by "
    f"the exact signed-rank test, at 95 % from {_LEAST} scenes; seeds of a scene are averaged first, so "
    "it holds what scenes and fits differ by",
    "better": "contradicted: the whole interval is below no effect. No effect: all of it is nearer to "
    "none than the check's margin. Smaller than claimed: all of it is below the band of the claim, or "
    "leaves no room for more than the margin. Larger than claimed: all of it is above the band. "
    "Reproduced: it is above no effect and meets the band. Undecided: else",
    "band": "half to twice the paper's figure unless the check says otherwise; any size, where the "
    "paper names none",
    "within": "reproduced: the whole interval lies within the bounds. Contradicted: it lies outside "
    "of them. Undecided: it crosses one",
    "monotone": "each scene's effect is its change from the first level to the last along the "
    "straight line through all levels, judged as by `better`. A step between two levels that certainly "
    "goes the other way contradicts the claim; one whose estimate does leaves it undecided",
    "along a knob": "the effect is its change between two values of a knob, by the straight line "
    "through the scenes, with Student's interval; judged by the check's own rule, where three scenes or "
    "more stand towards either value",
    "all": "a claim is as good as its worst check that decides",
    "any": "a claim is as good as its best check that decides",
    "several checks": "a word that one of several checks, or one step of a course, is enough for is "
    "asked at 100 % less 3.75 % over the number of their intervals: the chance that any of them errs "
    "stays below 5 %",
    "stability": "the share of simulated refits of the same scenes that would give the same verdict; "
    f"below {STABLE:.0%}, or where nobody measured how far fits differ, the verdict is undecided",
    "not converged": "a row whose model contains that of another row, and which explains its own "
    "photographs worse on the scenes of a claim, by more than 0.1 dB in the centre, is not fitted to "
    "the end: the claim is undecided until it is",
    "budgets": "a verdict that turns when each fit has half or twice the steps is undecided",
    "not testable here": "rows, scenes or scores are missing in this run, or the claim needs what is "
    "not here. A row without a score on one scene is never judged on the others",
    "own questions": "graycard asks more than papers claim. Such a question holds, does not hold, or "
    "is open; it contradicts nobody",
    "arithmetic": "consistent: the mean of a table's entries is that printed within the rounding of "
    "both, and rows of different things differ. Inconsistent: they do not",
}
"""Demands of each rule, by its name."""

ORDER: tuple[ClaimVerdict, ...] = (
    "contradicted", "no effect", "smaller than claimed",
    "not testable here", "undecided", "reproduced", "larger than claimed",
)  # fmt: skip
"""From the least favourable to the most; the second and the third are equally so."""

OWN: dict[ClaimVerdict, ClaimVerdict] = {
    "reproduced": "holds",
    "larger than claimed": "holds",
    "no effect": "does not hold",
    "smaller than claimed": "does not hold",
    "contradicted": "does not hold",
    "undecided": "open",
}
"""The words of graycard's own questions."""


def words_of(claim: Claim) -> Mapping[ClaimVerdict, ClaimVerdict]:
    """Return the words in place of the rules': those of graycard's own questions."""
    return OWN if claim.asked_by == "graycard" else {}


OPEN: Final = frozenset({"undecided", "open"})
"""Verdicts that more scenes or seeds may change."""


def is_decided(verdict: ClaimVerdict) -> bool:
    """Tell if a verdict says more than that nobody knows."""
    return verdict not in OPEN and verdict != "not testable here"


def levels_for(statements: int, level: float) -> float:
    """Return the stricter level of words that one of several intervals is enough for.

    Three quarters of the error are divided by their number. Each end then errs with half of that where
    effects are symmetric; the rest is left for skew, which signed ranks bear with errors of up to twice as
    much.
    """
    return level if statements < 2 else 1 - _SHARED * (1 - level) / statements


def verdict_of(check: Check, effect: Effect, by: str) -> ClaimVerdict:
    """Return the verdict on one check of a claim that is judged by ``all`` or ``any`` of them."""
    usual, strict, *steps = (
        (np.array([low]), np.array([high])) for low, high in (effect.interval, effect.strict, *effect.steps)
    )
    return verdicts_of(check, Effects(usual, strict, steps), by)[0]


def verdicts_of(check: Check, effects: Effects, by: str) -> list[ClaimVerdict]:
    """Return the verdicts on many samples of the same scenes.

    A claim that names no size claims more than the check's margin. So does one of any size above none: were
    an interval that begins below the margin undecided, a scene that is more favourable could turn it to no
    effect.
    """
    usual, strict = effects.interval, effects.strict
    against, for_it = (strict, usual) if by == "all" else (usual, strict)
    if check.rule == "within":
        return _within(check, against, for_it)
    none = check.neutral
    least, most = check.range or (-math.inf, math.inf)
    words: list[tuple[ClaimVerdict, np.ndarray | bool]] = [
        ("contradicted", _any_of(high < 0 for _, high in effects.steps)),
        ("no effect", _is_negligible(check, against)),
        ("contradicted", against[1] < none),
        ("smaller than claimed", (check.negligible > 0) & (against[1] <= none + check.negligible)),
        ("smaller than claimed", against[1] < least),
        ("undecided", (for_it[0] <= none) | (for_it[1] < least)),
        ("undecided", _any_of(middle <= 0 for middle, _ in effects.steps)),
        ("larger than claimed", for_it[0] > most),
    ]
    return _first_of(words, "reproduced", len(usual[0]))


def combined(verdicts: Sequence[ClaimVerdict], by: str) -> ClaimVerdict:
    """Return the verdict of a claim from those of its deciding checks."""
    ranked = sorted(verdicts, key=ORDER.index)
    return ranked[0] if by == "all" else ranked[-1]


Spans = tuple[np.ndarray, np.ndarray]
"""Lower and upper ends of many intervals, each of shape ``(K,)``."""


def _is_negligible(check: Check, spans: Spans) -> np.ndarray | bool:
    """Tell which intervals are as a whole so near to no effect that the check calls them none."""
    far = [np.abs(end - check.neutral) for end in spans]
    return bool(check.negligible) and np.maximum(*far) <= check.negligible


def _within(check: Check, against: Spans, for_it: Spans) -> list[ClaimVerdict]:
    assert check.accepted is not None, "the file was refused without"
    least, most = check.accepted
    words: list[tuple[ClaimVerdict, np.ndarray | bool]] = [
        ("reproduced", (least <= for_it[0]) & (for_it[1] <= most)),
        ("contradicted", (against[1] < least) | (against[0] > most)),
    ]
    return _first_of(words, "undecided", len(against[0]))


def _any_of(found: Iterable[np.ndarray]) -> np.ndarray | bool:
    """Tell where any of some conditions holds; nowhere, if there is none."""
    return reduce(np.logical_or, found, False)


def _first_of(
    words: Sequence[tuple[ClaimVerdict, np.ndarray | bool]], rest: ClaimVerdict, count: int
) -> list[ClaimVerdict]:
    """Return of each of some samples the first word whose condition holds, or else the rest."""
    places = np.full(count, len(words))
    for place, (_, holds) in reversed([*enumerate(words)]):
        places = np.where(holds, place, places)
    names = [*(word for word, _ in words), rest]
    return [names[place] for place in places.tolist()]
