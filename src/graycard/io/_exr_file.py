# SPDX-License-Identifier: Apache-2.0
"""OpenEXR files of any program: their parts, and pixels placed in the display window."""

import io
import sys
import threading
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, redirect_stdout
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import OpenEXR

from graycard._errors import GraycardError

MOST_PIXELS = 2**26
"""Pixels of a picture that is rendered, or of a display window that is not the data window, at most."""
EXR_DAMAGE = (RuntimeError, ValueError, MemoryError)
"""Errors that OpenEXR raises for files that it cannot read; a header may ask for any amount of memory."""
_stdout = threading.Lock()
"""Held while stdout leads elsewhere: of two threads, the one that ends last would leave it there."""
_PLAIN = ("RGB", "RGBA")
"""Names that OpenEXR gives to colours whose channels have no name before the dot."""

_Raw = tuple[str, Mapping[str, Any], Mapping[str, Any]]
"""Name, header and channels of a part, as OpenEXR gives them."""
Window = tuple[int, int, int, int]
"""First column and row, last column and row, all of them inside."""


@dataclass(frozen=True, slots=True)
class ExrPart:
    """One part of an EXR file; most files have one."""

    name: str
    """Empty for the only part of most files."""
    header: Mapping[str, Any]
    pieces: Mapping[str, np.ndarray]
    """Colours in one piece, ``(H, W, 3 or 4)``, by the name of their layer, ``RGB`` or ``RGBA`` where they
    have none; other channels, ``(H, W)``, by their own. All as large as the display window."""

    @property
    def data_window(self) -> Window:
        """The pixels that the file holds."""
        return _window(self.header, "dataWindow")

    @property
    def display_window(self) -> Window:
        """The pixels that a viewer shows."""
        return _window(self.header, "displayWindow")

    def planes(self) -> dict[str, np.ndarray]:
        """Return each channel by its name in the file."""
        return planes_of(self.pieces)


def read_exr(path: Path, error: type[GraycardError]) -> list[ExrPart]:
    """Return the parts of an EXR file: flat ones, with tiles or without.

    What lies outside of the display window is cut off; what the data window lacks of it is 0.

    Raises:
        GraycardError: (as ``error``) The file is missing or broken; it is deep, has two eyes, or channels
            with fewer pixels than others; or its windows have nothing in common.
    """
    _check_file(path, error)
    try:
        try:
            found = _parts(path, separate=False)
        except EXR_DAMAGE:  # colours whose channels are of several types stay apart
            found = _parts(path, separate=True)
    except EXR_DAMAGE as cause:
        raise _broken(path, cause, error) from cause
    _check_flat(path, found, error)
    return [
        ExrPart(name, header, _placed(path, header, {n: c.pixels for n, c in channels.items()}, error))
        for name, header, channels in found
    ]


def read_exr_headers(path: Path, error: type[GraycardError]) -> list[ExrPart]:
    """Return the parts of an EXR file without their pixels.

    Raises:
        GraycardError: (as ``error``) The file is missing or no EXR file.
    """
    _check_file(path, error)
    try:
        with _warnings_as_errors(), OpenEXR.File(str(path), header_only=True) as file:
            parts = [ExrPart(part.name() or "", dict(part.header), {}) for part in file.parts]
            for channel in (channel for part in parts for channel in part.header["channels"]):
                str(channel.name)  # it is decoded only now
            return parts
    except EXR_DAMAGE as cause:
        raise _broken(path, cause, error) from cause


def _check_flat(path: Path, parts: list[_Raw], error: type[GraycardError]) -> None:
    """Refuse what cannot be read as flat pictures of one eye.

    Raises:
        GraycardError: (as ``error``) A part is deep, there are two eyes, or channels are subsampled.
    """
    for _, header, channels in parts:
        if "deep" in getattr(header.get("type"), "name", ""):
            raise error(f"expected a flat picture in {path}, got a deep one. Flatten it")
        if thin := [name for name, c in channels.items() if (c.xSampling, c.ySampling) != (1, 1)]:
            raise error(
                f"expected channels with a value for each pixel in {path}, got {', '.join(thin)} with fewer "
                "(luminance and chroma?). Write R, G and B"
            )
    eyes = {header["view"]: None for _, header, _ in parts if isinstance(header.get("view"), str)}
    if len(eyes) > 1:
        raise error(
            f"expected a picture of one eye in {path}, got {', '.join(eyes)}. Write one file for each"
        )


