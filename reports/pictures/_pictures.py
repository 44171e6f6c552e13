# SPDX-License-Identifier: Apache-2.0
"""Arrays to pictures inside a page: lossless WebP whose pixels are codes, which a script reads back."""

import base64
import io
import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
from PIL import Image

from graycard import srgb_encode
from graycard.reports.pictures._colour_maps import STEPS, ColourMap, colour_map, to_index

KNEE = 2.0**-12
"""Below this share of display white the code of linear light is linear, above it logarithmic."""
STEP = 0.01
"""Logarithm of the ratio of neighbouring codes: a value is off by 0.5 %, at white 0.6 of an 8-bit step."""
PEAK = 2.0**16
"""Light above this many times display white is cut off: 16 stops down it would still be white."""
LEVELS = 1 + round(math.log1p(PEAK / KNEE) / STEP)
"""Number of codes."""
NUMBERS = 2**16 - 1
"""Codes of one number a pixel; the last one stands for no value."""

MAP_LEVELS = 64
"""Colours of a map in a bar: neighbours differ less than an eye sees."""

Code = Literal["light", "display", "share", "direction", "number", "map", "sketch"]
"""Kind of the pixels.

``light``: codes of linear light, high bytes above low ones. ``display``: light as a display shows it, 8 bits.
``share``: numbers from 0 to 1, three a pixel, by the curve of sRGB. ``direction``: X, Y, Z from −1 to 1.
``number``: 16 bits between ``low`` and ``high``, high byte in R, low byte in G. ``map``: 254 steps between
``low`` and ``high`` in R, shown by colours of errors. ``sketch``: only to be seen.
"""


@dataclass(frozen=True, slots=True)
class PagePicture:
    """One picture of a page."""

    webp: str
    """Base64 of the file."""
    width: int
    height: int
    alt: str
    code: Code = "sketch"
    low: float = 0.0
    high: float = 1.0


