# SPDX-License-Identifier: Apache-2.0
"""Photographs as other programs keep them: 8-bit sRGB in PNG and JPEG, linear light in EXR."""

import struct
import zlib
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from PIL import Image

from graycard._errors import DatasetError
from graycard.colour import srgb_decode, srgb_encode
from graycard.io import atomic_path, read_rgb

MASK_SUFFIXES = (".png", ".jpg", ".jpeg")
SUFFIXES = (*MASK_SUFFIXES, ".exr")
_BROKEN = (
    OSError, SyntaxError, ValueError, LookupError, TypeError, EOFError, ArithmeticError, MemoryError,
    struct.error, zlib.error, Image.DecompressionBombError,
)  # fmt: skip
"""Errors that Pillow raises for files that are damaged on purpose, by the format."""


def read_photograph(path: Path, width: int, height: int) -> np.ndarray:
    """The linear light of a photograph, shape ``(height, width, 3)``, float32, Rec.709.

    PNG and JPEG are decoded by the piecewise sRGB curve to [0, 1]; EXR is linear already.

    Raises:
        DatasetError: The file is missing, broken, of another kind or size, not finite, or transparent.
    """
    check_photograph(path, width, height)
    if path.suffix.lower() == ".exr":
        return _finite(read_rgb(path), path)
    levels = np.arange(256) / 255
    return srgb_decode(levels).astype(np.float32)[_pixels(path)]


def check_photograph(path: Path, width: int, height: int) -> None:
    """Prove that a photograph is there and of the right size, from its header where the format allows.

    Raises:
        DatasetError: It is missing, of another kind or size, or no image.
    """
    _check_kind(path, "photograph", SUFFIXES)
    _check_size(path, (width, height), "Scale the photograph or the camera's intrinsics")


def photograph_size(path: Path) -> tuple[int, int]:
    """Return width and height of a photograph, from its header where the format allows.

    Raises:
        DatasetError: It is missing, of another kind, or no image.
    """
    _check_kind(path, "photograph", SUFFIXES)
    return _size(path)


def check_mask(path: Path, width: int, height: int) -> None:
    """Prove that a mask is there and of the right size, from its header.

    Raises:
        DatasetError: It is missing, of another kind or size, or no image.
    """
    _check_kind(path, "mask", MASK_SUFFIXES)
    _check_size(path, (width, height), "Scale the mask")


def read_mask(path: Path, width: int, height: int) -> np.ndarray:
    """Where a mask is black, shape ``(height, width)``, bool: what other programs are told to ignore.

    Raises:
        DatasetError: The file is missing, broken, or of another kind or size.
    """
    check_mask(path, width, height)
    return _pixels(path).max(axis=-1) < 128


def write_photograph(path: Path, linear: np.ndarray) -> None:
    """Write linear light, where 1 is display white, as an 8-bit sRGB PNG, shape ``(H, W, 3)``.

    Raises:
        OutputError: The folder cannot be written to, or the disk is full.
    """
    write_png(path, np.rint(255 * srgb_encode(linear)).astype(np.uint8))


def write_mask(path: Path, ignored: np.ndarray) -> None:
    """Write a mask that is black where ``ignored``, shape ``(H, W)``, bool.

    Raises:
        OutputError: The folder cannot be written to, or the disk is full.
    """
    write_png(path, np.where(ignored, 0, 255).astype(np.uint8))


def write_png(path: Path, pixels: np.ndarray) -> None:
    """Write 8-bit pixels as PNG, shape ``(H, W)`` or ``(H, W, 3)``, whole or not at all.

    Raises:
        OutputError: The folder cannot be written to, or the disk is full.
    """
    with atomic_path(path) as partial:
        Image.fromarray(pixels).save(partial, format="PNG")


def _check_kind(path: Path, what: str, suffixes: Sequence[str]) -> None:
    if path.suffix.lower() not in suffixes:
        raise DatasetError(f"expected a {what} as {', '.join(suffixes)}, got {path}. Convert it")
    if not path.is_file():
        raise DatasetError(f"expected a {what} at {path}, got none. Add it, or leave its camera out")


def _check_size(path: Path, expected: tuple[int, int], advice: str) -> None:
    found = _size(path)
    if found != expected:
        raise DatasetError(
            f"expected {path} to be {expected[0]}x{expected[1]} pixels, as its camera is, got "
            f"{found[0]}x{found[1]}. {advice}"
        )


def _size(path: Path) -> tuple[int, int]:
    if path.suffix.lower() == ".exr":
        height, width = read_rgb(path).shape[:2]
        return width, height
    try:
        with Image.open(path) as image:
            return image.size
    except _BROKEN as cause:
        raise _broken(path, cause) from cause


def _pixels(path: Path) -> np.ndarray:
    """8-bit sRGB, shape ``(H, W, 3)``."""
    try:
        with Image.open(path) as image:
            if image.mode[0] in "IF":
                raise DatasetError(
                    f"expected 8 bits a channel in {path}, got mode {image.mode}. Save it as 8-bit sRGB, or "
                    "as linear EXR"
                )
            *colours, alpha = np.moveaxis(np.asarray(image.convert("RGBA")), -1, 0)
    except _BROKEN as cause:
        raise _broken(path, cause) from cause
    if alpha.min() < 255:
        raise DatasetError(f"expected an opaque photograph, got {path} with transparency. Remove its alpha")
    return np.stack(colours, axis=-1)


def _broken(path: Path, cause: Exception) -> DatasetError:
    return DatasetError(f"expected a whole image at {path}, got one that breaks off or is none: {cause}")


def _finite(values: np.ndarray, path: Path) -> np.ndarray:
    if not np.isfinite(values).all():
        bad = int((~np.isfinite(values)).sum())
        raise DatasetError(f"expected finite light in {path}, got {bad} values that are not. Repair it")
    return values
