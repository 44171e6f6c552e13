# SPDX-License-Identifier: Apache-2.0
"""Structural similarity whose windows see only judged pixels."""

import numpy as np

from graycard import DatasetError
from graycard.eval.measures._filters import separable
from graycard.eval.scoring._mask import box_around, with_true_background

WINDOW = 11
"""Side of the Gaussian window in pixels: sigma 1.5, cut off at 3.5 sigma."""
_SIGMA = 1.5
_K1, _K2 = 0.01, 0.03


def interior(mask: np.ndarray) -> np.ndarray:
    """The pixels whose whole SSIM window lies in the mask and in the image, shape ``(H, W)``, bool.

    Example:
        >>> import numpy as np
        >>> int(interior(np.ones((13, 12), bool)).sum())
        6
    """
    from scipy.ndimage import minimum_filter1d

    least = np.asarray(mask, np.uint8)
    for axis in (0, 1):  # a square is eroded by its sides, one after the other
        least = minimum_filter1d(least, WINDOW, axis, mode="constant", cval=0)
    return least > 0


def ssim(predicted: np.ndarray, true: np.ndarray, mask: np.ndarray) -> float:
    """Mean structural similarity over the mask, eroded by the radius of the window.

    Wang et al. 2004 with their settings: Gaussian window of 11 x 11 pixels and sigma 1.5, K = (0.01,
    0.03), peak 1, population covariance; mean over channels. If no window fits into the mask, the
    mean is over the mask itself, with the true background around it in both images.

    Args:
        predicted: shape ``(H, W, 3)``, display values in [0, 1].
        true: shape ``(H, W, 3)``, display values in [0, 1].
        mask: shape ``(H, W)``, bool.

    Returns:
        [-1, 1]; 1 for equal images.

    Raises:
        DatasetError: The images are smaller than the window.
        ValueError: The shapes differ, or the mask is empty.
    """
    if min(true.shape[:2]) < WINDOW:
        raise DatasetError(
            f"expected images of at least {WINDOW}x{WINDOW} pixels for SSIM, got "
            f"{true.shape[1]}x{true.shape[0]}. Render the scene larger"
        )
    box = box_around(mask, WINDOW)
    p, t = with_true_background(predicted, true, mask)[box], np.asarray(true, np.float64)[box]
    similarity = np.mean([_similarity(p[..., c], t[..., c]) for c in range(p.shape[-1])], axis=0)
    inside = interior(mask)
    return float(similarity[(inside if inside.any() else mask)[box]].mean())


def _similarity(p: np.ndarray, t: np.ndarray) -> np.ndarray:
    """SSIM map of two channels of peak 1, shape ``(H, W)``: equation 13 of Wang et al. 2004."""
    weights = np.exp(-(np.arange(-(WINDOW // 2), WINDOW // 2 + 1) ** 2) / (2 * _SIGMA**2))
    weights /= weights.sum()
    mean_p, mean_t, mean_squares, mean_product = (
        separable(image, weights, weights, "symmetric") for image in (p, t, p * p + t * t, p * t)
    )
    product, squares = mean_p * mean_t, mean_p**2 + mean_t**2
    luminance = (2 * product + _K1**2) / (squares + _K1**2)
    return luminance * (2 * (mean_product - product) + _K2**2) / (mean_squares - squares + _K2**2)
