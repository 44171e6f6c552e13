# SPDX-License-Identifier: Apache-2.0
"""PNG and JPEG: Pillow for what has 8 bits or fewer, OpenCV for PNG of 16, which Pillow cuts to 8."""

import struct
from pathlib import Path

import numpy as np
from PIL import Image

from graycard._errors import DatasetError
from graycard.exchange.pictures._exif import exif_folder, exposure_of, is_adobe_rgb, orientation_of
from graycard.exchange.pictures._files import DAMAGE, broken
from graycard.exchange.pictures._pixels import Encoding, Header, Note, Pixels
from graycard.exchange.pictures._profiles import by_chunks, by_profile
from graycard.io import read_bytes

_KEPT = (b"IHDR", b"cICP", b"sRGB", b"gAMA", b"cHRM", b"eXIf", b"tRNS")
_MOST_CHUNKS = 100_000
_LONGEST = 2**24
_PALETTE = 3
"""Colour type of a PNG whose pixels are numbers of colours."""


def read_header(path: Path, kind: str) -> Header:
    """Return size, orientation and exposure of a PNG or JPEG from its first bytes.

    Raises:
        DatasetError: It is damaged.
    """
    try:
        with Image.open(path, formats=(kind,)) as image:
            exif = _exif(image, _chunks(path) if kind == "PNG" else {})
            return Header(*image.size, orientation_of(exif), exposure_of(exif_folder(exif)))
    except DAMAGE as cause:
        raise broken(path, cause) from cause


def read_pixels(path: Path, kind: str) -> Pixels:
    """Return the pixels of a PNG or JPEG as they are stored, with all their bits.

    Raises:
        DatasetError: It is damaged, moves, is of inks, or has a colour profile that is not converted.
    """
    try:
        chunks = _chunks(path) if kind == "PNG" else {}
        with Image.open(path, formats=(kind,)) as image:
            if kind == "PNG" and getattr(image, "is_animated", False):
                raise DatasetError(
                    f"expected one picture in {path}, got a moving one. Save one of its frames"
                )
            image.load()  # a file that breaks off is an error here; OpenCV would fill it up
            encoding, notes = _encoding(image, chunks, path)
            deep = kind == "PNG" and chunks[b"IHDR"][8] == 16
            values, alpha = _deep(path, chunks) if deep else eight_bits(image, path)
    except DatasetError:
        raise
    except DAMAGE as cause:
        raise broken(path, cause) from cause
    palette = ", palette" if kind == "PNG" and chunks[b"IHDR"][9] == _PALETTE else ""
    said = f"{16 if deep else 8}-bit {kind}{', grey' * (values.ndim == 2)}{palette}"
    return Pixels(values, alpha, encoding, notes=(Note("file", said), *notes))


def eight_bits(image: Image.Image, path: Path) -> tuple[np.ndarray, np.ndarray | None]:
    """Return values ``(H, W, 3)`` or ``(H, W)``, and alpha ``(H, W)`` if there is one, uint8, straight.

    Raises:
        DatasetError: The picture is of inks, or of another colour model.
    """
    if image.mode in ("CMYK", "LAB", "HSV", "F", "I") or image.mode.startswith("I;"):
        raise DatasetError(
            f"expected grey or red, green and blue in {path}, got {image.mode}. Save it as 8-bit or "
            "16-bit sRGB"
        )
    if image.has_transparency_data:
        *colours, alpha = np.moveaxis(np.asarray(image.convert("RGBA")), -1, 0)
        return np.stack(colours, axis=-1), alpha
    return np.asarray(image.convert("L" if image.mode in ("1", "L") else "RGB")), None


def _encoding(
    image: Image.Image, chunks: dict[bytes, bytes], path: Path
) -> tuple[Encoding, tuple[Note, ...]]:
    if b"cICP" not in chunks and (profile := image.info.get("icc_profile")):
        encoding, note = by_profile(profile, path)
        return encoding, (note,)
    if found := by_chunks(chunks, path):
        return found[0], (found[1],)
    if is_adobe_rgb(_exif(image, chunks)):
        raise DatasetError(
            f"expected a picture of sRGB or Display P3 at {path}, got Adobe RGB, as its EXIF says. Convert "
            "it to sRGB in a program that knows profiles"
        )
    return Encoding(), ()


def _exif(image: Image.Image, chunks: dict[bytes, bytes]) -> Image.Exif:
    if image.format != "PNG":
        return image.getexif()
    exif = Image.Exif()  # image.getexif() would decode the whole picture to look behind its pixels
    if b"eXIf" in chunks:
        exif.load(b"Exif\0\0" + chunks[b"eXIf"])
    return exif


def _chunks(path: Path) -> dict[bytes, bytes]:
    """Return the chunks of a PNG that say what its pixels are; of several, the first.

    Raises:
        ValueError: It has no header.
    """
    found: dict[bytes, bytes] = {}
    with path.open("rb") as file:
        file.seek(8)
        for _ in range(_MOST_CHUNKS):
            head = file.read(8)
            if len(head) < 8:
                break
            length, name = struct.unpack(">I4s", head)
            if name in _KEPT and name not in found and length <= _LONGEST:
                found[name] = file.read(length)
                file.seek(4, 1)
            else:
                file.seek(length + 4, 1)
    if len(found.get(b"IHDR", b"")) != 13:
        raise ValueError("no header of a PNG")
    return found


def _deep(path: Path, chunks: dict[bytes, bytes]) -> tuple[np.ndarray, np.ndarray | None]:
    """Return values and alpha of a PNG of 16 bits, uint16."""
    import cv2

    decoded = cv2.imdecode(np.frombuffer(read_bytes(path), np.uint8), cv2.IMREAD_UNCHANGED)
    if decoded is None or decoded.dtype != np.uint16:
        raise ValueError("its 16 bits cannot be read")
    values, alpha = (decoded, None) if decoded.ndim == 2 else (decoded[..., 2::-1], None)
    if decoded.ndim == 3 and decoded.shape[2] == 4:
        alpha = decoded[..., 3]
    if chunks[b"IHDR"][9] in (0, 4) and values.ndim == 3:
        values = values[..., 0]
    if alpha is None and b"tRNS" in chunks:  # one colour is transparent
        key = np.frombuffer(chunks[b"tRNS"], ">u2").astype(np.uint16)
        hit = (values == key) if values.ndim == 2 else (values == key).all(axis=-1)
        alpha = np.where(hit, 0, 65535).astype(np.uint16)
    return np.ascontiguousarray(values), alpha
