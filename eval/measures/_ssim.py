# SPDX-License-Identifier: Apache-2.0
"""Structural similarity whose windows see only judged pixels."""

import numpy as np

from graycard import DatasetError
from graycard.eval.scoring._mask import box_around, with_true_background

WINDOW = 11
"""Side of the Gaussian window in pixels: sigma 1.5, cut off at 3.5 sigma."""


def interior(mask: np.ndarray) -> np.ndarray:
    """Return the pixels whose SSIM window lies in the mask and in the image, shape ``(H, W)``, bool.

    Examples:
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
    """Return the mean structural similarity over the mask, eroded by the radius of the window.

    Wang et al. 2004 with their settings, as in scikit-image: Gaussian window of 11 x 11 pixels and sigma
    1.5, K = (0.01, 0.03), peak 1, population covariance; mean over channels. If no window fits into the
    mask, the mean is over the mask itself, with the true background around it in both images.

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
    from skimage.metrics import structural_similarity

    if min(true.shape[:2]) < WINDOW:
        raise DatasetError(
            f"expected images of at least {WINDOW}x{WINDOW} pixels for SSIM, got "
            f"{true.shape[1]}x{true.shape[0]}. Render the scene larger"
        )
    box = box_around(mask, WINDOW)
    p, t = with_true_background(predicted, true, mask)[box], np.asarray(true, np.float64)[box]
    similarity = structural_similarity(
        t,
        p,
        data_range=1,
        channel_axis=-1,
        gaussian_weights=True,
        sigma=1.5,
        use_sample_covariance=False,
        full=True,
    )[1]
    inside = interior(mask)
    return float(similarity[(inside if inside.any() else mask)[box]].mean())
