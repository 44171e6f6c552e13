# SPDX-License-Identifier: Apache-2.0
"""Where a predicted layer differs from the true one, a number per pixel, for the eye alone.

The scores of a report come from its record; these images only show where to look.
"""

from collections.abc import Sequence

import numpy as np

import graycard as gc

_ROUND = (1, 1.5, 2, 3, 4, 5, 6, 8, 10)
_UNITS = {"base_color": "linear difference", "normal": "degrees", "depth": "m"}


def error_unit(layer: str) -> str:
    """The unit of :func:`error_image`."""
    return _UNITS.get(layer, "display difference")


def error_image(
    layer: str, predicted: np.ndarray, true: np.ndarray, mask: np.ndarray, exposure: float
) -> np.ndarray:
    """The error in each pixel, shape ``(H, W)``, float64; NaN outside the mask.

    Radiance: largest difference over the channels of display values, ``|srgb(p·exposure) -
    srgb(t·exposure)|``. Base colour: the same in linear light. Normal: the angle in degrees.
    Depth: ``|p - t|`` in metres.

    Args:
        layer: Name of the layer.
        predicted: shape ``(H, W)`` or ``(H, W, 3)``, linear, the gauge already applied.
        true: Same shape.
        mask: shape ``(H, W)``, bool.
        exposure: Factor that brings radiance to display range.
    """
    p, t = predicted.astype(np.float64), true.astype(np.float64)
    match layer:
        case "normal":
            error = gc.angles(p, t)
        case "depth":
            error = _absolute_difference(p, t)
        case "base_color":
            error = np.abs(p - t).max(axis=-1)
        case _:
            error = np.abs(gc.srgb_encode(p * exposure) - gc.srgb_encode(t * exposure)).max(axis=-1)
    return np.where(mask, error, np.nan)


def shared_scale(errors: Sequence[np.ndarray]) -> float:
    """The upper end of one colour bar for several error images.

    The first of some round numbers that is no less than the 98th percentile of all errors
    above zero: a few wild pixels must not darken the rest.
    """
    values = np.concatenate([e[np.isfinite(e) & (e > 0)] for e in errors]) if errors else np.array([])
    if not values.size:
        return 1.0
    high = float(np.percentile(values, 98))
    power = 10.0 ** np.floor(np.log10(high))
    return next(float(f"{step * power:.6g}") for step in _ROUND if step * power >= high * (1 - 1e-9))


def _absolute_difference(p: np.ndarray, t: np.ndarray) -> np.ndarray:
    """``|p - t|``; two infinities agree."""
    both = np.isinf(p) & np.isinf(t)
    return np.abs(np.where(both, 0, p) - np.where(both, 0, t))
