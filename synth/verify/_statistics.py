# SPDX-License-Identifier: Apache-2.0
r"""Tests of two noisy pictures of one thing, exact whatever the distribution of the noise.

Two pictures that come from the same estimator with independent random numbers may be exchanged pixel by
pixel, so the difference ``d`` of each pixel is as likely as ``-d``. For independent, symmetric ``d`` and
weights ``w`` that do not depend on their signs::

    z = Σ w d / sqrt(Σ w² d²),   P(|z| >= x) <= 2 exp(-x² / 2)

(Efron 1969, "Student's t-test under symmetry conditions"; the bound is Hoeffding 1963, theorem 2, applied to
the signs). It holds for caustics and fireflies too, where a z-test that trusts an estimated variance does
not. Weights may be made of ``a + b`` and ``d²`` of all pixels: no sign is in them.
"""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from scipy import ndimage

from graycard.synth._spec import SUB_BUFFERS

FALSE_ALARM = 1e-4
"""Rate: how often a faultless scene fails any of its statistical checks, at most."""

FAMILIES = 20
"""Names of statistical checks, among which a scene's false alarms are shared equally."""

TILE = 16
"""Least side of a tile, pixels: of n pixels ``|z|`` is at most sqrt(n), which must exceed the bound."""

CONTRASTS = 2 * SUB_BUFFERS - 1
"""Independent comparisons among the images of two pictures."""

_SMOOTHING = 5
"""Side of the square over which ``d²`` is averaged into a local variance, pixels."""

_ROUNDING = 2e-5
"""Relative difference of two renderers in float32 that is none; it is systematic, not symmetric."""


def bound_of(tests: int) -> float:
    """Return the ``|z|`` that none of so many tests of one check exceeds in a faultless scene.

    Šidák's correction: all tests together fail with :data:`FALSE_ALARM` / :data:`FAMILIES` at most.
    """
    alone = 1 - (1 - FALSE_ALARM / FAMILIES) ** (1 / max(tests, 1))
    return float(np.sqrt(2 * np.log(2 / alone)))


