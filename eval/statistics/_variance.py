# SPDX-License-Identifier: Apache-2.0
"""Split of a spread into that between scenes and that between fits of one scene with different seeds."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

_REACH = math.log(1e6)
"""Logarithm of how far beyond the ratio of plain estimates the best ratio of variances is looked for."""


@dataclass(frozen=True, slots=True)
class VarianceSplit:
    """Two standard deviations, in the unit of the scores."""

    scene_sd: float | None
    """Between scenes, if each were fitted with very many seeds; None for fewer than 2 scenes."""
    seed_sd: float | None
    """Between fits of one scene; None where each scene was fitted once."""


@dataclass(frozen=True, slots=True)
class _Layout:
    """A one-way layout by all that its likelihood needs."""

    counts: np.ndarray
    """Seeds of each scene."""
    means: np.ndarray
    inside: float
    """Sum of squares within scenes."""

    @property
    def within(self) -> float:
        """Mean square within scenes."""
        return self.inside / int((self.counts - 1).sum())


def split_variance(scenes: Sequence[Sequence[float]]) -> VarianceSplit:
    """Return components of variance of a one-way layout by restricted maximum likelihood (REML).

    The model is score = mean + scene + seed, both deviations normal (Searle, Casella and McCulloch 1992,
    chapter 3.8). Of as many seeds for each scene it has a closed form: that of the analysis of variance, or
    all in one where scenes would have a negative variance. Where each scene was fitted once, the part of
    seeds stays in that of scenes.

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
    means = np.array([values[0] if len(values) == 1 else np.mean(values) for values in scenes], np.float64)
    inside = sum(float(((np.asarray(v) - np.mean(v)) ** 2).sum()) for v in scenes if len(v) > 1)
    spare = int((counts - 1).sum())
    if len(counts) < 2:
        return VarianceSplit(None, math.sqrt(inside / spare) if spare else None)
    if not spare:
        return VarianceSplit(float(means.std(ddof=1)), None)
    if inside == 0:
        return VarianceSplit(float(means.std(ddof=1)), 0.0)
    layout = _Layout(counts, means, inside)
    return _balanced(layout) if len(set(counts.tolist())) == 1 else _restricted(layout)


def _balanced(layout: _Layout) -> VarianceSplit:
    """Return the split of scenes with equally many seeds (Searle, Casella and McCulloch 1992, ch. 3.8)."""
    seeds = int(layout.counts[0])
    variance = float(layout.means.var(ddof=1)) - layout.within / seeds
    if variance > 0:
        return VarianceSplit(math.sqrt(variance), math.sqrt(layout.within))
    return VarianceSplit(0.0, math.sqrt(_within(layout, 0.0)))


def _restricted(layout: _Layout) -> VarianceSplit:
    """Return the split of greatest restricted likelihood, by its one free number, the ratio of variances."""
    from scipy.optimize import minimize_scalar  # takes a second to import

    most = max(0.0, _log(float(layout.means.var(ddof=1))) - _log(layout.within))
    found: Any = minimize_scalar(
        lambda place: _deviance(layout, math.exp(place)), bounds=(-_REACH, most + _REACH), method="bounded",
        options={"xatol": 1e-10},
    )  # fmt: skip
    ratio = math.exp(found.x)
    if _deviance(layout, 0.0) <= found.fun:
        ratio = 0.0
    within = _within(layout, ratio)
    return VarianceSplit(math.sqrt(ratio * within), math.sqrt(within))


def _log(value: float) -> float:
    return math.log(value) if value > 0 else -math.inf


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
