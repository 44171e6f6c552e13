# SPDX-License-Identifier: Apache-2.0
"""Find pictures, and tell kinds of files by their first bytes, whatever their names end in."""

import struct
import warnings
import zlib
from collections.abc import Callable
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


class Files:
    """Files by their names in any case; each folder is listed once."""

    def __init__(self) -> None:
        self.listed: dict[Path, dict[str, list[Path]]] = {}

    def find(self, path: Path) -> Path | None:
        """Return where a file is: at a path, or where names of files and folders differ in case alone.

        Links are followed.

        Returns:
            None where there is none.

        Raises:
            DatasetError: There are several, and none has the very name.
        """
        found = self._find(path, Path.is_file)
        return found if found is not None and found.is_file() else None

    def _find(self, path: Path, fits: Callable[[Path], bool]) -> Path | None:
        if fits(path) or path.parent == path:
            return path
        parent = self._find(path.parent, Path.is_dir)
        alike = [p for p in self._list(parent).get(path.name.lower(), ()) if fits(p)] if parent else []
        if len(alike) > 1:
            names = ", ".join(p.name for p in alike)
            raise DatasetError(f"expected one file for {path}, got {names}. Rename the others")
        return alike[0] if alike else None

    def _list(self, folder: Path) -> dict[str, list[Path]]:
        if folder not in self.listed:
            names: dict[str, list[Path]] = {}
            for path in sorted(folder.iterdir()) if folder.is_dir() else ():
                names.setdefault(path.name.lower(), []).append(path)
            self.listed[folder] = names
        return self.listed[folder]


def find_picture(path: Path, what: str = "photograph", files: Files | None = None) -> Path:
    """Return where a picture is, as :meth:`Files.find` does.

    Raises:
        DatasetError: There is none, or there are several and none has the very name.
    """
    if found := (files or Files()).find(path):
        return found
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
    """Return the error for a file that its library cannot read, or does not as it is too large."""
    if isinstance(cause, Image.DecompressionBombError):
        return DatasetError(f"expected an image of fewer pixels at {path}: {cause}. Scale it")
    return DatasetError(f"expected a whole image at {path}, got one that breaks off or is none: {cause}")
