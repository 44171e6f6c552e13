# SPDX-License-Identifier: Apache-2.0
"""Orientation, exposure and colour space from EXIF."""

import math
from collections.abc import Mapping
from typing import Any

from PIL import Image
from PIL.ExifTags import IFD, Base, Interop

from graycard.exchange.pictures._pixels import Exposure
from graycard.exchange.pictures._turn import UPRIGHT, WORDS

_ADOBE_RGB = 2
"""Value of ColorSpace that no standard has and some cameras write."""


def orientation_of(exif: Mapping[int, Any]) -> int:
    """Return the orientation, 1 to 8; 1 where none is told or what is told is none."""
    found = exif.get(Base.Orientation)
    return int(found) if isinstance(found, int | float) and found in WORDS else UPRIGHT


def exposure_of(tags: Mapping[int, Any]) -> Exposure | None:
    """Return how the camera was set, from the EXIF folder of tags; None where no time is told."""
    seconds = _positive(tags.get(Base.ExposureTime))
    if seconds is None:
        return None
    return Exposure(seconds, _positive(tags.get(Base.FNumber)), _positive(tags.get(Base.ISOSpeedRatings)))


def exif_folder(exif: Image.Exif) -> Mapping[int, Any]:
    """Return the tags of the camera's settings."""
    return exif.get_ifd(IFD.Exif)


def is_adobe_rgb(exif: Image.Exif) -> bool:
    """Tell whether EXIF says that colours are of Adobe RGB, as cameras do without an ICC profile."""
    interoperability = exif.get_ifd(IFD.Interop).get(Interop.InteropIndex, "")
    if isinstance(interoperability, bytes):
        interoperability = interoperability.decode("latin-1")
    return exif_folder(exif).get(Base.ColorSpace) == _ADOBE_RGB or str(interoperability).startswith("R03")


def _positive(value: Any) -> float | None:
    """Return a finite number above 0 from a number, a fraction or a tuple of numbers; else None."""
    if isinstance(value, tuple | list):
        value = value[0] if value else None
    try:
        number = float(value)  # pyright: ignore[reportArgumentType]
    except (TypeError, ValueError, ArithmeticError):
        return None
    return number if 0 < number < math.inf else None
