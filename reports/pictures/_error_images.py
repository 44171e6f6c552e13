# SPDX-License-Identifier: Apache-2.0
"""Error images: where a predicted layer differs from the true one, a number per pixel, for the eye alone.

The scores of a report come from its record; these images only show where to look.
"""

from collections.abc import Sequence
from typing import Literal

import numpy as np

from graycard import angles, find_layer, srgb_encode

_ROUND = (1, 1.5, 2, 3, 4, 5, 6, 8, 10)

NOISE_HIGH = 5.0
"""Upper end of every map of error to noise, in standard deviations: one scale for all reports."""


def error_unit(layer: str) -> str:
    """Return the unit of :func:`error_image`."""
    match _kind(layer):
        case "angle":
            return "degrees"
        case "length":
            return "m"
        case "share":
            return "linear difference"
        case _:
            return "display difference"


def error_image(
    layer: str, predicted: np.ndarray, true: np.ndarray, mask: np.ndarray, exposure: float
) -> np.ndarray:
    """Return the error in each pixel, shape ``(H, W)``, float64; NaN outside the mask.

    Light: largest difference over the channels of display values, ``|srgb(p·exposure) -
    srgb(t·exposure)|``. Base colour and what else has no unit: the same in linear light. Normal: the
    angle in degrees. What is in metres: ``|p - t|``.

    Args:
        layer: Name of the layer.
        predicted: shape ``(H, W)`` or ``(H, W, 3)``, linear, the gauge already applied.
        true: Same shape.
        mask: shape ``(H, W)``, bool.
        exposure: Factor that brings radiance to display range.
    """
    p, t = predicted.astype(np.float64), true.astype(np.float64)
    match _kind(layer):
        case "angle":
            error = angles(p, t)
        case "light":
            error = _largest(np.abs(srgb_encode(p * exposure) - srgb_encode(t * exposure)))
        case _:
            error = _largest(_absolute_difference(p, t))
    return np.where(mask, error, np.nan)


def noise_ratio_image(
    predicted: np.ndarray, true: np.ndarray, variance: np.ndarray, mask: np.ndarray
) -> np.ndarray:
    """Return the error in units of the truth's own noise, shape ``(H, W)``, float64; NaN outside the mask.

    ``sqrt(mean over channels of (p - t)² / variance)`` in linear light. A prediction that is exact but for
    the noise of the truth has 1 on average. Where the truth has no noise, the rounding of its float32
    stands for it.

    Args:
        predicted: shape ``(H, W)`` or ``(H, W, 3)``, linear.
        true: Same shape.
        variance: Same shape: of the mean that ``true`` is, in its unit squared.
        mask: shape ``(H, W)``, bool.
    """
    p, t = predicted.astype(np.float64), true.astype(np.float64)
    floor = (4 * np.finfo(np.float32).eps * np.abs(t)) ** 2
    with np.errstate(divide="ignore", invalid="ignore"):  # 0 / 0 where prediction and truth are black
        squares = np.where(p == t, 0.0, (p - t) ** 2 / np.maximum(variance.astype(np.float64), floor))
    ratio = np.sqrt(squares if squares.ndim == 2 else squares.mean(axis=-1))
    return np.where(mask, ratio, np.nan)


def shared_scale(errors: Sequence[np.ndarray]) -> float:
    """Return the upper end of one colour bar for several error images.

    The first of some round numbers that is no less than the 98th percentile of all errors
    above zero: a few wild pixels must not darken the rest.
    """
    values = np.concatenate([e[np.isfinite(e) & (e > 0)] for e in errors]) if errors else np.array([])
    if not values.size:
        return 1.0
    high = float(np.percentile(values, 98))
    power = 10.0 ** np.floor(np.log10(high))
    return next(float(f"{step * power:.6g}") for step in _ROUND if step * power >= high * (1 - 1e-9))


def _kind(layer: str) -> Literal["angle", "length", "share", "light"]:
    if layer == "normal":
        return "angle"
    unit = find_layer(layer).unit
    return "length" if unit == "m" else "share" if unit == "1" else "light"


def _largest(error: np.ndarray) -> np.ndarray:
    """Largest over the channels; an image of one channel as it is."""
    return error if error.ndim == 2 else error.max(axis=-1)


def _absolute_difference(p: np.ndarray, t: np.ndarray) -> np.ndarray:
    """``|p - t|``; two infinities agree."""
    both = np.isinf(p) & np.isinf(t)
    return np.abs(np.where(both, 0, p) - np.where(both, 0, t))
