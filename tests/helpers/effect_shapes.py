# SPDX-License-Identifier: Apache-2.0
"""Distributions of effects over scenes for trials of verdicts and of looks: pseudomedian 0, sd 1."""

from collections.abc import Callable, Mapping

import numpy as np

Draw = Callable[[np.random.Generator, tuple[int, int]], np.ndarray]
"""Draws effects of shape ``(scenes, trials)``."""


def _outlier(random: np.random.Generator, shape: tuple[int, int]) -> np.ndarray:
    """Return normal values of which the first scene is eight standard deviations off."""
    values = random.standard_normal(shape)
    values[0] += 8
    return values


def _skewed(random: np.random.Generator, shape: tuple[int, int]) -> np.ndarray:
    return random.standard_exponential(shape) - 0.839  # the root of (1 + 2 m) exp(-2 m) = 1/2


def lognormal(sigma: float) -> Draw:
    """Return a draw of lognormal effects of a sigma."""
    middle = _pseudomedian(lambda random, count: random.lognormal(0.0, sigma, count))
    spread = float(np.sqrt((np.exp(sigma**2) - 1) * np.exp(sigma**2)))
    return lambda random, shape: (random.lognormal(0.0, sigma, shape) - middle) / spread


def _pseudomedian(draw: Callable[[np.random.Generator, int], np.ndarray]) -> float:
    random = np.random.default_rng(2)
    return float(np.median((draw(random, 4_000_000) + draw(random, 4_000_000)) / 2))


SHAPES: Mapping[str, Draw] = {
    "normal": lambda random, shape: random.standard_normal(shape),
    "exponential": _skewed,
    "lognormal": lognormal(0.75),
    "Student's t, 3": lambda random, shape: random.standard_t(3, shape) / np.sqrt(3),
    "one outlier": _outlier,
}
