# SPDX-License-Identifier: Apache-2.0
"""PLY files of any program: text, little and big endian, lists before or after what is looked for."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from graycard._errors import DatasetError
from graycard.io import read_bytes

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
_FORMATS = {"binary_little_endian": "<", "binary_big_endian": ">", "ascii": ""}
_LONGEST_HEADER = 2**16
_MARK = b"\xef\xbb\xbf"


@dataclass(slots=True)
class _Element:
    """One kind of rows, as the header names it."""

    name: str
    count: int
    fields: list[tuple[str, str, str]]
    """Name, type, and type of the length for a list, else an empty one."""

    @property
    def plain(self) -> bool:
        """Whether it has no lists."""
        return not any(length for _, _, length in self.fields)

    def kind(self, order: str) -> np.dtype:
        """Return the type of a row without lists."""
        return np.dtype([(name, order + kind) for name, kind, _ in self.fields])


def read_ply(path: Path) -> dict[str, np.ndarray]:
    """Return the elements of a PLY file that have no lists, by name, as structured arrays.

    Raises:
        DatasetError: The file is missing, cut off, or none.
    """
    try:
        data = read_bytes(path)
    except OSError as cause:
        raise DatasetError(f"expected points at {path}, got {cause.strerror or cause}") from cause
    data = data.removeprefix(_MARK)
    end = data.find(b"end_header", 0, _LONGEST_HEADER)
    start = data.find(b"\n", end) + 1
    if not data.startswith(b"ply") or end < 0 or start == 0:
        raise DatasetError(f"expected a PLY file at {path}, got one without its header")
    lines = [line.split() for line in data[:end].decode("latin-1").splitlines()]
    order = next((_FORMATS.get(f[1]) for f in lines if f[:1] == ["format"] and len(f) > 1), None)
    if order is None:
        raise DatasetError(f"expected a text or a binary PLY at {path}, got another kind")
    try:
        elements = _elements(lines)
        return _binary(data[start:], elements, order) if order else _text(data[start:], elements)
    except (ValueError, KeyError, IndexError, OverflowError, MemoryError) as cause:
        raise DatasetError(f"expected a whole PLY at {path}, got one cut off or damaged: {cause}") from cause


def _elements(lines: list[list[str]]) -> list[_Element]:
    found: list[_Element] = []
    for fields in lines:
        if fields[:1] == ["element"]:
            if (count := int(fields[2])) < 0:
                raise ValueError(f"{count} rows of {fields[1]}")
            found.append(_Element(fields[1], count, []))
        elif fields[:2] == ["property", "list"]:
            found[-1].fields.append((fields[4], _TYPES[fields[3]], _TYPES[fields[2]]))
        elif fields[:1] == ["property"]:
            found[-1].fields.append((fields[2], _TYPES[fields[1]], ""))
    return found


def _binary(data: bytes, elements: list[_Element], order: str) -> dict[str, np.ndarray]:
    rows, start = {}, 0
    last = max((i for i, e in enumerate(elements) if e.plain), default=-1)
    for element in elements[: last + 1]:
        if element.plain:
            kind = element.kind(order)
            rows[element.name] = np.frombuffer(data, kind, element.count, start)
            start += element.count * kind.itemsize
        else:
            start = _past_lists(data, element, order, start)
    return rows


def _past_lists(data: bytes, element: _Element, order: str, start: int) -> int:
    """Return where rows with lists end."""
    for _ in range(element.count):
        for _, kind, length in element.fields:
            size = np.dtype(kind).itemsize
            if length:
                step = np.dtype(order + length)
                size *= int(np.frombuffer(data, step, 1, start)[0])
                start += step.itemsize
            if size < 0 or start + size > len(data):
                raise ValueError(f"a list of {element.name} leads out of the file")
            start += size
    return start


def _text(data: bytes, elements: list[_Element]) -> dict[str, np.ndarray]:
    lines, rows, start = data.decode("latin-1").splitlines(), {}, 0
    for element in elements:
        part = lines[start : start + element.count]
        if len(part) < element.count:
            raise ValueError(f"{len(part)} of {element.count} rows of {element.name}")
        start += element.count
        if element.plain:
            numbers = [tuple(float(x) for x in line.split()) for line in part]
            rows[element.name] = np.array(numbers, dtype=element.kind("<"))
    return rows