def difference(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return ``a - b``, float64, 0 where they are equal up to the rounding of two renderers."""
    a, b = np.asarray(a, dtype=np.float64), np.asarray(b, dtype=np.float64)
    d = a - b
    return np.where(np.abs(d) <= _ROUNDING * (np.abs(a) + np.abs(b)), 0, d)


def local_variance(d: np.ndarray) -> np.ndarray:
    """Mean of ``d²`` around each pixel, shape ``(H, W, C)`` as ``d``."""
    return ndimage.uniform_filter(d**2, size=_SMOOTHING, axes=(0, 1))


def gain_weights(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Weights that find a common factor with the least noise: mean over variance, shape ``(H, W, C)``."""
    level = (np.asarray(a, dtype=np.float64) + b) / 2
    variance = local_variance(difference(a, b)) + (1e-4 * level) ** 2
    return np.where(variance > 0, level / np.where(variance > 0, variance, 1), 0)


def shift_weights(a: np.ndarray, b: np.ndarray, axis: int) -> np.ndarray:
    """Weights that find a displacement along an axis: slope over variance, shape ``(H, W, C)``."""
    level = (np.asarray(a, dtype=np.float64) + b) / 2
    variance = local_variance(difference(a, b)) + (1e-3 * level) ** 2
    slope = np.gradient(level, axis=axis)
    return np.where(variance > 0, slope / np.where(variance > 0, variance, 1), 0)


def z_of(weights: np.ndarray, d: np.ndarray) -> float:
    """Return the self-normalised sum of the module's head; 0 where all differences are 0."""
    contributions = weights * d
    spread = np.sqrt((contributions**2).sum())
    return float(contributions.sum() / spread) if spread > 0 else 0.0


def contrast_share(halves: Sequence[np.ndarray]) -> np.ndarray:
    """Share of two pictures' difference in the spread of their four halves; NaN where there is no spread.

    Four independent images of one distribution have three orthogonal contrasts of two against two, each as
    likely to be the largest: the share of one is in [0, 1] with the mean 1/3, whatever the distribution.
    Where the first two are of another picture than the last two, it tends to 1, whichever is the brighter.

    Args:
        halves: Of one picture, then of the other: four of shape ``(H, W, C)``.

    Returns:
        Mean over the channels, shape ``(H, W)``.
    """
    a, b, c, d = (np.asarray(half, dtype=np.float64) for half in halves)
    between, others = (a + b - c - d) ** 2, (a - b + c - d) ** 2 + (a - b - c + d) ** 2
    rounding = (_ROUNDING * (a + b + c + d)) ** 2
    noisy = (between + others > rounding).all(axis=-1)
    return np.where(
        noisy, (between / np.where(between + others > 0, between + others, 1)).mean(axis=-1), np.nan
    )


def spread_share(means: Sequence[np.ndarray], variances: Sequence[np.ndarray]) -> np.ndarray:
    """Share of two pictures' difference in the spread of all images that they are means of.

    Eight independent images of one distribution have :data:`CONTRASTS` orthogonal contrasts, so the share of
    one is in [0, 1] with the mean 1 / :data:`CONTRASTS`. The sum of squares of a picture's n images is
    n (n - 1) times the variance of their mean, and that between both pictures is n / 2 times the square.

    Args:
        means: Both pictures, each ``(H, W, C)``.
        variances: Those of both means, likewise.

    Returns:
        Mean over the channels, shape ``(H, W)``; NaN where there is no spread.
    """
    a, b = (np.asarray(mean, dtype=np.float64) for mean in means)
    within = 2 * (SUB_BUFFERS - 1) * np.sum(variances, axis=0, dtype=np.float64)
    noisy = (within > (_ROUNDING * (a + b)) ** 2).all(axis=-1)
    square = (a - b) ** 2
    return np.where(noisy, (square / np.where(within > 0, square + within, 1)).mean(axis=-1), np.nan)


def variance_share(means: Sequence[np.ndarray], variances: Sequence[np.ndarray]) -> np.ndarray:
    """Share of the first of two estimated variances in their sum: of one quantity its mean is 1/2.

    Args:
        means: As of :func:`spread_share`.
        variances: As there.

    Returns:
        Mean over the channels, shape ``(H, W)``; NaN where there is no spread.
    """
    one, other = (np.asarray(variance, dtype=np.float64) for variance in variances)
    whole, level = one + other, np.sum(means, axis=0, dtype=np.float64)
    noisy = (whole > (_ROUNDING * level) ** 2).all(axis=-1)
    return np.where(noisy, (one / np.where(whole > 0, whole, 1)).mean(axis=-1), np.nan)


def z_of_shares(shares: np.ndarray, expected: float) -> float:
    """Return how far the mean of independent values in [0, 1] is off, as the z of the same bound.

    Hoeffding 1963, theorem 2: ``P(|mean - expected| >= t) <= 2 exp(-2 n t²)``, so ``z = 2 t sqrt(n)``.
    """
    known = shares[np.isfinite(shares)]
    return float(2 * np.sqrt(known.size) * abs(known.mean() - expected)) if known.size else 0.0


def gain_of(weights: np.ndarray, a: np.ndarray, b: np.ndarray) -> float:
    """By how much ``a`` is brighter than ``b``, as a share of their mean."""
    level = (weights * (np.asarray(a, dtype=np.float64) + b) / 2).sum()
    return float((weights * difference(a, b)).sum() / level) if level else 0.0


def tiles(height: int, width: int) -> list[tuple[slice, slice]]:
    """Tiles of at least :data:`TILE` pixels a side that cover an image; the whole of a smaller one."""
    return [(rows, columns) for rows in _cuts(height) for columns in _cuts(width)]


def _cuts(length: int) -> list[slice]:
    edges = np.linspace(0, length, max(length // TILE, 1) + 1).astype(int)
    return [slice(int(low), int(high)) for low, high in pairwise(edges)]
