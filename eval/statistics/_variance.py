# SPDX-License-Identifier: Apache-2.0
"""Split of a spread into that between scenes and that between fits of one scene with different seeds."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

_LARGEST_RATIO = 1e6
"""Of the scenes' variance to that of seeds: beyond it, seeds do not matter."""


@dataclass(frozen=True, slots=True)
class VarianceSplit:
    """Two standard deviations, in the unit of the scores."""

    scene_sd: float | None
    """Between scenes, if each were fitted with very many seeds; None for fewer than 2 scenes."""
    seed_sd: float | None
    """Between fits of one scene; None where each scene was fitted once."""


@dataclass(frozen=True, slots=True)
class _Layout:
    """What the likelihood of a one-way layout needs."""

    counts: np.ndarray
    """Seeds of each scene."""
    means: np.ndarray
    inside: float
    """Sum of squares within scenes."""


def split_variance(scenes: Sequence[Sequence[float]]) -> VarianceSplit:
    """Return components of variance of a one-way layout by restricted maximum likelihood (REML).

    The model is score = mean + scene + seed, both deviations normal (Searle, Casella and McCulloch 1992,
    chapter 3.8). Of as many seeds for each scene the estimates are those of the analysis of variance, with a
    negative variance set to 0. Where each scene was fitted once, the part of seeds stays in that of scenes.

    Args:
        scenes: The scores of each scene, one for each seed; finite.

    Returns:
        Both None for infinite scores.

    Raises:
        ValueError: A scene has no score.
    """
    if any(not len(values) for values in scenes):
        raise ValueError("expected a score or more for each scene, got a scene with none")
    if not all(math.isfinite(v) for values in scenes for v in values):
        return VarianceSplit(None, None)
    counts = np.array([len(values) for values in scenes])
    means = np.array([np.mean(values) for values in scenes])
    inside = sum(float(((np.asarray(v) - np.mean(v)) ** 2).sum()) for v in scenes)
    spare = int((counts - 1).sum())
    if len(counts) < 2:
        return VarianceSplit(None, math.sqrt(inside / spare) if spare else None)
    if not spare:
        return VarianceSplit(float(means.std(ddof=1)), None)
    if inside == 0:
        return VarianceSplit(float(means.std(ddof=1)), 0.0)
    return _restricted(_Layout(counts, means, inside))


def _restricted(layout: _Layout) -> VarianceSplit:
    """Return the split of greatest restricted likelihood, by its one free number, the ratio of variances."""
    from scipy.optimize import minimize_scalar  # takes a second to import

    reach = math.log(_LARGEST_RATIO)
    found: Any = minimize_scalar(
        lambda place: _deviance(layout, math.exp(place)), bounds=(-reach, reach), method="bounded",
        options={"xatol": 1e-10},
    )  # fmt: skip
    ratio = math.exp(found.x)
    if _deviance(layout, 0.0) <= found.fun:
        ratio = 0.0
    within = _within(layout, ratio)
    return VarianceSplit(math.sqrt(ratio * within), math.sqrt(within))


def _within(layout: _Layout, ratio: float) -> float:
    """Return the variance between seeds that fits best for a ratio of variances."""
    weights = layout.counts / (1 + ratio * layout.counts)
    centre = (weights * layout.means).sum() / weights.sum()
    squares = layout.inside + float((weights * (layout.means - centre) ** 2).sum())
    return squares / (int(layout.counts.sum()) - 1)


def _deviance(layout: _Layout, ratio: float) -> float:
    """Return -2 log of the restricted likelihood at a ratio of variances, up to a constant."""
    spread = 1 + ratio * layout.counts
    free = int(layout.counts.sum()) - 1
    return float(
        free * math.log(_within(layout, ratio))
        + np.log(spread).sum()
        + math.log((layout.counts / spread).sum())
    )
