# SPDX-License-Identifier: Apache-2.0
"""Errors of depth, in which a hole in the predicted surface has a definite price.

An error is never dearer than that of a surface at the camera itself, or at twice the true depth: |p - t| = t.
So +inf, "there is nothing", is the limit of ever greater depths and not a case of its own.
"""

import numpy as np

from graycard.eval.scoring._mask import judged_pixels


def depth_errors(predicted: np.ndarray, true: np.ndarray, mask: np.ndarray) -> np.ndarray:
    """min(|p - t|, t), shape ``(N,)``, metres.

    Args:
        predicted: shape ``(H, W)``, metres along the optical axis; +inf where there is nothing.
        true: shape ``(H, W)``, metres; finite and above 0 inside the mask.
        mask: shape ``(H, W)``, bool.

    Raises:
        ValueError: The shapes differ, or the mask is empty.
    """
    p, t = judged_pixels(predicted, true, mask)
    return np.minimum(np.abs(p - t), t)


def relative_depth_errors(predicted: np.ndarray, true: np.ndarray, mask: np.ndarray) -> np.ndarray:
    """min(|p - t| / t, 1), shape ``(N,)``; arguments as of :func:`depth_errors`."""
    return depth_errors(predicted, true, mask) / np.asarray(true, np.float64)[mask]


def within_ratio(predicted: np.ndarray, true: np.ndarray, mask: np.ndarray) -> np.ndarray:
    """max(p / t, t / p), shape ``(N,)``, [1, ∞]; ∞ for a depth of 0 or less (Eigen et al. 2014, threshold).

    Arguments as of :func:`depth_errors`.
    """
    p, t = judged_pixels(predicted, true, mask)
    ahead = p > 0
    return np.where(ahead, np.maximum(p / t, t / np.where(ahead, p, 1)), np.inf)
