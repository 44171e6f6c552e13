# SPDX-License-Identifier: Apache-2.0
"""Share of refits of the same scenes that would give the same verdict, by simulation.

A refit keeps the scenes and draws the fits anew. The effect of a scene without the noise of its fit is known
only up to that noise. So it is drawn about the measured one, shrunk towards the centre of all: the predictor
of least error (Searle, Casella and McCulloch 1992, chapter 7). A new fit is drawn about it.

The variance of the noise is drawn as well, from what its estimate leaves open. Noise that was measured on
other fits is never larger than the whole spread between scenes. A row has one fit for each scene, whichever
checks it stands in: checks of a claim that share a row share its noise.
"""

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from typing import Final
from zlib import crc32

import numpy as np

from graycard.benchmarks.claims._effects import (
    Effect,
    Effects,
    Levels,
    Sample,
    effects_at,
    parts_of,
    spread_of,
    step_at,
    step_parts_of,
)
from graycard.benchmarks.claims._noise import FitNoise
from graycard.benchmarks.claims._rules import STABLE, combined, verdicts_of
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

    @property
    def is_measured(self) -> bool:
        """Tell if any check has an interval."""
        return any(np.isfinite(check.effect.interval).any() for check in self.checks)

    def word(self, verdict: ClaimVerdict) -> ClaimVerdict:
        """Return what a verdict of the rules is called here."""
        return self.words.get(verdict, verdict)

    def stability(self, seeds: int | None = None) -> float | None:
        """Return the share of refits with the same word; None where no check's noise is known.

        A check of unknown noise keeps its verdict.

        Args:
            seeds: Fits of each scene whose means a refit gives; as many as there were, if None.
        """
        columns = [refit_verdicts(check, self.levels, self.by, seeds) for check in self.checks]
        if all(column is None for column in columns):
            return None
        whole = [c or [check.verdict] * REFITS for c, check in zip(columns, self.checks, strict=True)]
        rows: Counter[tuple[ClaimVerdict, ...]] = Counter(zip(*whole, strict=True))
        found = self.word(self.verdict)
        alike = [row for row in rows if self.word(combined([*row, *self.others], self.by)) == found]
        return sum(rows[row] for row in alike) / REFITS

    def seeds(self) -> int | None:
        """Return the fewest fits of each scene whose means would give the same word in :data:`STABLE` of
        refits.

        One of a few numbers up to 64; None where not even so many are enough.
        """
        shares = ((seeds, self.stability(seeds)) for seeds in _SEEDS)
        return next((seeds for seeds, share in shares if share is not None and share >= STABLE), None)


def refit_verdicts(
    judged: Judged, levels: Levels, by: str, seeds: int | None = None
) -> list[ClaimVerdict] | None:
    """Return the verdict on a check in each of many simulated refits; None where the noise is not known.

    Args:
        judged: The check.
        levels: Of its intervals.
        by: How its claim is judged.
        seeds: Fits of each scene; as many as there were, if None.
    """
    if judged.noise is None:
        return None
    sample, noise, back = judged.sample, judged.noise, judged.sample.all_back
    again = max(seeds or noise.seeds, noise.seeds)
    parts = parts_of(sample.check, noise.rows)
    values = _Values(sample.effects, sample.centre, spread_of(sample) ** 2)
    variance = _variances(noise, values.spread) / _weight(parts)
    drawn = _refits(values, parts, sample, variance, again)
    steps = [
        _refits(_Values.of(step), step_parts_of(sample.check, k, noise.rows), sample, variance, again)
        for k, step in enumerate(sample.steps.T)
    ]
    ends = [step_at(step, levels) for step in steps]
    usual, strict = ((back(low), back(high)) for _, low, high in effects_at(sample, drawn, levels))
    return verdicts_of(sample.check, Effects(usual, strict, ends), by)


@dataclass(frozen=True, slots=True)
class _Values:
    """Numbers of scenes, what they scatter about, and their variance about it."""

    found: np.ndarray
    centre: np.ndarray | float
    spread: float

    @classmethod
    def of(cls, found: np.ndarray) -> "_Values":
        return cls(found, float(found.mean()), float(found.var(ddof=1)) if len(found) > 1 else 0.0)


def _variances(noise: FitNoise, spread: float) -> np.ndarray:
    """Return variances of an effect between fits that the estimate leaves open, shape ``(REFITS,)``."""
    if not np.isfinite(noise.freedom):
        return np.full(REFITS, noise.sd**2)
    random = np.random.default_rng([_SEED, crc32(" ".join((noise.source, *sorted(noise.rows))).encode())])
    drawn = noise.sd**2 * noise.freedom / random.chisquare(noise.freedom, REFITS)
    return drawn if noise.origin == "these fits" else np.minimum(drawn, spread)


def _weight(parts: Mapping[str, float]) -> float:
    """Return how many times the variance of one row that of the effect is; never 0."""
    return max(sum(part**2 for part in parts.values()), 1e-300)


def _refits(
    values: _Values, parts: Mapping[str, float], sample: Sample, variance: np.ndarray, seeds: int
) -> np.ndarray:
    """Return numbers of the same scenes fitted anew, shape ``(scenes, REFITS)``.

    Args:
        values: As they were found, from means over ``noise.seeds`` fits.
        parts: Weight of each fitted row in them.
        sample: Whose scenes they are.
        variance: Of one fit of one row, shape ``(REFITS,)``.
        seeds: Fits of each scene in a refit.
    """
    weight = _weight(parts)
    count, had = len(values.found), sample.by_seed.shape[1]
    noise = variance * weight / had  # of the numbers as they were found
    kept = np.maximum(0, 1 - noise / values.spread) if values.spread > 0 else np.zeros(REFITS)
    centre = np.broadcast_to(values.centre, (count,))[:, None]
    middle = centre + (values.found[:, None] - centre) * kept
    common = sum(part * _normals(row, "the centre of all") for row, part in parts.items())
    middle = middle + np.sqrt((1 - kept) * noise / count / weight) * common
    drawn = sum(
        part * np.stack([_normals(row, s.scene) for s in sample.scenes]) for row, part in parts.items()
    )
    return middle + np.sqrt((kept * noise + noise * had / seeds) / weight) * drawn


@cache
def _normals(row: str, scene: str) -> np.ndarray:
    """Return the noise of a row on a scene in every refit, in its standard deviations, shape
    ``(REFITS,)``.
    """
    return np.random.default_rng([_SEED, crc32(row.encode()), crc32(scene.encode())]).standard_normal(REFITS)