def planes_of(pieces: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Return each channel by its name."""
    planes = {}
    for name, pixels in pieces.items():
        if pixels.ndim == 2:
            planes[name] = pixels
        else:
            stem = "" if name in _PLAIN else f"{name}."
            planes |= {f"{stem}{c}": pixels[..., i] for i, c in enumerate("RGBA"[: pixels.shape[-1]])}
    return planes


def named_by_part(part: str, piece: str, dimensions: int) -> str:
    """Return the name of a piece, after its part where it has no name of its own.

    Args:
        part: Name of the part, or an empty one.
        piece: As in :attr:`ExrPart.pieces`.
        dimensions: 3 for colours in one piece, 2 for a channel.
    """
    if not part:
        return piece
    if dimensions == 3:
        return part if piece in _PLAIN else piece
    return piece if "." in piece else f"{part}.{piece}"


def _check_file(path: Path, error: type[GraycardError]) -> None:
    sys.audit("graycard.read", str(path))  # OpenEXR opens files where Python's own audit does not see it
    if not Path(path).is_file():  # it would wait for the other end of a pipe
        raise error(f"expected an EXR file at {path}, got none")


def _broken(path: Path, cause: Exception, error: type[GraycardError]) -> GraycardError:
    if isinstance(cause, UnicodeEncodeError):
        return error(f"expected a path in UTF-8, got {str(path)!r}, which OpenEXR cannot open. Rename it")
    return error(
        f"expected a whole EXR file at {path}, got one that breaks off or is none "
        f"({Path(path).stat().st_size} bytes: {cause}). Write it again"
    )


def _parts(path: Path, separate: bool) -> list[_Raw]:
    with (
        _warnings_as_errors(),
        OpenEXR.File(str(path), separate_channels=separate) as file,
    ):  # empties headers
        return [(part.name() or "", dict(part.header), dict(part.channels)) for part in file.parts]


@contextmanager
def _warnings_as_errors() -> Iterator[None]:
    """Around calls of OpenEXR, which prints on stdout why it leaves pixels out: stdout is for results.

    Raises:
        ValueError: It printed something.
    """
    said = io.StringIO()
    try:
        with _stdout, redirect_stdout(said):
            yield
    finally:
        if words := said.getvalue().strip():
            raise ValueError(words.splitlines()[0])


def _window(header: Mapping[str, Any], name: str) -> Window:
    (left, top), (right, bottom) = header[name]
    return int(left), int(top), int(right), int(bottom)


def _placed(
    path: Path, header: Mapping[str, Any], pieces: dict[str, np.ndarray], error: type[GraycardError]
) -> dict[str, np.ndarray]:
    """Return pieces of the data window as a viewer shows them, in the display window."""
    data, display = _window(header, "dataWindow"), _window(header, "displayWindow")
    if data == display:
        return pieces
    width, height = display[2] - display[0] + 1, display[3] - display[1] + 1
    left, right = max(data[0], display[0]), min(data[2], display[2])
    top, bottom = max(data[1], display[1]), min(data[3], display[3])
    if right < left or bottom < top:
        raise error(
            f"expected pixels inside of the display window in {path}, got the data window "
            f"{words_of(data)} and the display window {words_of(display)}. Write it again with "
            "windows that meet"
        )
    if width * height > MOST_PIXELS:
        raise error(
            f"expected a display window of at most {MOST_PIXELS} pixels in {path}, got {width}x{height} "
            f"around the data window {words_of(data)}. Write it again with the display window of the picture"
        )
    source = np.s_[top - data[1] : bottom + 1 - data[1], left - data[0] : right + 1 - data[0]]
    target = np.s_[top - display[1] : bottom + 1 - display[1], left - display[0] : right + 1 - display[0]]
    placed = {}
    for name, pixels in pieces.items():
        placed[name] = np.zeros((height, width, *pixels.shape[2:]), pixels.dtype)
        placed[name][target] = pixels[source]
    return placed


def words_of(window: Window) -> str:
    """Return a window in words, as ``(0, 0) to (31, 23)``."""
    return f"({window[0]}, {window[1]}) to ({window[2]}, {window[3]})"
