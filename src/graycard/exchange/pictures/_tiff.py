# SPDX-License-Identifier: Apache-2.0
"""TIFF: Pillow for 8 bits or fewer, tifffile for 16 bits and floats, OpenCV for 16 bits in LZW."""

import logging
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image
from PIL.ExifTags import Base

from graycard._errors import DatasetError
from graycard.exchange.pictures._exif import exposure_of, orientation_of
from graycard.exchange.pictures._files import DAMAGE, broken
from graycard.exchange.pictures._pixels import LINEAR, Encoding, Header, Note, Pixels
from graycard.exchange.pictures._png import eight_bits
from graycard.exchange.pictures._profiles import by_profile
from graycard.exchange.pictures._turn import turn_back
from graycard.io import read_bytes

_WHITE_IS_0, _BLACK_IS_0, _RGB, _PALETTE, _YCBCR = 0, 1, 2, 3, 6
_PREMULTIPLIED, _STRAIGHT = 1, 2
_PROFILE = 34675
_SETTINGS = Base.ExposureTime, Base.FNumber, Base.ISOSpeedRatings
_LOOKED_AT = 16
"""Pages that are looked at: a file may name any number of them."""


def read_header(path: Path) -> Header:
    """Return size, orientation and exposure of a TIFF.

    Raises:
        DatasetError: It is damaged.
    """
    with _Opened(path) as page:
        settings = _value(page, "ExifTag")
        told = settings if isinstance(settings, Mapping) else {}
        tags = {int(tag): _number(told.get(tag.name)) for tag in _SETTINGS}
        size = int(page.imagewidth), int(page.imagelength)
        return Header(*size, _orientation(page), exposure_of(tags))


def read_pixels(path: Path) -> Pixels:
    """Return the pixels of a TIFF as they are stored, with all their bits.

    Floats are linear light. Values multiplied by alpha are as stored where they have more than 8 bits.

    Raises:
        DatasetError: It is damaged, has several pages, or is of a kind that is not read.
    """
    with _Opened(path) as page:
        _check_kind(page, path)
        profile = _value(page, _PROFILE)
        encoding, notes = Encoding(), ()
        if page.dtype.kind == "f":
            if profile:
                raise DatasetError(
                    f"expected floats without a colour profile in {path}, got one. Save it as linear EXR "
                    "with chromaticities"
                )
            encoding = Encoding(LINEAR)
        elif profile:
            encoding, note = by_profile(bytes(profile), path)
            notes = (note,)
        if page.dtype in (np.uint16, np.float16, np.float32) or (_is_plain(page) and len(_extra(page)) > 1):
            pixels = _deep(page, path)
        else:
            values, alpha = _shallow(path, _orientation(page))
            pixels = Pixels(values, alpha, notes=_left_out(page))
    kind = f"{pixels.bits}-bit" if pixels.bits else f"float{8 * np.dtype(page.dtype).itemsize}"
    said = f"{kind} TIFF{', grey' * (pixels.values.ndim == 2)}{', palette' * (page.photometric == _PALETTE)}"
    found = Pixels(pixels.values, pixels.alpha, encoding, pixels.premultiplied, pixels.notes)
    return found.noted(Note("file", said), *notes)


