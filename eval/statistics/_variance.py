# SPDX-License-Identifier: Apache-2.0
"""Split of a spread into that between scenes and that between fits of one scene with different seeds."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, slots=True)
class VarianceSplit:
    """Two standard deviations, in the unit of the scores."""

    scene_sd: float | None
    """Between scenes, if each were fitted with very many seeds; None for fewer than 2 scenes."""
    seed_sd: float | None
    """Between fits of one scene; None where each scene was fitted once."""


def split_variance(scenes: Sequence[Sequence[float]]) -> VarianceSplit:
    """Components of variance of a one-way layout, by analysis of variance (Searle et al. 1992, chapter 3.6).

    Seeds: the pooled variance within scenes. Scenes: (MS between - MS within) / n0, with n0 the number of
    seeds (a weighted one where scenes differ in it); what comes out negative is 0. Where each scene was
    fitted once, the seed's part cannot be told and stays in that of the scenes.

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
    spare = int((counts - 1).sum())
    inside = sum(float(((np.asarray(v) - np.mean(v)) ** 2).sum()) for v in scenes)
    within = inside / spare if spare else None
    seed_sd = None if within is None else math.sqrt(within)
    return VarianceSplit(_between(counts, means, within or 0.0), seed_sd)


def _between(counts: np.ndarray, means: np.ndarray, within: float) -> float | None:
    if len(counts) < 2:
        return None
    total = counts.sum()
    grand = float((counts * means).sum() / total)
    square = float((counts * (means - grand) ** 2).sum()) / (len(counts) - 1)
    weighted = (total - (counts**2).sum() / total) / (len(counts) - 1)
    return math.sqrt(max(0.0, (square - within) / weighted))
