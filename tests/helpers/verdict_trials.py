# SPDX-License-Identifier: Apache-2.0
"""Trials of the rule of verdicts: coverage of its interval, errors of its words, and their power.

``python tests/helpers/verdict_trials.py`` prints the tables of docs/lab-notes/2026-11-error-rates.md. An
effect over scenes has a centre, the pseudomedian that the Hodges-Lehmann estimate is of. Deviations are drawn
from five distributions of standard deviation 1. The band of the claim is 0.5 to 2 times its size.
"""

import sys
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from effect_shapes import SHAPES
from graycard.benchmarks.claims import Check, Quantity
from graycard.benchmarks.claims._effects import Effects, Levels
from graycard.benchmarks.claims._rules import combined, levels_for, verdicts_of
from graycard.eval.statistics import LEVEL, locations, locations_at

SIZE = 2.0
"""Size of the claimed effect, in standard deviations between scenes."""
CHECK = Check(
    "a", "it is better", "better", Quantity("psnr"), ("mine", "theirs"), "higher", paper=SIZE, negligible=0.1
)
COUNTS = (6, 8, 12, 20, 40)


@dataclass(frozen=True, slots=True)
class Shares:
    """Shares of trials."""

    covered: float
    """In which the interval holds the true effect."""
    words: Mapping[str, float]
    """With each verdict."""


@cache
def shares(shape: str, effect: float, count: int, trials: int = 20_000, seed: int = 0) -> Shares:
    """Return how often the rule gives each verdict on an effect.

    Args:
        shape: Name of the distribution of scenes.
        effect: The true centre.
        count: Scenes.
        trials: Number of draws.
        seed: Of the draws.
    """
    drawn = effect + SHAPES[shape](np.random.default_rng([seed, count]), (count, trials))
    _, low, high = locations(drawn)
    words = Counter(verdicts_of(CHECK, Effects((low, high), (low, high)), "all"))
    covered = float(((low <= effect) & (effect <= high)).mean())
    return Shares(covered, {word: times / trials for word, times in words.items()})


FALSE = {
    "reproduced": 0.0,
    "contradicted": 0.0,
    "smaller than claimed": SIZE / 2,
    "larger than claimed": SIZE * 2,
}
"""Words, and the true effect at which they are false and likeliest."""


def wrong_claims(checks: int, shape: str, count: int, trials: int = 4_000, seed: int = 0) -> float:
    """Return how often a claim with several checks is called smaller than claimed, or contradicted, falsely.

    Every check has the least effect of the band, and its scenes are drawn apart from those of the others.
    """
    random = np.random.default_rng([seed, count, checks])
    levels = Levels(LEVEL, levels_for(checks, LEVEL))
    found = []
    for _ in range(checks):
        drawn = SIZE / 2 + SHAPES[shape](random, (count, trials))
        usual, strict = (ends[1:] for ends in locations_at(drawn, levels.usual, levels.strict))
        found.append(verdicts_of(CHECK, Effects(usual, strict), "all"))
    verdicts = (combined(one, "all") for one in zip(*found, strict=True))
    return (
        sum(verdict in ("contradicted", "no effect", "smaller than claimed") for verdict in verdicts) / trials
    )


def wrong_courses(
    rows: int, shape: str, count: int, trials: int = 4_000, seed: int = 0, fall: float = 0.0
) -> float:
    """Return how often a course that is claimed to rise, and is flat, is contradicted.

    Args:
        rows: Its levels.
        shape: Name of the distribution of each step over scenes; steps are drawn apart.
        count: Scenes.
        trials: Number of draws.
        seed: Of the draws.
        fall: By which each step goes down in truth, in standard deviations.
    """
    check = replace(
        CHECK, rule="monotone", rows=tuple(f"row {k}" for k in range(rows)), paper=None, negligible=0.0
    )
    levels = Levels(LEVEL, levels_for(check.statements, LEVEL))
    random = np.random.default_rng([seed, count, rows])
    steps = np.stack([SHAPES[shape](random, (count, trials)) for _ in range(rows - 1)]) - fall
    values = np.concatenate([np.zeros_like(steps[:1]), steps.cumsum(axis=0)])
    places = np.arange(rows) - (rows - 1) / 2
    change = np.tensordot(places, values, 1) / (places @ places) * (rows - 1)
    usual, strict = (found[1:] for found in locations_at(change, levels.usual, levels.strict))
    ends = [(middle, high) for middle, _, high in (locations(step, levels.strict) for step in steps)]
    return verdicts_of(check, Effects(usual, strict, ends), "all").count("contradicted") / trials


def main() -> None:
    """Print coverage, false words and power by distribution and number of scenes, then claims of several
    checks, then courses."""
    heads = "distribution", "n", "covered", *(f"false {word}" for word in FALSE)
    _row(*heads, "reproduced at 1.5", "reproduced at 2", "refuted at 0")
    _row(*["---"] * (len(heads) + 3))
    for shape in SHAPES:
        for count in COUNTS:
            at = {effect: shares(shape, effect, count) for effect in {0.0, *FALSE.values(), 1.5, SIZE}}
            wrong = [share_of(at[effect].words, word) for word, effect in FALSE.items()]
            power = [share_of(at[effect].words, "reproduced") for effect in (1.5, SIZE)]
            refuted = sum(
                at[0.0].words.get(w, 0.0) for w in ("contradicted", "no effect", "smaller than claimed")
            )
            _row(shape, str(count), *map(_percent, (at[0.0].covered, *wrong, *power, refuted)))
    sys.stdout.write("\n")
    checks = 1, 2, 3, 5, 10
    _row("distribution", "n", *(f"{number} checks" for number in checks))
    _row(*["---"] * (len(checks) + 2))
    for shape in SHAPES:
        for count in (8, 20):
            _row(shape, str(count), *(_percent(wrong_claims(number, shape, count)) for number in checks))
    sys.stdout.write("\n")
    rows = 3, 4, 6
    _row("distribution", "n", *(f"{number} levels" for number in rows))
    _row(*["---"] * (len(rows) + 2))
    for shape in SHAPES:
        for count in (8, 12, 20):
            _row(shape, str(count), *(_percent(wrong_courses(number, shape, count)) for number in rows))


def share_of(words: Mapping[str, float], word: str) -> float:
    """Return the share of a word; larger than claimed counts as reproduced, too."""
    also = words.get("larger than claimed", 0.0) if word == "reproduced" else 0.0
    return words.get(word, 0.0) + also


def _percent(share: float) -> str:
    return f"{100 * share:.1f} %"


def _row(*cells: str) -> None:
    sys.stdout.write(f"| {' | '.join(cells)} |\n")


if __name__ == "__main__":
    main()
