# SPDX-License-Identifier: Apache-2.0
"""Weights of pixels: how much a pixel says about the scene without the lamp: the less, the more the lamp
lights it.
"""

import numpy as np
from scipy.ndimage import gaussian_filter

from graycard.methods.sunfaded._settings import SunFadedSettings

FAINT = 1 / 255
"""Offset, a share of white; added before the logarithm and before the quotient, as in the released code."""


def unlit_weight(picture: np.ndarray, settings: SunFadedSettings) -> np.ndarray:
    """``exp(-beta L)`` with L, in [0, 1], how much light there is around a pixel.

    The paper blurs the logarithm of the picture, which leaves light and takes out texture (as Retinex does),
    and brings it to [0, 1]; the released code blurs the picture as displayed and divides by its largest
    value.

    Args:
        picture: Shape ``(H, W, 3)``, 1 is white; for ``linear_max`` as displayed, in spite of the name.
        settings: ``weight``, ``beta``, ``least_weight`` and ``blur``.

    Returns:
        Shape ``(H, W)``, float32, in [0, 1]: 0 where it would be below ``least_weight`` of its largest; 1
        everywhere if ``weight`` is ``none``.
    """
    if settings.weight == "none":
        return np.ones(picture.shape[:2], np.float32)
    faint = np.asarray(picture, np.float64).clip(min=0).mean(axis=-1) + FAINT
    sigma = settings.blur * picture.shape[1]
    if settings.weight == "log_minmax":
        blurred = gaussian_filter(np.log(faint), sigma, mode="nearest")
        spread = float(np.ptp(blurred))
        light = (blurred - blurred.min()) / spread if spread > 0 else np.zeros_like(blurred)
    else:
        blurred = gaussian_filter(faint, sigma, mode="nearest")
        light = blurred / blurred.max()
    weight = np.exp(-settings.beta * light)
    small = weight < settings.least_weight * weight.max()
    return np.where(small, 0, weight).astype(np.float32)
