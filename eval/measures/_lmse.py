# SPDX-License-Identifier: Apache-2.0
"""Local mean square error: each window of the image may have a brightness of its own."""

from typing import Literal

import numpy as np

from graycard import DatasetError
from graycard.eval.scoring._mask import check_images

WINDOW = 20
"""Side of a window in pixels."""
SHIFT = 10
"""Step from one window to the next in pixels."""
Total = Literal["each window", "the last window of each row"]
_BLACK = 1e-5
"""Sum of squares below which a window of the prediction is called black and not scaled."""


def lmse(predicted: np.ndarray, true: np.ndarray, mask: np.ndarray, total: Total = "each window") -> float:
    """Return the local mean square error of Grosse et al. 2009 (equations 7 to 9), of one image.

    Both images become gray, the mean of their channels, and fall into windows of 20 x 20 pixels that
    start every 10; rows and columns beyond the last whole window are not looked at. With the factor
    ``a_w = Σ p t / Σ p²`` of each window, never negative, and 0 where ``Σ p²`` is at most 1e-5,

        LMSE = Σ_w Σ (t - a_w p)² / Σ_w Σ t²,

    the sums over the mask. The authors' own program adds to the denominator once per row of windows, by an
    indentation, and so divides by less; corrected copies have the equation.

    Args:
        predicted: shape ``(H, W, 3)``, linear.
        true: shape ``(H, W, 3)``, linear.
        mask: shape ``(H, W)``, bool.
        total: Windows in the denominator: those of the equation, or of the authors' program.

    Returns:
        [0, 1] by the equation: 0 for equal images, 1 for a black prediction. More by the program.

    Raises:
        DatasetError: The images are smaller than a window, or no window sees truth that is not black.
        ValueError: The shapes differ, or the mask is empty.
    """
    check_images(predicted, true, mask)
    if min(true.shape[:2]) < WINDOW:
        raise DatasetError(
            f"expected images of at least {WINDOW}x{WINDOW} pixels for LMSE, got "
            f"{true.shape[1]}x{true.shape[0]}. Render the scene larger"
        )
    p, t = (np.where(mask, np.asarray(i, np.float64).mean(axis=-1), 0) for i in (predicted, true))
    pt, pp, tt = (_window_sums(image) for image in (p * t, p * p, t * t))
    power = float((tt if total == "each window" else tt[:, -1]).sum())
    if not power > 0:
        raise DatasetError(
            "expected a window of 20x20 pixels that sees a colour, got none. Render the scene larger"
        )
    scale = np.where(pp > _BLACK, np.maximum(pt, 0) / np.where(pp > _BLACK, pp, 1), 0)
    return float(max((tt - 2 * scale * pt + scale**2 * pp).sum(), 0) / power)


def _window_sums(image: np.ndarray) -> np.ndarray:
    """Return the sum over each window, shape ``(rows, columns)`` of windows."""
    windows = np.lib.stride_tricks.sliding_window_view(image, (WINDOW, WINDOW))
    return windows[::SHIFT, ::SHIFT].sum(axis=(-1, -2))
