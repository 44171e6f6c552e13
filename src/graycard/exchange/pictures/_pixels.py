# SPDX-License-Identifier: Apache-2.0
"""Pixels as a file stores them, with what the file says about them, and notes on what was done."""

from dataclasses import dataclass, field, replace

import numpy as np

from graycard.io import REC709

SRGB = None
"""The curve of IEC 61966-2-1, piecewise."""
LINEAR = 1.0
Curve = float | None
"""How light follows from a stored value in [0, 1]: the sRGB curve, or this power of it."""


@dataclass(frozen=True, slots=True)
class Note:
    """One thing that a picture has or that was done to its pixels."""

    what: str
    """A word or two, as ``orientation``."""
    said: str
    """What it is and what was done, the same words for the same thing in each picture."""
    warns: bool = False
    """Whether it looks wrong, or may be meant otherwise."""


@dataclass(frozen=True, slots=True)
class Encoding:
    """What stored colours mean."""

    curve: Curve = SRGB
    primaries: tuple[float, ...] = REC709
    """Chromaticities x, y of red, green, blue and white."""


@dataclass(frozen=True, slots=True)
class Exposure:
    """How a camera was set, as EXIF tells it."""

    seconds: float
    f_number: float | None = None
    iso: float | None = None


@dataclass(frozen=True, slots=True)
class Header:
    """What a file says before its pixels are read."""

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
    """Whether the values are multiplied by alpha."""
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
