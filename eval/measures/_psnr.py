# SPDX-License-Identifier: Apache-2.0
"""Peak signal-to-noise ratio over a mask."""

import math

import numpy as np

from graycard.eval.scoring._mask import judged_pixels


def mean_square_error(predicted: np.ndarray, true: np.ndarray, mask: np.ndarray) -> float:
    """Mean over the mask's pixels and all channels of the squared difference.

    Args:
        predicted: shape ``(H, W, C)``, any unit.
        true: shape ``(H, W, C)``, same unit.
        mask: shape ``(H, W)``, bool: the pixels that are judged. The others do not enter, neither
            into the sum nor into the count.

    Returns:
        In the unit squared, [0, ∞), float64.

    Raises:
        ValueError: The shapes differ, or the mask is empty.

    Examples:
        >>> import numpy as np
        >>> mean_square_error(np.zeros((2, 2, 3)), np.full((2, 2, 3), 0.1), np.eye(2) > 0)
        0.01...
    """
    p, t = judged_pixels(predicted, true, mask)
    return float(np.mean((p - t) ** 2))


def psnr(mean_square: float) -> float:
    """Peak signal-to-noise ratio of a mean square error, in dB, for a peak of 1: 10 log10(1 / MSE).

    Domain: [0, ∞). Range: (-∞, +∞]; +∞ for no error.

    Examples:
        >>> psnr(0.01), psnr(0.0)
        (20.0, inf)
    """
    return math.inf if mean_square == 0 else -10 * math.log10(mean_square)
