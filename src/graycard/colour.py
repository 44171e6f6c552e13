# SPDX-License-Identifier: Apache-2.0
"""From scene-linear radiance to what a display shows."""

import numpy as np

from graycard.io import blocks

_KNEE = 0.0031308

LUMINANCE = np.array([0.2126, 0.7152, 0.0722])
"""Weights of linear Rec.709 in relative luminance, CIE Y (ITU-R BT.709-6, item 3.2)."""


def luminance(linear: np.ndarray) -> np.ndarray:
    """Relative luminance of linear Rec.709 colours, ``(..., 3)`` to ``(...)``, in their unit."""
    return np.asarray(linear) @ LUMINANCE


def srgb_encode(linear: np.ndarray) -> np.ndarray:
    """Display values of linear Rec.709 ones, any shape; float64.

    Domain: [0, ∞), where 1 is display white; what lies outside [0, 1] is clipped. Range: [0, 1].
    Formula: IEC 61966-2-1:1999, piecewise (not a 2.2 power).
    """
    values = np.asarray(linear)
    encoded = np.empty(values.shape)
    found, asked = encoded.reshape(-1), values.reshape(-1)
    for block in blocks(asked.size):
        x, y = np.clip(asked[block].astype(np.float64, copy=False), 0, 1), found[block]
        np.power(x, 1 / 2.4, out=y)
        y *= 1.055
        y -= 0.055
        np.copyto(y, 12.92 * x, where=x <= _KNEE)
    return encoded


def srgb_slope(linear: np.ndarray) -> np.ndarray:
    """Return derivative of :func:`srgb_encode`, any shape; 0 where it clips.

    It carries a variance over to display space, to first order.
    """
    x = np.asarray(linear, dtype=np.float64)
    slope = np.where(x <= _KNEE, 12.92, 1.055 / 2.4 * np.maximum(x, _KNEE) ** (1 / 2.4 - 1))
    return np.where((x < 0) | (x > 1), 0.0, slope)


def srgb_decode(display: np.ndarray) -> np.ndarray:
    """Linear Rec.709 values of display ones, any shape; float64. The inverse of :func:`srgb_encode`.

    Domain: [0, 1]; what lies outside is clipped. Range: [0, 1].
    Formula: IEC 61966-2-1:1999, piecewise (not a 2.2 power).
    """
    y = np.clip(np.asarray(display, dtype=np.float64), 0, 1)
    return np.where(y <= 12.92 * _KNEE, y / 12.92, ((y + 0.055) / 1.055) ** 2.4)


def display_variance(radiance: np.ndarray, variance: np.ndarray, exposure: float) -> np.ndarray:
    """Variance that the truth's noise has after display encoding, any shape; to first order.

    ``Var[f(k L)] = Var[L] (k f'(k L))²`` with the display curve f and the exposure k.

    Args:
        radiance: The noisy mean L, W/m²/sr, linear.
        variance: Variance of that mean, (W/m²/sr)².
        exposure: Factor k to display range, 1/(W/m²/sr).

    Returns:
        Display units squared; 0 where the display clips.
    """
    slope = srgb_slope(np.asarray(radiance, np.float64) * exposure)
    return np.asarray(variance, np.float64) * (exposure * slope) ** 2
