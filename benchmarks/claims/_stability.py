# SPDX-License-Identifier: Apache-2.0
"""How often refits of the same scenes would give the same verdict, by simulation.

A refit keeps the scenes and draws the fits anew. What a scene's effect is apart from the noise of its fit is
known only up to that noise: it is drawn about the value that shrinks the measured one towards the centre of
all (the predictor of least error, Searle, Casella and McCulloch 1992, chapter 7), and a new fit is drawn
about it.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from graycard.benchmarks.claims._effects import Effect, Levels, Sample, effects_at, step_at
from graycard.benchmarks.claims._noise import FitNoise
from graycard.benchmarks.claims._rules import STABLE, combined, verdict_of
from graycard.records import ClaimVerdict

REFITS: Final = 1000
_SEED: Final = 30
_SEEDS: Final = (2, 3, 4, 6, 8, 12, 16, 24, 32, 48, 64)


@dataclass(frozen=True, slots=True)
class Judged:
    """A check with all that its verdict and those of its refits need."""

    sample: Sample
    effect: Effect
    verdict: ClaimVerdict
    noise: FitNoise | None


@dataclass(frozen=True, slots=True)
class Deciding:
    """The checks that a verdict follows from."""

    checks: tuple[Judged, ...]
    others: tuple[ClaimVerdict, ...]
    """Verdicts of those that could not be made."""
    levels: Levels
    by: str
    """``all`` or ``any`` of them."""
    words: Mapping[ClaimVerdict, ClaimVerdict]
    """Words in place of the rules', which may be the same for several of them."""

    @property
    def verdict(self) -> ClaimVerdict:
        """The verdict of the rules, in their words."""
        return combined([*(check.verdict for check in self.checks), *self.others], self.by)

    def word(self, verdict: ClaimVerdict) -> ClaimVerdict:
        """Return what a verdict of the rules is called here."""
        return self.words.get(verdict, verdict)

    def stability(self) -> float | None:
        """Return the share of refits with the same word; None where no check's noise is known.

        Checks are refitted independently; one of unknown noise keeps its verdict.
        """
        columns = [refit_verdicts(check, self.levels, self.by, k) for k, check in enumerate(self.checks)]
        if all(column is None for column in columns):
            return None
        whole = [c or [check.verdict] * REFITS for c, check in zip(columns, self.checks, strict=True)]
        rows: list[tuple[ClaimVerdict, ...]] = list(zip(*whole, strict=True))
        found = self.word(self.verdict)
        return sum(self.word(combined([*row, *self.others], self.by)) == found for row in rows) / REFITS

    def seeds(self) -> int | None:
        """Return the fewest fits of each scene whose means would be stable.

        One of a few numbers up to 64; None where not even so many are enough.
        """
        for seeds in _SEEDS:
            finer = tuple(replace(check, noise=_averaged(check.noise, seeds)) for check in self.checks)
            share = replace(self, checks=finer).stability()
            if share is not None and share >= STABLE:
                return seeds
        return None


def refit_verdicts(judged: Judged, levels: Levels, by: str, stream: int = 0) -> list[ClaimVerdict] | None:
    """Return the verdict on a check in each of many simulated refits; None where the noise is not known.

    Args:
        judged: The check.
        levels: Of its intervals.
        by: How its claim is judged.
        stream: Which random numbers: those of the checks of a claim are drawn apart.
    """
    if judged.noise is None:
        return None
    sample, noise = judged.sample, judged.noise.sd_of_mean
    random = np.random.default_rng([_SEED, stream])
    drawn = _refits(sample.effects, sample.centre, noise, random)
    steps = [_refits(step, float(step.mean()), noise, random) for step in sample.steps.T]
    ends = [step_at(step, len(steps), levels) for step in steps]
    usual, strict = effects_at(sample, drawn, levels)
    return [verdict_of(sample.check, _effect(sample, k, usual, strict, ends), by) for k in range(REFITS)]


def _averaged(noise: FitNoise | None, seeds: int) -> FitNoise | None:
    """Return the noise of so many fits of each scene."""
    return None if noise is None else replace(noise, seeds=max(seeds, noise.seeds))


def _refits(
    effects: np.ndarray, centre: np.ndarray | float, noise: float, random: np.random.Generator
) -> np.ndarray:
    """Return effects of the same scenes fitted anew, shape ``(scenes, REFITS)``."""
    spread = float(((effects - centre) ** 2).sum() / max(len(effects) - 1, 1))
    kept = max(0.0, 1 - noise**2 / spread) if spread > 0 else 0.0
    middle = centre + kept * (effects - centre)
    return middle[:, None] + noise * np.sqrt(1 + kept) * random.standard_normal((len(effects), REFITS))


def _effect(
    sample: Sample,
    k: int,
    usual: Sequence[np.ndarray],
    strict: Sequence[np.ndarray],
    steps: Sequence[tuple[np.ndarray, np.ndarray]],
) -> Effect:
    """Return one refit as a summary."""
    back = sample.back
    return Effect(
        back(usual[0][k]),
        (back(usual[1][k]), back(usual[2][k])),
        (back(strict[1][k]), back(strict[2][k])),
        tuple((float(middle[k]), float(high[k])) for middle, high in steps),
    )
