# SPDX-License-Identifier: Apache-2.0
"""Find pictures, and tell kinds of files by their first bytes, whatever their names end in."""

import struct
import warnings
import zlib
from pathlib import Path
from typing import Literal

from PIL import Image

from graycard._errors import DatasetError

Kind = Literal["PNG", "JPEG", "TIFF", "EXR"]
_MAGIC: dict[bytes, Kind] = {
    b"\x89PNG\r\n\x1a\n": "PNG",
    b"\xff\xd8\xff": "JPEG",
    b"II*\0": "TIFF",
    b"MM\0*": "TIFF",
    b"II+\0": "TIFF",  # of more than 4 GiB
    b"MM\0+": "TIFF",
    b"\x76\x2f\x31\x01": "EXR",
}
_OTHERS = {
    b"GIF8": "GIF",
    b"BM": "BMP",
    b"RIFF": "WebP",
    b"\0\0\0\x0cjP": "JPEG 2000",
    b"\xff\x4f\xff\x51": "JPEG 2000",
    b"#?": "Radiance HDR",
    b"\0\0\x01\0": "ICO",
    b"P": "a portable anymap",
    b"version https://git-lfs": "a pointer of Git LFS",
}
SUFFIXES = (".png", ".jpg", ".jpeg", ".tif", ".tiff", ".exr")
DAMAGE = (
    OSError, SyntaxError, ValueError, LookupError, TypeError, EOFError, ArithmeticError, MemoryError,
    AttributeError, RuntimeError, struct.error, zlib.error, Image.DecompressionBombError,
)  # fmt: skip
"""Errors that libraries raise for files that are damaged on purpose, by the format."""


def hush_pillow() -> None:
    """Let Pillow not warn of damage on stderr: what cannot be read is an error, with the file's name."""
    warnings.filterwarnings("ignore", module=r"PIL\.")


def find_picture(path: Path, what: str = "photograph") -> Path:
    """Return where a picture is: at a path, or beside it under the same name in other case.

    Links are followed.

    Raises:
        DatasetError: There is none, or there are several and none has the very name.
    """
    if path.is_file():
        return path
    alike = []
    if path.parent.is_dir():
        alike = [p for p in path.parent.iterdir() if p.name.lower() == path.name.lower() and p.is_file()]
    if len(alike) == 1:
        return alike[0]
    if path.is_symlink():
        raise DatasetError(f"expected a {what} at {path}, got a link to nothing. Mend the link")
    raise DatasetError(f"expected a {what} at {path}, got none. Add it, or leave its camera out")


def kind_of(path: Path, what: str = "photograph") -> Kind:
    """Return the format of a file.

    Raises:
        DatasetError: It is none of those that are read.
    """
    with path.open("rb") as file:
        head = file.read(32)
    for magic, kind in _MAGIC.items():
        if head.startswith(magic):
            return kind
    other = next((name for magic, name in _OTHERS.items() if head.startswith(magic)), "something else")
    if not head:
        other = "an empty file"
    if path.suffix.lower() in SUFFIXES:
        raise broken(path, f"it begins as {other}")
    raise DatasetError(
        f"expected a {what} as {', '.join(SUFFIXES)}, got {path}, which is {other}. Convert it"
    )


def broken(path: Path, cause: object) -> DatasetError:
    """Return the error for a file that its library cannot read."""
    return DatasetError(f"expected a whole image at {path}, got one that breaks off or is none: {cause}")
