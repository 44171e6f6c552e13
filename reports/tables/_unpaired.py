# SPDX-License-Identifier: Apache-2.0
"""Lights without a partner that weigh in a score of lights, and at which price."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

from graycard.records import JobResult, Score
from graycard.reports._format import format_value
from graycard.reports._scores import find_score

Mean = Callable[[Iterable[tuple[str, float]]], float]
"""Mean over scenes of pairs of scene and value."""
MISSING, EXTRA = "light.missing", "light.extra"
POSITION = "light.position"
"""The metric whose mean is over the larger number of lights, so that missing and extra ones enter."""
PRICES = {
    "light.intensity": 10.0,
    "light.intensity.channel": 10.0,
    "light.chromaticity": 90.0,
    "light.direction": 180.0,
    "light.extent": 100.0,
}
"""Error of a true light without a partner, by the metrics whose mean is over true lights alone."""
_JUDGED = {"light.direction": " that have an axis", "light.extent": " that have an extent"}
"""Lights that a metric judges, where these are not all."""


@dataclass(frozen=True, slots=True)
class Unpaired:
    """Lights without a partner that enter a score."""

    missing: float
    extra: float
    due: float
    """The part of the value that they make; 0 where it is not known."""
    hint: str
    """Their price in words."""


def unpaired_lights(result: JobResult, score: Score) -> Unpaired | None:
    """Return lights without a partner that enter a score; None where none can, or it is not known."""
    if score.metric == POSITION:
        return _in_position(result, score)
    if score.metric not in PRICES or not score.expected:
        return None
    missing, price = score.expected - score.scored, PRICES[score.metric]
    hint = (
        f"A light that is missing counts {price:g} {score.unit} in the mean over true lights"
        f"{_JUDGED.get(score.metric, '')}. Extra lights do not enter it."
    )
    return Unpaired(missing, 0.0, price * missing / score.expected, hint)


def unpaired_words(found: Sequence[tuple[str, Unpaired]], unit: str, mean: Mean) -> str:
    """Say how many lights have no partner and which part of the value they make; empty where all have one.

    Args:
        found: Pairs of a scene and what a job found there.
        unit: Of the value.
        mean: Returns the mean over scenes.
    """
    if not found:
        return ""
    missing = mean((scene, own.missing) for scene, own in found)
    extra = mean((scene, own.extra) for scene, own in found)
    due = mean((scene, own.due) for scene, own in found)
    told = [f"{number:.2g} {word}" for number, word in ((missing, "missing"), (extra, "extra")) if number]
    noun = "light" if missing + extra == 1 else "lights"
    part = f"{format_value(due, unit)} by " if due else ""
    return f"{part}{', '.join(told)} {noun}" if told else ""


def _in_position(result: JobResult, score: Score) -> Unpaired | None:
    counts = [found.value for name in (MISSING, EXTRA) if (found := find_score(result, name))]
    if len(counts) < 2:
        return None
    missing, extra = (number or 0.0 for number in counts)
    lights = score.expected + extra
    due = 100 * (missing + extra) / lights if lights else 0.0
    hint = (
        "A light that is missing or too many counts 100 % of the diameter in the mean over lights. "
        "One exact and one missing make 50 %."
    )
    return Unpaired(missing, extra, due, hint)
