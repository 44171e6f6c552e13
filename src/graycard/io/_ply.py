# SPDX-License-Identifier: Apache-2.0
"""PLY files of any program: elements as arrays, but for those with lists."""

import io
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import islice
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
"""Order of bytes, by the format that the header names."""
_LONGEST_HEADER = 2**16
_BLOCK = 1024
"""Rows of text that are parsed at once."""
_MARK = b"\xef\xbb\xbf"
"""A byte order mark, which editors put before text."""


@dataclass(frozen=True, eq=False)
class Ply:
    """Contents of a PLY file."""

    elements: dict[str, np.ndarray]
    """Rows by name of the element, each a structured array in the byte order of the file; not writable."""
    comments: tuple[str, ...]
    """Lines of the header that are for readers, without the word ``comment``."""


@dataclass(frozen=True, slots=True)
class _Element:
    """One kind of rows, as the header names it."""

    name: str
    count: int
    fields: list[tuple[str, str, np.dtype | None]]
    """Name, type, and type of the length for a list, else None."""

    @property
    def plain(self) -> bool:
        """Tell whether it has no lists."""
        return all(length is None for _, _, length in self.fields)

    @property
    def kind(self) -> np.dtype:
        """Return the type of a row without lists."""
        return np.dtype([(name, kind) for name, kind, _ in self.fields])


@dataclass(frozen=True)
class _Header:
    """The first lines, and where they end."""

    lines: list[str]
    start: int
    """Place of the data, in bytes."""
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
    data = data.removeprefix(_MARK)
    header = _header(data, path, error)
    try:
        elements = _elements(header.lines, _ORDERS[header.format])
        if header.format == "ascii":
            found = _text_rows(data, elements, header.start)
        else:
            found = _binary_rows(data, elements, header.start)
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


def _elements(lines: list[str], order: str) -> list[_Element]:
    found: list[_Element] = []
    for fields in (line.split() for line in lines):
        if fields[:1] == ["element"]:
            found.append(_Element(fields[1], _count(fields[2]), []))
        elif fields[:2] == ["property", "list"]:
            length = np.dtype(order + _TYPES[fields[2]])
            found[-1].fields.append((fields[4], order + _TYPES[fields[3]], length))
        elif fields[:1] == ["property"]:
            found[-1].fields.append((fields[2], order + _TYPES[fields[1]], None))
    return found


def _count(text: str) -> int:
    if not (text.isascii() and text.isdigit()):
        raise ValueError(f"{text} rows")
    return int(text)


def _binary_rows(data: bytes, elements: list[_Element], start: int) -> dict[str, np.ndarray]:
    """Return rows; lists after the last element without lists are not walked through.

    Raises:
        ValueError: The file ends before the rows do, or goes on after them.
    """
    rows = {}
    last = max((i for i, element in enumerate(elements) if element.plain), default=-1)
    for element in elements[: last + 1]:
        if element.plain:
            rows[element.name] = np.frombuffer(data, element.kind, element.count, start)
            start += element.count * element.kind.itemsize
        else:
            start = _past_lists(data, element, start)
    if last + 1 == len(elements) and data[start:].strip(b"\0\r\n "):
        raise ValueError(f"{len(data) - start} bytes more than the header counts")
    return rows


def _past_lists(data: bytes, element: _Element, start: int) -> int:
    """Return where the rows of an element with lists end.

    Raises:
        ValueError: They lead out of the file.
    """
    for _ in range(element.count):
        for _, kind, length in element.fields:
            size = np.dtype(kind).itemsize
            if length is not None:
                size *= int(np.frombuffer(data, length, 1, start)[0])
                start += length.itemsize
            if size < 0 or start + size > len(data):
                raise ValueError(f"a list of {element.name} leads out of the file")
            start += size
    return start


def _text_rows(data: bytes, elements: list[_Element], start: int) -> dict[str, np.ndarray]:
    """Return rows of text; they are read block by block, as numbers of Python take many times their space.

    Raises:
        ValueError: There are fewer or more lines than the header counts, or one holds other numbers.
    """
    file = io.BytesIO(data)
    file.seek(start)
    lines, rows = iter(io.TextIOWrapper(file, "latin-1")), {}
    for element in elements:
        if element.plain:
            rows[element.name] = _parsed(lines, element)
        else:
            deque(islice(lines, element.count), maxlen=0)
    if more := sum(1 for line in lines if line.strip()):
        raise ValueError(f"{more} lines more than the header counts")
    return rows


def _parsed(lines: Iterator[str], element: _Element) -> np.ndarray:
    rows = np.empty(min(element.count, _BLOCK), element.kind)
    done = 0
    while done < element.count:
        block = [line.split() for line in islice(lines, min(_BLOCK, element.count - done))]
        if not block:
            raise ValueError(f"{done} of {element.count} rows of {element.name}")
        if done + len(block) > len(rows):
            rows = np.concatenate([rows, np.empty(min(len(rows), element.count - len(rows)), element.kind)])
        values = np.array(block, np.float64).reshape(len(block), len(element.fields))
        rows[done : done + len(block)] = np.array([tuple(row) for row in values.tolist()], element.kind)
        done += len(block)
    return rows