class _Opened:
    """The first page of a TIFF for the length of a block; errors of libraries become ours."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.errors: tuple[type[Exception], ...] = DAMAGE

    def __enter__(self) -> Any:
        from tifffile import TiffFile, TiffFileError

        logging.getLogger("tifffile").setLevel(logging.CRITICAL)  # it would tell of damage on stderr
        self.errors = (*DAMAGE, TiffFileError)
        try:
            self.file = TiffFile(self.path)
        except self.errors as cause:
            raise broken(self.path, cause) from cause
        try:
            pages = self.file.pages
            page: Any = pages[0]
            others = [pages[i] for i in range(1, min(len(pages), _LOOKED_AT))]
            if [p for p in others if not getattr(p, "is_reduced", False)]:
                raise DatasetError(
                    f"expected one picture in {self.path}, got several pages. Save one of them"
                )
        except DatasetError:
            self.file.close()
            raise
        except self.errors as cause:
            self.file.close()
            raise broken(self.path, cause) from cause
        return page

    def __exit__(self, kind: Any, cause: Any, trace: Any) -> None:
        self.file.close()
        if isinstance(cause, self.errors) and not isinstance(cause, DatasetError):
            raise broken(self.path, cause) from cause


def _check_kind(page: Any, path: Path) -> None:
    """Refuse what is no grey or coloured picture of 1 to 16 bits or of floats.

    Raises:
        DatasetError: It is none.
    """
    photometric = int(page.photometric)
    if photometric not in (_WHITE_IS_0, _BLACK_IS_0, _RGB, _PALETTE, _YCBCR):
        name = getattr(page.photometric, "name", photometric)
        raise DatasetError(f"expected grey or red, green and blue in {path}, got {name}. Save it as sRGB")
    bits = page.bitspersample
    if page.dtype is None or page.dtype not in (np.bool_, np.uint8, np.uint16, np.float16, np.float32):
        raise DatasetError(
            f"expected 8 or 16 bits or floats of 16 or 32 in {path}, got {bits} bits "
            f"({page.dtype}). Convert it"
        )
    if page.imagedepth != 1 or page.samplesperpixel > 5:
        raise DatasetError(
            f"expected grey, colours and perhaps alpha in {path}, got {page.samplesperpixel} "
            "channels. Leave the others out"
        )


def _shallow(path: Path, orientation: int) -> tuple[np.ndarray, np.ndarray | None]:
    """Return values and alpha of 8 bits, as stored: Pillow turns a TIFF upright when it loads it."""
    with Image.open(path, formats=("TIFF",)) as image:
        image.load()
        values, alpha = eight_bits(image, path)
        upright = Base.Orientation not in image.getexif()
    if upright:
        values = turn_back(values, orientation)
        alpha = None if alpha is None else turn_back(alpha, orientation)
    return values, alpha


def _deep(page: Any, path: Path) -> Pixels:
    """Return pixels of 16 bits or of floats."""
    photometric, colours = int(page.photometric), 3 if int(page.photometric) == _RGB else 1
    if photometric in (_PALETTE, _YCBCR):
        raise DatasetError(
            f"expected red, green and blue in a deep TIFF, got {page.photometric.name} in {path}. Convert it"
        )
    values = _whole(page, path)
    if values.ndim == 3 and int(page.planarconfig) == 2:
        values = np.moveaxis(values, 0, -1)
    values = values.reshape(page.imagelength, page.imagewidth, -1)
    if photometric == _WHITE_IS_0:
        values = (np.iinfo(values.dtype).max if values.dtype.kind == "u" else 1) - values
    extra, alpha = _extra(page), None
    which = next((i for i, kind in enumerate(extra) if kind in (_PREMULTIPLIED, _STRAIGHT)), None)
    if which is not None:
        alpha = values[..., colours + which]
    picture = values[..., :colours] if colours == 3 else values[..., 0]
    if values.dtype.kind == "f":
        picture, alpha = picture.astype(np.float32), None if alpha is None else alpha.astype(np.float32)
    premultiplied = which is not None and extra[which] == _PREMULTIPLIED
    return Pixels(picture, alpha, Encoding(), premultiplied, _left_out(page))


def _is_plain(page: Any) -> bool:
    """Tell whether samples of a page are grey or red, green and blue themselves."""
    return int(page.photometric) in (_WHITE_IS_0, _BLACK_IS_0, _RGB)


def _extra(page: Any) -> list[int]:
    """Return the kinds of the channels beyond colours, 0 where the file does not say."""
    count = int(page.samplesperpixel) - (3 if int(page.photometric) in (_RGB, _YCBCR) else 1)
    told = [int(kind) for kind in page.extrasamples][:count]
    return told + [0] * (count - len(told))


def _left_out(page: Any) -> tuple[Note, ...]:
    """Return a note on channels that are neither colours nor the first alpha."""
    extra = _extra(page)
    count = len(extra) - any(kind in (_PREMULTIPLIED, _STRAIGHT) for kind in extra)
    if count < 1:
        return ()
    named = "a channel that is" if count == 1 else f"{count} channels that are"
    return (
        Note("alpha", f"{named} not said to be alpha {'was' if count == 1 else 'were'} left out", warns=True),
    )


def _whole(page: Any, path: Path) -> np.ndarray:
    try:
        return page.asarray()
    except (ValueError, KeyError, ImportError) as cause:
        if "imagecodecs" not in str(cause):
            raise
        plain = int(page.photometric) in (_BLACK_IS_0, _RGB) and page.samplesperpixel in (1, 3)
        if page.dtype != np.uint16 or not plain or int(page.planarconfig) != 1:
            name = getattr(page.compression, "name", page.compression)
            raise DatasetError(
                f"expected a TIFF without compression, with deflate, or LZW of 16 bits without alpha at "
                f"{path}, got {name}. Save it so"
            ) from cause
    return turn_back(_by_opencv(path), _orientation(page))  # OpenCV turns a TIFF upright


def _by_opencv(path: Path) -> np.ndarray:
    import cv2

    with Image.open(path, formats=("TIFF",)) as image:
        image.load()  # a file that breaks off is an error here
    decoded = cv2.imdecode(np.frombuffer(read_bytes(path), np.uint8), cv2.IMREAD_UNCHANGED)
    if decoded is None or decoded.dtype != np.uint16:
        raise ValueError("its 16 bits cannot be read")
    return decoded if decoded.ndim == 2 else np.ascontiguousarray(decoded[..., ::-1])


def _orientation(page: Any) -> int:
    return orientation_of({int(Base.Orientation): _number(_value(page, "Orientation"))})


def _value(page: Any, tag: str | int) -> Any:
    return page.tags.valueof(tag)


def _number(value: Any) -> float | None:
    """Return a number from one, or from a fraction as tifffile gives it."""
    if isinstance(value, tuple):
        return value[0] / value[1] if len(value) == 2 and value[1] else None
    return None if value is None else float(value)
