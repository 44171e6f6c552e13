# SPDX-License-Identifier: Apache-2.0
"""Pixels as a file stores them, with what the file says about them, and notes on what was done."""

from dataclasses import dataclass, field, replace

import numpy as np

from graycard.io import REC709

SRGB = None
"""The curve of IEC 61966-2-1, piecewise."""
LINEAR = 1.0
Curve = float | None
"""Curve from a stored value in [0, 1] to light: that of sRGB, or this power."""


@dataclass(frozen=True, slots=True)
class Note:
    """One thing that a picture has or that was done to its pixels."""

    what: str
    """A word or two, as ``orientation``."""
    said: str
    """Words for what was found and done, the same for the same thing in each picture."""
    warns: bool = False
    """True if it looks wrong, or may be meant otherwise."""


@dataclass(frozen=True, slots=True)
class Encoding:
    """Meaning of stored colours: curve and primaries."""

    curve: Curve = SRGB
    primaries: tuple[float, ...] = REC709
    """Chromaticities x, y of red, green, blue and white."""


@dataclass(frozen=True, slots=True)
class Exposure:
    """Exposure of a camera, as EXIF tells it."""

    seconds: float
    f_number: float | None = None
    iso: float | None = None


@dataclass(frozen=True, slots=True)
class Header:
    """Header of a picture: all that a file says before its pixels are read."""

    width: int
    """Pixels, as stored: before any turn."""
    height: int
    orientation: int = 1
    """EXIF orientation, 1 to 8; 1 is upright."""
    exposure: Exposure | None = None


@dataclass(frozen=True, slots=True)
class Pixels:
    """Pixels of a file as they are stored: not decoded, not turned."""

    values: np.ndarray
    """Shape ``(H, W, 3)``, or ``(H, W)`` of a grey one; uint8, uint16 or float32. Of integers, the largest
    is 1."""
    alpha: np.ndarray | None = None
    """Shape ``(H, W)``, of the same type: how much of a pixel is covered; None where the file has none."""
    encoding: Encoding = field(default_factory=Encoding)
    premultiplied: bool = False
    """True if the values are multiplied by alpha."""
    notes: tuple[Note, ...] = ()

    @property
    def top(self) -> float:
        """The stored value that means 1."""
        return float(np.iinfo(self.values.dtype).max) if self.bits else 1.0

    @property
    def bits(self) -> int:
        """Bits of a stored value; 0 where it is a floating-point number."""
        return 8 * self.values.dtype.itemsize if self.values.dtype.kind == "u" else 0

    def noted(self, *notes: Note) -> "Pixels":
        """Return the same with more notes."""
        return replace(self, notes=(*self.notes, *notes))
