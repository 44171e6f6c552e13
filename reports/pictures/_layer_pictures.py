# SPDX-License-Identifier: Apache-2.0
"""Any layer of the vocabulary as pixels with a caption, so that a wrong one is seen at a glance."""

import colorsys
from collections.abc import Callable

import numpy as np
from scipy.ndimage import binary_erosion

from graycard import find_layer, srgb_encode
from graycard.reports._format import format_number
from graycard.reports.pictures._colour_maps import STEPS, ColourMap, colour_map, to_index

NO_NUMBER = (255, 0, 255)
"""Magenta: the value is not finite and should be."""
NOTHING = (70, 70, 70)
"""Dark gray: nothing is seen there."""
GRAY_CARD = 0.18
"""Reflectance of the card as which light that arrives is shown: as radiance it would mostly be white."""
GOLDEN = 0.6180339887
"""Steps of this share of the hue circle keep any number of ids apart."""

_Drawn = tuple[np.ndarray, str]


def layer_picture(name: str, values: np.ndarray, exposure: float) -> _Drawn:
    """Return the pixels of a layer, shape ``(H, W, 3)``, uint8, sRGB, and what they mean.

    Args:
        name: Of the layer.
        values: shape ``(H, W)`` or ``(H, W, 3)``.
        exposure: Of the scene; radiance is shown by it.
    """
    pixels, note = _drawer(name)(values, exposure)
    bad = np.isnan(values) | (np.isinf(values) & (not find_layer(name).may_be_infinite))
    where = np.any(np.atleast_3d(bad), axis=-1, keepdims=True)
    return np.where(where, np.array(NO_NUMBER, np.uint8), pixels), f"{name}{note}"


def outline(pixels: np.ndarray, mask: np.ndarray) -> np.ndarray:
    """Pixels with the border of a mask in magenta, shape ``(H, W, 3)``."""
    border = mask & np.logical_not(binary_erosion(mask))
    return np.where(border[..., None], np.array(NO_NUMBER, np.uint8), pixels)


def photograph_picture(linear: np.ndarray, exposure: float) -> np.ndarray:
    """Return a photograph as a display shows it, shape ``(H, W, 3)``, uint8."""
    return _light(linear, exposure)[0]


def _drawer(name: str) -> Callable[[np.ndarray, float], _Drawn]:
    kind = find_layer(name)
    if name.endswith(".var"):
        return _noise if find_layer(name[:-4]).unit != "1" else _bare_noise
    if kind.dtype == "uint32":
        return _ids
    if len(kind.channels) == 1:
        return _numbers
    if kind.channels == ("X", "Y", "Z"):
        return _directions if name == "normal" else _positions
    if "irradiance" in name or name == "shading":
        return _card_under_irradiance if "irradiance" in name else _card_under_shading
    return _light if kind.unit != "1" else _reflectance


def _light(values: np.ndarray, exposure: float) -> _Drawn:
    return _eight_bits(srgb_encode(np.nan_to_num(values) * exposure)), ""


def _card_under_irradiance(values: np.ndarray, exposure: float) -> _Drawn:
    return _card_under_shading(values / np.pi, exposure)


def _card_under_shading(values: np.ndarray, exposure: float) -> _Drawn:
    return _light(GRAY_CARD * values, exposure)[0], "  on a gray card"


def _reflectance(values: np.ndarray, exposure: float) -> _Drawn:
    low, high = _range(values)
    return _eight_bits(srgb_encode(np.nan_to_num(values))), f"  {low} to {high}"


def _directions(values: np.ndarray, exposure: float) -> _Drawn:
    pixels = _eight_bits(0.5 + 0.5 * np.clip(np.nan_to_num(values), -1, 1))
    seen = np.any(values, axis=-1, keepdims=True)
    return np.where(seen, pixels, np.array(NOTHING, np.uint8)), "  rgb = xyz"


def _positions(values: np.ndarray, exposure: float) -> _Drawn:
    finite = np.where(np.isfinite(values), values, 0)
    low, high = finite.min(axis=(0, 1)), finite.max(axis=(0, 1))
    return _eight_bits((finite - low) / np.maximum(high - low, 1e-12)), "  rgb = xyz"


def _numbers(values: np.ndarray, exposure: float) -> _Drawn:
    seen = np.isfinite(values)
    low, high = _ends(values)
    note = f"  {format_number(low)} to {format_number(high)}"
    return mapped(np.where(seen, values, np.nan), low, high, "depth"), note


def _noise(values: np.ndarray, exposure: float) -> _Drawn:
    """Return standard deviation as a share of display white, from 0 to its 99th percentile."""
    pixels, high = _deviation(values, exposure)
    return pixels, f"  sd to {high:.1%} of white"


def _bare_noise(values: np.ndarray, exposure: float) -> _Drawn:
    pixels, high = _deviation(values, 1.0)
    return pixels, f"  sd to {format_number(high)}"


def _deviation(values: np.ndarray, factor: float) -> tuple[np.ndarray, float]:
    variance = values if values.ndim == 2 else values.mean(axis=-1)
    deviation = np.sqrt(np.maximum(np.nan_to_num(variance), 0)) * factor
    high = float(np.percentile(deviation, 99))
    return mapped(deviation, 0, high, "error"), high


def _ids(values: np.ndarray, exposure: float) -> _Drawn:
    numbers, index = np.unique(values, return_inverse=True)
    colours = np.array([_id_colour(int(n)) for n in numbers], np.uint8)
    return colours[index.reshape(values.shape)], f"  {len(numbers)} ids up to {numbers.max()}"


def _id_colour(number: int) -> tuple[float, ...]:
    """Return the same colour for an id in every view."""
    if number == 0:
        return NOTHING
    return tuple(255 * c for c in colorsys.hsv_to_rgb(number * GOLDEN % 1, 0.35 + 0.3 * (number % 3), 0.95))


def mapped(values: np.ndarray, low: float, high: float, name: ColourMap) -> np.ndarray:
    """Return numbers, shape ``(H, W)``, as colours, ``(H, W, 3)``, uint8; dark gray where there is none."""
    palette = np.append(colour_map(name), [NOTHING], axis=0).astype(np.uint8)
    return palette[np.minimum(to_index(values, low, high), STEPS)]


def _ends(values: np.ndarray) -> tuple[float, float]:
    finite = values[np.isfinite(values)]
    return (float(finite.min()), float(finite.max())) if finite.size else (0.0, 0.0)


def _range(values: np.ndarray) -> tuple[str, str]:
    low, high = _ends(values)
    return format_number(low), format_number(high)


def _eight_bits(display: np.ndarray) -> np.ndarray:
    return np.rint(255 * display).astype(np.uint8)
