# SPDX-License-Identifier: Apache-2.0
"""Errors of looks at growing numbers of scenes, and how soon they decide.

``python tests/helpers/sequential_trials.py`` writes the tables of docs/lab-notes/2026-11-error-rates.md.
"""

import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy import stats

from effect_shapes import SHAPES, Draw, lognormal
from graycard.eval.statistics import ERROR, level_up_to, p_after_each

BEYOND: Mapping[str, Draw] = {"lognormal, sigma 0.5": lognormal(0.5), "lognormal, sigma 1": lognormal(1.0)}
"""Shapes that are told beside: of less skew, and of more than the part that is kept can bear."""


@dataclass(frozen=True)
class Outcome:
    """A rule on many samples."""

    decided: float
    """Share that it decides at some look."""
    scenes: float
    """Mean number of scenes at which it stops."""


def outcome(hits: np.ndarray, looks: Sequence[int]) -> Outcome:
    """Return how often and how soon a rule decides, from what it says at each look."""
    stops = np.where(hits.any(axis=1), np.asarray(looks)[hits.argmax(axis=1)], looks[-1])
    return Outcome(float(hits.any(axis=1).mean()), float(stops.mean()))


def by_constant_level(samples: np.ndarray, looks: Sequence[int], most: int | None = None) -> Outcome:
    """Return what graycard's rule does: one level at all looks, for up to ``most`` scenes."""
    least = 1 - level_up_to(most or looks[-1])
    return outcome(p_after_each(samples)[:, [n - 1 for n in looks]] <= least * (1 + 1e-12), looks)


def by_rising_level(samples: np.ndarray, looks: Sequence[int], null: np.ndarray, shape: float) -> Outcome:
    """Return what the boundaries of Wang and Tsiatis 1987 do: 0 is that of O'Brien and Fleming 1979."""
    places = [n - 1 for n in looks]
    form = (np.asarray(looks) / looks[-1]) ** (shape - 0.5)
    scaled = stats.norm.isf(null[:, places] / 2) / form
    bound = np.quantile(scaled.max(axis=1), 1 - ERROR)
    return outcome(p_after_each(samples)[:, places] < 2 * stats.norm.sf(bound * form), looks)


def by_mixture(samples: np.ndarray, looks: Sequence[int], rho: float = 8.0) -> Outcome:
    """Return what the time-uniform bound for symmetric effects does (de la Peña 1999, normal mixture)."""
    places = [n - 1 for n in looks]
    total, square = samples.cumsum(axis=1)[:, places], (samples**2).cumsum(axis=1)[:, places] + rho
    return outcome(total**2 >= square * (np.log(square / rho) - 2 * np.log(ERROR)), looks)


def errors(
    looks: Sequence[int], paths: int, seed: int = 1, shapes: Mapping[str, Draw] = SHAPES
) -> dict[str, float]:
    """Return the share of samples without an effect that some look decides, by their shape."""
    chance, size = np.random.default_rng(seed), (looks[-1], 20_000)
    return {
        name: float(np.mean([by_constant_level(draw(chance, size).T, looks).decided
                             for _ in range(max(1, paths // size[1]))]))
        for name, draw in shapes.items()
    }  # fmt: skip


def rivals(effect: float, draw: Draw, paths: int, seed: int = 2) -> dict[str, Outcome]:
    """Return how each rule does on 8 to 40 scenes with an effect, in standard deviations."""
    chance, null_chance = np.random.default_rng(seed), np.random.default_rng(3)
    each, fourth = range(8, 41), range(8, 41, 4)
    samples = draw(chance, (40, paths)).T + effect
    null = p_after_each(null_chance.normal(size=(40_000, 40)))
    return {
        "one level, any looks": by_constant_level(samples, each),
        "Wang-Tsiatis 0.25": by_rising_level(samples, each, null, 0.25),
        "O'Brien-Fleming, each 4": by_rising_level(samples, fourth, null, 0.0),
        "de la Peña": by_mixture(samples, each),
    }


def main() -> None:
    """Write the levels, the errors and the comparison with other rules."""
    for most in (12, 24, 40):
        level = level_up_to(most)
        fewest = next(n for n in range(1, most) if 2.0 ** (1 - n) <= 1 - level)
        sys.stdout.write(f"| {most} | {100 * level:.2f} % | {fewest} |\n")
    for name, share in errors(range(8, 48), 200_000, shapes={**SHAPES, **BEYOND}).items():
        sys.stdout.write(f"| {name} | {100 * share:.1f} % |\n")
    for name in ("normal", "Student's t, 3"):
        for effect in (0.4, 0.8, 1.2):
            found = rivals(effect, SHAPES[name], 10_000)
            cells = (f"{100 * r.decided:.0f} %, {r.scenes:.0f}" for r in found.values())
            sys.stdout.write(f"| {name}, {effect} | {' | '.join(cells)} |\n")


if __name__ == "__main__":
    main()
