# SPDX-License-Identifier: Apache-2.0
"""Refits of a run, drawn one by one, and the noise of fits by its definition."""

import math
from typing import Any

import numpy as np

from claims_by_hand import cut_off, estimate_of


def deviation(seeds: np.ndarray) -> float:
    """Return the pooled standard deviation within scenes, from its definition."""
    squares = sum(sum((value - scene.mean()) ** 2 for value in scene) for scene in seeds)
    return math.sqrt(squares / (seeds.size - len(seeds)))


def refits(
    effects: np.ndarray,
    noise: float,
    freedom: float = math.inf,
    had: int = 2,
    seeds: int = 2,
    most: float = math.inf,
    count: int = 20_000,
) -> tuple[np.ndarray, np.ndarray]:
    """Return both ends of intervals of refits, in the order in which they would come about.

    First what the noise is, then where the centre is, then what each scene's effect is, then new fits of it.

    Args:
        effects: Means over the fits of each scene.
        noise: Standard deviation of one fit, as it was estimated.
        freedom: Of that estimate.
        had: Fits of each scene.
        seeds: Fits of each scene in a refit.
        most: No variance is drawn above it.
        count: Refits.
    """
    random, scenes = np.random.default_rng(4711), len(effects)
    shape, centre = (count, scenes), estimate_of(effects)
    known = math.isinf(freedom)
    variance = noise**2 * (np.ones(count) if known else freedom / random.chisquare(freedom, count))
    fits = np.minimum(variance, most)[:, None]
    kept = np.maximum(0, 1 - fits / had / effects.var(ddof=1))
    around = random.normal(centre, np.sqrt((1 - kept) * fits / had / scenes))
    true = random.normal(around + kept * (effects - centre), np.sqrt(kept * fits / had), shape)
    again = random.normal(true, np.sqrt(fits / seeds))
    one, other = np.triu_indices(scenes)
    walsh = np.sort((again[:, one] + again[:, other]) / 2, axis=1)
    outside = cut_off(scenes, 0.95)
    return walsh[:, outside], walsh[:, -1 - outside]


def share_above(effects: np.ndarray, noise: float, freedom: float = math.inf, **more: Any) -> float:
    low, _ = refits(effects, noise, freedom, **more)
    return float((low > 0).mean())
