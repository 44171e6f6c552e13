# SPDX-License-Identifier: Apache-2.0
"""Arrays to pictures inside a page: PNG as data URIs, and linear light that a script can re-expose."""

import base64
import io
import math
from dataclasses import dataclass

import numpy as np
from PIL import Image

from graycard import srgb_encode
from graycard.reports.pictures._colour_maps import STEPS, ColourMap, colour_map, to_index

KNEE = 2.0**-12
"""Below this share of display white the code of linear light is linear, above it logarithmic."""
STEP = 0.005
"""Logarithm of the ratio of neighbouring codes: a value is off by 0.25 %, at white 0.3 of an 8-bit step."""
PEAK = 2.0**16
"""Light above this many times display white is cut off: 16 stops down it would still be white."""
LEVELS = 1 + round(math.log1p(PEAK / KNEE) / STEP)
"""Number of codes."""

ENLARGED = 2
"""CSS pixels of a pixel, where there is room: a whole number keeps pixels square and equal."""

MAP_LEVELS = 64
"""Colours of a map in a picture: neighbours differ less than an eye sees, and the file is smaller."""


@dataclass(frozen=True, slots=True)
class PagePicture:
    """One picture of a page."""

    source: str
    """Data URI of the PNG that is shown."""
    width: int
    height: int
    alt: str
    linear: str = ""
    """Data URI of :func:`linear_codes`, for a script; empty for a picture that has no exposure."""

    @property
    def shown(self) -> tuple[int, int]:
        """Width and height on a screen that has room, in CSS pixels."""
        return ENLARGED * self.width, ENLARGED * self.height


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


def display_picture(values: np.ndarray, alt: str) -> PagePicture:
    """A picture of display values in [0, 1], shape ``(H, W, 3)``; what lies outside is clipped."""
    pixels = np.rint(255 * np.clip(values, 0, 1)).astype(np.uint8)
    return _picture(_few_colours(Image.fromarray(pixels)), alt)


def linear_picture(values: np.ndarray, alt: str) -> PagePicture:
    """A picture of linear light, shape ``(H, W, 3)``, where 1 is display white; it can be re-exposed."""
    still = Image.fromarray(np.rint(255 * srgb_encode(values)).astype(np.uint8))
    shown = _picture(_few_colours(still), alt)
    halves = Image.fromarray(split_codes(linear_codes(values)))
    return PagePicture(shown.source, shown.width, shown.height, alt, _data_uri(halves))


def mapped_picture(values: np.ndarray, low: float, high: float, name: ColourMap, alt: str) -> PagePicture:
    """A picture of numbers through a colour map, shape ``(H, W)``; transparent where NaN."""
    index = to_index(values, low, high)
    shown = np.rint(index * ((MAP_LEVELS - 1) / (STEPS - 1))).astype(np.uint8)
    image = Image.fromarray(np.where(index == STEPS, MAP_LEVELS, shown).astype(np.uint8))
    image.putpalette(np.append(_map_levels(name), [[128, 128, 128]], axis=0).astype(np.uint8).tobytes())
    return _picture(image, alt, transparency=MAP_LEVELS)


def gradient(name: ColourMap) -> str:
    """A colour map as a CSS gradient, from low on the left to high on the right."""
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


def _map_levels(name: ColourMap) -> np.ndarray:
    """The colours of a map that pictures use, shape ``(MAP_LEVELS, 3)``, uint8."""
    return colour_map(name)[np.rint(np.linspace(0, STEPS - 1, MAP_LEVELS)).astype(int)]


def _few_colours(image: Image.Image) -> Image.Image:
    """The same picture in 128 colours of its own: a quarter of the bytes."""
    return image.quantize(128, dither=Image.Dither.NONE)


def _picture(image: Image.Image, alt: str, transparency: int | None = None) -> PagePicture:
    return PagePicture(_data_uri(image, transparency), image.width, image.height, alt)


def _data_uri(image: Image.Image, transparency: int | None = None) -> str:
    buffer = io.BytesIO()
    options = {} if transparency is None else {"transparency": transparency}
    image.save(buffer, format="PNG", optimize=True, **options)
    return "data:image/png;base64," + base64.b64encode(buffer.getvalue()).decode()
