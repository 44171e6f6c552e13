# SPDX-License-Identifier: Apache-2.0
"""The colour chart: patches of known colour, each read off as its mean, as a photographer would."""

import numpy as np

from graycard.eval.measures._colour_difference import ciede2000
from graycard.eval.scoring._mask import judged_pixels

NAME = "color chart"
"""Name of the object in every scene that has one."""
_DIGITS = 5
"""To which reflectances of one patch agree: float32 keeps two more."""


def patch_difference(predicted: np.ndarray, true: np.ndarray, mask: np.ndarray) -> float:
    """Mean over the colours of a chart of the CIEDE2000 between their mean readings, ΔE00.

    Pixels of one true colour, to five digits, are one patch. Each patch counts once, however many pixels
    show it.

    Args:
        predicted: shape ``(H, W, 3)``, linear reflectance.
        true: shape ``(H, W, 3)``, linear reflectance; a few colours only.
        mask: shape ``(H, W)``, bool: the chart.

    Raises:
        ValueError: The shapes differ, or the mask is empty.
    """
    p, t = judged_pixels(predicted, true, mask)
    _, patch = np.unique(t.round(_DIGITS), axis=0, return_inverse=True)
    pixels = np.bincount(patch)
    means = [np.stack([np.bincount(patch, x[:, c]) / pixels for c in range(3)], axis=-1) for x in (p, t)]
    return float(ciede2000(*means).mean())
