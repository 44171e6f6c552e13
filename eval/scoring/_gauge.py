# SPDX-License-Identifier: Apache-2.0
"""The gauge: the scale that albedo and light can trade without changing any photograph.

It is fitted by least squares in linear light, on training views only, once per scene.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal

import numpy as np

from graycard import PredictionError
from graycard.eval.scoring._mask import judged_pixels

Kind = Literal["raw", "scalar", "channel"]
Factors = tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class LinearMoments:
    """Sums over judged pixels from which any gauge follows; each per channel R, G, B."""

    predicted_true: np.ndarray
    """Σ p t, shape ``(3,)``."""
    predicted_square: np.ndarray
    """Σ p², shape ``(3,)``."""
    true_square: np.ndarray
    """Σ t², shape ``(3,)``."""


def moments(predicted: np.ndarray, true: np.ndarray, mask: np.ndarray) -> LinearMoments:
    """Return the sums of one view.

    Args:
        predicted: shape ``(H, W, 3)``, linear.
        true: shape ``(H, W, 3)``, linear.
        mask: shape ``(H, W)``, bool.

    Raises:
        ValueError: The shapes differ, or the mask is empty.
    """
    p, t = judged_pixels(predicted, true, mask)
    return LinearMoments((p * t).sum(axis=0), (p * p).sum(axis=0), (t * t).sum(axis=0))


def fit_gauge(views: Iterable[LinearMoments], kind: Kind, layer: str = "base_color") -> Factors:
    """Return the factors that bring predictions closest to the truth, over all views together.

    ``channel``: s_c = Σ p_c t_c / Σ p_c², one factor each for R, G, B (Grosse et al. 2009 per
    channel). ``scalar``: the same with the sums over channels too, one factor for all. ``raw``: 1.
    A channel in which the truth is black everywhere leaves nothing to fit; its factor is 1.

    Args:
        views: Sums of each view.
        kind: How many factors.
        layer: What is fitted, for the message.

    Raises:
        PredictionError: The prediction is black, or no positive factor fits it.
    """
    if kind == "raw":
        return (1.0, 1.0, 1.0)
    seen = list(views)
    sums = np.array([[v.predicted_true, v.predicted_square, v.true_square] for v in seen]).sum(axis=0)
    if kind == "scalar":
        sums = np.repeat(sums.sum(axis=1, keepdims=True), 3, axis=1)
    red, green, blue = (_factor(sums[:, i], "RGB"[i], layer) for i in range(3))
    return red, green, blue


def apply_gauge(values: np.ndarray, gauge: tuple[float, ...]) -> np.ndarray:
    """Return the image with each channel times its factor, shape ``(H, W, 3)``, linear, float64.

    Examples:
        >>> import numpy as np
        >>> apply_gauge(np.ones((1, 1, 3)), (2.0, 1.0, 0.5)).tolist()
        [[[2.0, 1.0, 0.5]]]
    """
    return np.asarray(values, np.float64) * np.array(gauge, np.float64)


def _factor(sums: np.ndarray, channel: str, layer: str) -> float:
    predicted_true, predicted_square, true_square = sums
    if true_square == 0:
        return 1.0
    if predicted_square == 0 or predicted_true <= 0:
        what = "black in" if predicted_square == 0 else "not positive in"
        raise PredictionError(
            f"expected {layer} that a positive gauge can bring to the truth, got training views that are "
            f"{what} channel {channel} wherever an object is seen. Predict positive {layer}"
        )
    return float(predicted_true / predicted_square)
