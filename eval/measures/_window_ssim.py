# SPDX-License-Identifier: Apache-2.0
"""Structural similarity of whole pictures, with the windows and borders that published code has.

They differ from :func:`graycard.eval.ssim` in the pixels that enter: the whole picture, and beyond its
border zeros (3D Gaussian Splatting), its mirror image (kornia) or nothing (mip-NeRF).
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from graycard import DatasetError

Border = Literal["zeros", "mirrored", "none"]

_SIGMA = 1.5
_LUMINANCE, _CONTRAST = 0.01**2, 0.03**2
"""Wang et al. 2004, (K1 L)² and (K2 L)² for a peak L of 1."""


@dataclass(frozen=True, slots=True)
class Window:
    """A Gaussian window of sigma 1.5, and what it sees beyond the border of a picture."""

    side: int = 11
    """In pixels, odd."""
    border: Border = "zeros"
    """``none``: the mean is over the windows that lie in the picture."""


def window_ssim(predicted: np.ndarray, true: np.ndarray, window: Window) -> float:
    """Return the mean structural similarity of two whole pictures.

    Wang et al. 2004, equation 13, with K = (0.01, 0.03), peak 1 and population covariance; the mean is over
    pixels and channels.

    Args:
        predicted: shape ``(H, W, 3)``; 1 is the peak, but values may be above it.
        true: shape ``(H, W, 3)``, the same.
        window: Its side, and what lies beyond the border.

    Returns:
        [-1, 1]; 1 for equal pictures.

    Raises:
        DatasetError: The pictures are smaller than the window.

    Examples:
        >>> import numpy as np
        >>> window_ssim(np.ones((16, 16, 3)), np.ones((16, 16, 3)), Window())
        1.0
    """
    if min(true.shape[:2]) < window.side:
        raise DatasetError(
            f"expected images of at least {window.side}x{window.side} pixels for SSIM, got "
            f"{true.shape[1]}x{true.shape[0]}. Render the scene larger"
        )
    p, t = (np.asarray(image, np.float64) for image in (predicted, true))
    mean_p, mean_t = _filtered(p, window), _filtered(t, window)
    variances = _filtered(p * p + t * t, window) - mean_p**2 - mean_t**2
    covariance = _filtered(p * t, window) - mean_p * mean_t
    likeness = (2 * mean_p * mean_t + _LUMINANCE) * (2 * covariance + _CONTRAST)
    likeness /= (mean_p**2 + mean_t**2 + _LUMINANCE) * (variances + _CONTRAST)
    return float(likeness.mean())


def _filtered(image: np.ndarray, window: Window) -> np.ndarray:
    """Return the mean under the window at each pixel that has one, shape ``(H', W', 3)``."""
    from scipy.ndimage import correlate1d

    reach = window.side // 2
    weights = np.exp(-0.5 * (np.arange(-reach, reach + 1) / _SIGMA) ** 2)
    mode = "mirror" if window.border == "mirrored" else "constant"
    for axis in (0, 1):
        image = correlate1d(image, weights / weights.sum(), axis, mode=mode)
    return image if window.border != "none" else image[reach:-reach, reach:-reach]
