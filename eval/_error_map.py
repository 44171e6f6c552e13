# SPDX-License-Identifier: Apache-2.0
"""Where a prediction is wrong: one number per pixel, in a unit that fits the layer."""

import numpy as np

import graycard as gc
from graycard.eval._angles import angles
from graycard.eval._mask import check_images

_UNITS = {
    "radiance": "display difference",
    "counterfactual.radiance": "display difference",
    "base_color": "linear difference",
    "normal": "degrees",
    "depth": "m",
}


def error_map_unit(layer: str) -> str:
    """The unit of :func:`error_map` for a layer.

    Raises:
        UnknownNameError: There is no error map for the layer.
    """
    if layer not in _UNITS:
        raise gc.UnknownNameError("layer with an error map", layer, _UNITS)
    return _UNITS[layer]


def error_map(
    layer: str, predicted: np.ndarray, true: np.ndarray, mask: np.ndarray, exposure: float = 1.0
) -> np.ndarray:
    """The error of a predicted layer in each pixel, shape ``(H, W)``, float64; NaN outside the mask.

    ``radiance``, ``counterfactual.radiance``: largest absolute difference over channels of the
    display values, [0, 1]. ``base_color``: the same in linear light (apply the gauge first).
    ``normal``: degrees. ``depth``: absolute difference, metres.

    Args:
        layer: Name of the layer.
        predicted: shape ``(H, W)`` or ``(H, W, 3)``, linear.
        true: Same shape.
        mask: shape ``(H, W)``, bool.
        exposure: Factor that brings radiance to display range; of no effect on other layers.

    Raises:
        UnknownNameError: There is no error map for the layer.
        ValueError: The shapes differ, or the mask is empty.
    """
    unit = error_map_unit(layer)
    check_images(predicted, true, mask)
    error = np.full(mask.shape, np.nan)
    error[mask] = _errors(unit, predicted[mask].astype(np.float64), true[mask].astype(np.float64), exposure)
    return error


def _errors(unit: str, predicted: np.ndarray, true: np.ndarray, exposure: float) -> np.ndarray:
    match unit:
        case "display difference":
            shown = gc.srgb_encode(predicted * exposure) - gc.srgb_encode(true * exposure)
            return np.abs(shown).max(axis=-1)
        case "linear difference":
            return np.abs(predicted - true).max(axis=-1)
        case "degrees":
            return angles(predicted, true)
        case _:
            return np.abs(predicted - true)
