# SPDX-License-Identifier: Apache-2.0
"""PLY files of any program: elements as arrays, up to the first one with lists."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from graycard._errors import GraycardError
from graycard.io._files import read_bytes

_TYPES = {
    **dict.fromkeys(("char", "int8"), "i1"),
    **dict.fromkeys(("uchar", "uint8"), "u1"),
    **dict.fromkeys(("short", "int16"), "i2"),
    **dict.fromkeys(("ushort", "uint16"), "u2"),
    **dict.fromkeys(("int", "int32"), "i4"),
    **dict.fromkeys(("uint", "uint32"), "u4"),
    **dict.fromkeys(("float", "float32"), "f4"),
    **dict.fromkeys(("double", "float64"), "f8"),
}
_ORDERS = {"ascii": "<", "binary_little_endian": "<", "binary_big_endian": ">"}
"""Of bytes, by the format that the header names."""
_LONGEST_HEADER = 2**16


@dataclass(frozen=True, eq=False)
class Ply:
    """What a PLY file holds."""

    elements: dict[str, np.ndarray]
    """Rows by name of the element, each a structured array in the byte order of the file; not writable."""
    comments: tuple[str, ...]
    """Lines of the header that are for readers, without the word ``comment``."""


@dataclass(frozen=True)
class _Header:
    """The first lines, and where they end."""

    lines: list[str]
    start: int
    """Of the data, in bytes."""
    format: str


def read_ply(path: Path, error: type[GraycardError], what: str) -> Ply:
    """Read a PLY file: text, or binary in either byte order. Faces and other lists are left out.

    Args:
        path: The file.
        error: What is raised.
        what: Kind of data, for messages, as ``points``.

    Raises:
        GraycardError: The file is missing, cut off, or no PLY of numbers.
    """
    try:
        data = read_bytes(path)
    except OSError as cause:
        raise error(f"expected {what} at {path}, got {cause.strerror or cause}") from cause
    header = _header(data, path, error)
    try:
        layouts = _layouts(header.lines, _ORDERS[header.format])
        rows = _text_rows if header.format == "ascii" else _binary_rows
        found = rows(data[header.start :] if header.format == "ascii" else data, layouts, header.start)
    except (ValueError, KeyError, IndexError, OverflowError) as cause:
        raise error(f"expected a whole PLY at {path}, got one cut off or damaged: {cause}") from cause
    comments = (line.partition(" ")[2].strip() for line in header.lines if line.startswith("comment "))
    return Ply(found, tuple(comments))


def _header(data: bytes, path: Path, error: type[GraycardError]) -> _Header:
    end = data.find(b"end_header", 0, _LONGEST_HEADER)
    start = data.find(b"\n", end) + 1
    if not data.startswith(b"ply") or end < 0 or start == 0:
        raise error(f"expected a PLY file at {path}, got one without its header")
    lines = data[:end].decode("latin-1").splitlines()
    named = [fields[1] for line in lines if (fields := line.split())[:1] == ["format"] and len(fields) > 1]
    if len(named) != 1 or named[0] not in _ORDERS:
        raise error(
            f"expected a PLY whose format is {', '.join(_ORDERS)} at {path}, got another kind: "
            f"{', '.join(named) or 'none'}"
        )
    return _Header(lines, start, named[0])


def _layouts(lines: list[str], order: str) -> list[tuple[str, int, np.dtype]]:
    found: list[tuple[str, int, list[tuple[str, str]]]] = []
    for fields in (line.split() for line in lines):
        if fields[:1] == ["element"]:
            found.append((fields[1], _count(fields[2]), []))
        elif fields[:2] == ["property", "list"]:
            found.pop()
            break
        elif fields[:1] == ["property"]:
            found[-1][2].append((fields[2], order + _TYPES[fields[1]]))
    return [(name, count, np.dtype(kinds)) for name, count, kinds in found if kinds or count]


def _count(text: str) -> int:
    if not (text.isascii() and text.isdigit()):
        raise ValueError(f"{text} rows")
    return int(text)


def _binary_rows(data: bytes, layouts: list[tuple[str, int, np.dtype]], start: int) -> dict[str, np.ndarray]:
    rows = {}
    for name, count, kind in layouts:
        rows[name] = np.frombuffer(data, kind, count, start)
        start += count * kind.itemsize
    return rows


def _text_rows(data: bytes, layouts: list[tuple[str, int, np.dtype]], _start: int) -> dict[str, np.ndarray]:
    lines, rows, start = data.decode("latin-1").splitlines(), {}, 0
    for name, count, kind in layouts:
        part = lines[start : start + count]
        if len(part) < count:
            raise ValueError(f"{len(part)} of {count} rows of {name}")
        values = np.array([line.split() for line in part], np.float64).reshape(count, len(kind.names or ()))
        rows[name] = np.array([tuple(row) for row in values.tolist()], kind)
        start += count
    return rows
