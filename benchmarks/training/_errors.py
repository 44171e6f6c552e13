# SPDX-License-Identifier: Apache-2.0
"""Measure errors of a prior's answer about one view, as methods look at it."""

from collections.abc import Mapping

import numpy as np

from graycard.methods import PriorKind

UNITS: Mapping[PriorKind, tuple[str, ...]] = {
    "normal": ("°",),
    "depth": ("%", "1 - r"),
    "base_color": ("rms",),
    "roughness": ("mean",),
    "metallic": ("mean",),
}
"""Names of the errors of each kind."""
_ROUNDS = 30
"""Rounds of the search for a median of directions."""


def errors_of(kind: str, told: np.ndarray, true: np.ndarray, seen: np.ndarray) -> tuple[float, ...]:
    """Return the errors of an answer, over the pixels where there is a surface; they are of :data:`UNITS`.

    Normals: mean angle, degrees; 90 where the answer has none. Depth: mean relative difference in percent,
    once scale and offset are those of the least squares, and one minus Pearson's correlation, with which
    ``sunfaded`` compares depths. Base colour: root mean square, once each channel of the view has the gain of
    the least squares. Others: mean absolute difference.

    Args:
        kind: What was asked.
        told: Shape ``(H, W)`` or ``(H, W, 3)``; depth, metres, may be infinite: those pixels do not count.
        true: The layer, of the same shape.
        seen: Shape ``(H, W)``, bool.
    """
    if kind == "normal":
        cosines = np.clip((told * true).sum(axis=-1)[seen], -1, 1)
        return (float(np.degrees(np.arccos(cosines)).mean()),)
    if kind == "depth":
        both = seen & np.isfinite(told)
        return _errors_of_depth(told[both].astype(np.float64), true[both].astype(np.float64))
    if kind == "base_color":
        a, b = told[seen].astype(np.float64), true[seen].astype(np.float64)
        gains = (a * b).sum(axis=0) / np.maximum((a * a).sum(axis=0), 1e-12)
        return (float(np.sqrt(np.mean((gains * a - b) ** 2))),)
    return (float(np.abs(told - true)[seen].mean()),)


def best_constant(kind: str, true: np.ndarray, seen: np.ndarray) -> np.ndarray:
    """Return the best answer that is one value all over a view: it knows the truth, but tells no shape.

    Normals: the direction of their geometric median, by Weiszfeld's iteration. Others: the median of each
    channel.

    Args:
        kind: What is asked.
        true: The layer, shape ``(H, W)`` or ``(H, W, 3)``.
        seen: Shape ``(H, W)``, bool; elsewhere the answer is no better or worse.
    """
    values = true[seen].astype(np.float64)
    best = np.median(values, axis=0)
    if kind == "normal":
        for _ in range(_ROUNDS):
            away = np.linalg.norm(values - best, axis=-1)
            best = np.average(values, axis=0, weights=1 / np.maximum(away, 1e-3))
            best /= np.linalg.norm(best)
    return np.broadcast_to(best, true.shape)


def _errors_of_depth(told: np.ndarray, true: np.ndarray) -> tuple[float, float]:
    """Mean relative difference in percent, and one minus the correlation, of depths ``(N,)``."""
    spread = told.std()
    if spread < 1e-9:  # a constant tells nothing
        return float(100 * np.mean(np.abs(true.mean() - true) / true)), 1.0
    slope = np.mean((told - told.mean()) * (true - true.mean())) / spread**2
    fitted = true.mean() + slope * (told - told.mean())
    relative = np.mean(np.abs(fitted - true) / true)
    return float(100 * relative), float(1 - slope * spread / max(true.std(), 1e-12))
