# SPDX-License-Identifier: Apache-2.0
"""Photographs and masks beside their cameras: which way they are turned, and how they are read."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np

from graycard._errors import DatasetError
from graycard.exchange.pictures import _openexr, _png, _tiff
from graycard.exchange.pictures._files import Files, find_picture, hush_pillow, kind_of
from graycard.exchange.pictures._light import Background, to_light
from graycard.exchange.pictures._masks import ANY_KIND, MaskKind, kind_of_masks, white_of
from graycard.exchange.pictures._pixels import Exposure, Header, Note, Pixels
from graycard.exchange.pictures._turn import UPRIGHT, WORDS, swaps_sides, turn

Orientation = Literal["auto", "stored", "upright"]
"""Way to take EXIF orientation: as the size of the camera tells, pixels as stored, or turned upright."""
Size = tuple[int, int]
"""Width and height, pixels."""


@dataclass(frozen=True, slots=True)
class FoundPicture:
    """A picture that is there and as large as its camera says, before its pixels are read."""

    path: Path
    header: Header
    turned: bool = False
    """True if it is turned upright when it is read."""
    notes: tuple[Note, ...] = ()

    @property
    def exposure(self) -> Exposure | None:
        """Exposure of the camera, where EXIF tells it."""
        return self.header.exposure


@dataclass(frozen=True, slots=True)
class Picture:
    """The light of a photograph."""

    light: np.ndarray
    """Shape ``(H, W, 3)``, float32, linear Rec.709; 1 is display white, except in files of floats."""
    bits: int
    """Bits of a stored value; 0 for floats."""
    notes: tuple[Note, ...]


def read_header(path: Path, what: str = "photograph") -> Header:
    """Return what a picture says before its pixels are read.

    Raises:
        DatasetError: It is missing, damaged, or of a kind that is not read.
    """
    hush_pillow()
    match kind_of(path, what):
        case "EXR":
            return _openexr.read_header(path)
        case "TIFF":
            return _tiff.read_header(path)
        case kind:
            return _png.read_header(path, kind)


def read_pixels(path: Path, what: str = "photograph") -> Pixels:
    """Return pixels as they are stored in a file, neither decoded nor turned, with all their bits.

    Raises:
        DatasetError: It is missing, damaged, or of a kind that is not read.
    """
    hush_pillow()
    match kind_of(path, what):
        case "EXR":
            return _openexr.read_pixels(path)
        case "TIFF":
            return _tiff.read_pixels(path)
        case kind:
            return _png.read_pixels(path, kind)


def find_photographs(
    wanted: Sequence[tuple[Path, Size]], orientation: Orientation = "auto", what: str = "photograph"
) -> list[FoundPicture]:
    """Return the photographs that cameras name, each with the way it is to be turned.

    With ``auto`` a photograph is turned upright where it fits its camera only so, and left as stored where it
    fits only so. Where it fits both ways, it is turned if those that fit one way were all turned.

    Args:
        wanted: Path and size of each, as its camera says.
        orientation: How EXIF orientation is taken.
        what: A word for them, for messages.

    Raises:
        DatasetError: One is missing, damaged, of another size, or of a kind that is not read.
    """
    found, files = [], Files()
    for path, size in wanted:
        place = find_picture(path, what, files)
        notes = (Note("names", "found under a name in other case"),) if place.name != path.name else ()
        found.append((FoundPicture(place, read_header(place, what), notes=notes), size))
    told = {t for picture, size in found for t in [_told(picture.header, size)] if t is not None}
    return [_turned(picture, size, orientation, told == {True}, what) for picture, size in found]


def read_photograph(found: FoundPicture, background: Background = "none") -> Picture:
    """Return the linear light of a photograph, shape ``(H, W, 3)``, float32, Rec.709.

    Args:
        found: As of :func:`find_photographs`.
        background: What is put behind transparent pixels.

    Raises:
        DatasetError: It is damaged, not finite, transparent, or of colours that are not converted.
    """
    pixels = read_pixels(found.path)
    light, notes = to_light(pixels, found.path, background)
    if found.turned:
        light = np.ascontiguousarray(turn(light, found.header.orientation))
    _check_size(found, light)
    return Picture(light, pixels.bits, (*pixels.notes, *notes, *found.notes))


def look_at_masks(masks: Sequence[FoundPicture]) -> MaskKind:
    """Return the kind that masks of one set have, from those that show an object.

    Raises:
        DatasetError: One is damaged, or no mask.
    """
    return kind_of_masks((read_pixels(mask.path, "mask"), mask.path) for mask in masks)


def read_mask(found: FoundPicture, kind: MaskKind = ANY_KIND) -> tuple[np.ndarray, tuple[Note, ...]]:
    """Return where a mask is black, shape ``(H, W)``, bool, and notes on how it was read.

    Args:
        found: As of :func:`find_photographs`.
        kind: As of :func:`look_at_masks`.

    Raises:
        DatasetError: It is damaged, or no mask.
    """
    white, notes = white_of(read_pixels(found.path, "mask"), found.path, kind)
    if found.turned:
        white = turn(white, found.header.orientation)
    _check_size(found, white)
    return ~white, (*notes, *found.notes)


def _check_size(found: FoundPicture, image: np.ndarray) -> None:
    """Refuse a file that changed since it was found, or whose header lies.

    Raises:
        DatasetError: It has another size.
    """
    height, width = image.shape[:2]
    if (width, height) != _size(found.header, found.turned):
        raise DatasetError(
            f"expected {found.path} to be as large as its header says, got {width}x{height} pixels"
        )


def _size(header: Header, turned: bool) -> Size:
    swapped = turned and swaps_sides(header.orientation)
    return (header.height, header.width) if swapped else (header.width, header.height)


def _told(header: Header, size: Size) -> bool | None:
    """Tell whether a picture fits its camera only when it is turned; None where both ways or none fit."""
    stored, upright = (_size(header, turned) == size for turned in (False, True))
    return None if header.orientation == UPRIGHT or stored == upright else upright


def _turned(
    picture: FoundPicture, size: Size, orientation: Orientation, others: bool, what: str
) -> FoundPicture:
    """Return a picture with the way it is turned.

    Raises:
        DatasetError: It does not fit its camera this way.
    """
    header = picture.header
    told = _told(header, size)
    turned = {"stored": False, "upright": True, "auto": others if told is None else told}[orientation]
    turned &= header.orientation != UPRIGHT
    if _size(header, turned) != size:
        width, height = _size(header, turned)
        raise DatasetError(
            f"expected {picture.path} to be {size[0]}x{size[1]} pixels, as its camera is, got "
            f"{width}x{height}. "
            f"{_advice(header, size, turned, what)}"
        )
    if header.orientation == UPRIGHT:
        return FoundPicture(picture.path, header, False, picture.notes)
    return FoundPicture(
        picture.path, header, turned, (*picture.notes, _about_turn(header, turned, orientation, told))
    )


def _advice(header: Header, size: Size, turned: bool, what: str) -> str:
    if _size(header, not turned) == size:
        return (
            f"EXIF says {WORDS[header.orientation]}: give --orientation {'stored' if turned else 'upright'}"
        )
    if what == "mask":
        return "Scale the mask"
    return "Scale the photograph or the camera's intrinsics"


def _about_turn(header: Header, turned: bool, orientation: Orientation, told: bool | None) -> Note:
    done = "turned upright" if turned else "taken as stored"
    why = {
        "stored": "as asked for",
        "upright": "as asked for",
        "auto": "as its camera's size tells"
        if told is not None
        else "as others are"
        if turned
        else "as COLMAP does; viewers turn it (--orientation upright)",
    }[orientation]
    unsure = orientation == "auto" and told is None
    return Note("orientation", f"EXIF says {WORDS[header.orientation]}: {done}, {why}", unsure)