def shrink(image: np.ndarray, max_side: int) -> np.ndarray:
    """Mean over square blocks, as few pixels wide as needed, so that no side exceeds ``max_side``.

    Args:
        image: shape ``(H, W)`` or ``(H, W, C)``; rows and columns that fill no block are cut off.
        max_side: In pixels.
    """
    block = -(-max(image.shape[:2]) // max_side)
    if block == 1:
        return image
    height, width = max(image.shape[0] // block, 1), max(image.shape[1] // block, 1)
    cut = image[: height * block, : width * block]
    rows, columns = cut.shape[0] // height, cut.shape[1] // width
    return cut.reshape(height, rows, width, columns, *image.shape[2:]).mean(axis=(1, 3))


def light_picture(values: np.ndarray, alt: str) -> PagePicture:
    """Linear light, shape ``(H, W, 3)``, where 1 is display white."""
    height, width = values.shape[:2]
    return PagePicture(_webp(split_codes(linear_codes(values))), width, height, alt, "light")


def share_picture(values: np.ndarray, alt: str) -> PagePicture:
    """Numbers from 0 to 1, shape ``(H, W, 3)``; what lies outside is clipped."""
    return _picture(_eight_bits(srgb_encode(values)), alt, "share")


def direction_picture(values: np.ndarray, alt: str) -> PagePicture:
    """Return unit vectors, shape ``(H, W, 3)``."""
    return _picture(_eight_bits((values + 1) / 2), alt, "direction")


def number_picture(values: np.ndarray, low: float, high: float, alt: str) -> PagePicture:
    """One number a pixel, shape ``(H, W)``, clipped to ``low`` and ``high``; NaN is no value."""
    share = (np.clip(np.nan_to_num(values, nan=low), low, high) - low) / max(high - low, 1e-30)
    codes = np.where(np.isnan(values), NUMBERS, np.rint(share * (NUMBERS - 1))).astype(np.uint16)
    pixels = np.stack([codes >> 8, codes & 255, np.zeros_like(codes)], axis=-1)
    return _picture(pixels, alt, "number", float(low), float(high))


def map_picture(values: np.ndarray, high: float, alt: str) -> PagePicture:
    """Errors from 0, shape ``(H, W)``, cut off at ``high``; NaN is no value."""
    index = to_index(values, 0, high)
    return _picture(np.repeat(index[..., None], 3, axis=-1), alt, "map", 0.0, float(high))


def sketch_picture(display: np.ndarray, alt: str) -> PagePicture:
    """Display values in [0, 1], shape ``(H, W, 3)``, in 128 colours of their own: a quarter of the bytes."""
    few = Image.fromarray(_eight_bits(display)).quantize(128, dither=Image.Dither.NONE)
    return _picture(np.asarray(few.convert("RGB")), alt)


def coloured_picture(values: np.ndarray, low: float, high: float, name: ColourMap, alt: str) -> PagePicture:
    """Numbers through a colour map, shape ``(H, W)``, only to be seen; gray where NaN."""
    return _picture(_coloured(to_index(values, low, high), name), alt)


def seen_picture(picture: PagePicture) -> PagePicture:
    """Return the same picture as it is seen at the exposure of its scene, without any code."""
    pixels = np.asarray(Image.open(io.BytesIO(base64.b64decode(picture.webp))).convert("RGB"))
    return _picture(_seen(pixels, picture.code), picture.alt)


def gradient(name: ColourMap) -> str:
    """Return a colour map as a CSS gradient, from low on the left to high on the right."""
    stops = (f"#{r:02x}{g:02x}{b:02x}" for r, g, b in _map_levels(name)[:: MAP_LEVELS // 16].tolist())
    last = "#{:02x}{:02x}{:02x}".format(*_map_levels(name)[-1].tolist())
    return f"linear-gradient(to right, {', '.join(stops)}, {last})"


def linear_codes(values: np.ndarray) -> np.ndarray:
    """Codes of linear light, same shape, uint16 in ``[0, LEVELS)``.

    ``code = round(log(1 + x / KNEE) / STEP)``, so ``x = KNEE * (exp(code * STEP) - 1)``. Negative light,
    which noise makes, becomes 0.
    """
    x = np.clip(np.asarray(values, np.float64), 0, PEAK)
    return np.rint(np.log1p(x / KNEE) / STEP).astype(np.uint16)


def split_codes(codes: np.ndarray) -> np.ndarray:
    """16-bit codes ``(H, W, 3)`` as 8-bit pixels ``(2H, W, 3)``: high bytes above low bytes.

    No alpha channel: a canvas multiplies colours by alpha and loses bits.
    """
    return np.concatenate([codes >> 8, codes & 255], axis=0).astype(np.uint8)


def join_codes(pixels: np.ndarray) -> np.ndarray:
    """Return the codes of :func:`split_codes`."""
    high, low = np.split(pixels.astype(np.uint16), 2)
    return (high << 8) | low


def _seen(pixels: np.ndarray, code: Code) -> np.ndarray:
    match code:
        case "light":
            return _eight_bits(srgb_encode(KNEE * np.expm1(join_codes(pixels) * STEP)))
        case "number":
            codes = pixels[..., 0].astype(np.int64) * 256 + pixels[..., 1]
            values = np.where(codes == NUMBERS, np.nan, codes / (NUMBERS - 1))
            return _coloured(to_index(values, 0, 1), "depth")
        case "map":
            return _coloured(pixels[..., 0], "error")
        case _:
            return pixels


def _coloured(index: np.ndarray, name: ColourMap) -> np.ndarray:
    palette = np.append(colour_map(name), [[128, 128, 128]], axis=0).astype(np.uint8)
    return palette[np.minimum(index, STEPS)]


def _map_levels(name: ColourMap) -> np.ndarray:
    """Return the colours of a map that bars use, shape ``(MAP_LEVELS, 3)``, uint8."""
    return colour_map(name)[np.rint(np.linspace(0, STEPS - 1, MAP_LEVELS)).astype(int)]


def _eight_bits(values: np.ndarray) -> np.ndarray:
    return np.rint(255 * np.clip(np.nan_to_num(values), 0, 1)).astype(np.uint8)


def _picture(
    pixels: np.ndarray, alt: str, code: Code = "sketch", low: float = 0.0, high: float = 1.0
) -> PagePicture:
    height, width = pixels.shape[:2]
    return PagePicture(_webp(pixels.astype(np.uint8)), width, height, alt, code, low, high)


def _webp(pixels: np.ndarray) -> str:
    buffer = io.BytesIO()
    Image.fromarray(pixels).save(buffer, format="WEBP", lossless=True, quality=80, method=4, exact=True)
    return base64.b64encode(buffer.getvalue()).decode()
