# SPDX-License-Identifier: Apache-2.0
"""Dataclasses to JSON and strictly back: an unknown or misspelt key is an error."""

import dataclasses
import json
import math
from collections.abc import Callable, Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any, TypeVar

import msgspec
import numpy as np

from graycard._errors import GraycardError, NewerRecordError, RecordError
from graycard.io._decode import decode, stored_fields
from graycard.io._explain import explain
from graycard.io._files import decode_text, read_bytes, write_bytes
from graycard.io._strict import parse_json, parse_toml

T = TypeVar("T")
LONGEST_TEXT = 2**28
"""Bytes that a JSON or TOML file may have: a record of the largest run has some 10 MiB."""


def to_builtins(value: Any) -> Any:
    """Return plain JSON data of dataclasses, arrays and containers.

    Non-finite numbers become the strings ``"inf"``, ``"-inf"`` and ``"nan"``, since JSON has none.
    """
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return {name: to_builtins(getattr(value, name)) for name in stored_fields(type(value))}
    match value:
        case Mapping():
            return {str(k): to_builtins(v) for k, v in value.items()}
        case np.ndarray() | np.generic():
            return to_builtins(value.tolist())
        case float() if not math.isfinite(value):
            return str(value)
        case Path():
            return value.as_posix()
        case str():
            return value
        case Sequence():
            return [to_builtins(v) for v in value]
        case _:
            return value


def from_builtins(cls: type[T], data: Any, error: type[GraycardError] = RecordError, source: str = "") -> T:
    """Return a dataclass made of JSON data; every key must be a field and every value of its type.

    A field may be a number, a text, a ``Literal``, an array, a path, another dataclass, or a tuple, mapping
    or union of these; a union may hold one dataclass. ``"inf"``, ``"-inf"`` and ``"nan"`` are numbers.
    Lists of a field of any type become tuples.

    Args:
        cls: A dataclass.
        data: As :func:`to_builtins` gives it, read back from JSON or TOML.
        error: Error to raise.
        source: Place of the data, for the message.

    Raises:
        RecordError: (or ``error``) A key is unknown or missing, a value has another type, or is refused by
            the dataclass.
    """
    try:
        return decode(cls, data)
    except (msgspec.ValidationError, ValueError, TypeError) as cause:
        where = f" in {source}" if source else ""
        expected = f"expected a {cls.__name__} with {', '.join(stored_fields(cls))}{where}"
        raise error(f"{expected}, got: {explain(cls, data, cause)}") from cause


def dumps(value: Any) -> str:
    """Return JSON text of ``value``: sorted by field, two spaces, one newline at the end."""
    return _text(value, "\n") + "\n"


def _text(value: Any, margin: str) -> str:
    """Return JSON text of a value whose last line begins with ``margin``, a line break and spaces.

    With an indent Python's encoder is slower than this by far, even without a copy as plain data before.
    """
    kind = type(value)
    if plain := _PLAIN.get(kind):
        return plain(value)
    if dataclasses.is_dataclass(kind):
        fields = [f"{key}{_text(getattr(value, name), margin + '  ')}" for name, key in _keys(kind)]
        return _enclosed("{", fields, "}", margin)
    match value:
        case Mapping():
            items = {str(key): item for key, item in value.items()}
            pairs = [f"{_quoted(key)}: {_text(item, margin + '  ')}" for key, item in items.items()]
            return _enclosed("{", pairs, "}", margin)
        case Sequence() if not isinstance(value, str):
            return _enclosed("[", [_text(item, margin + "  ") for item in value], "]", margin)
        case np.ndarray() | np.generic():
            return _text(value.tolist(), margin)
        case _:
            return json.dumps(to_builtins(value), allow_nan=False, ensure_ascii=False)


def _enclosed(begin: str, items: Sequence[str], end: str, margin: str) -> str:
    """Return items a line each."""
    inner = f"{margin}  "
    return f"{begin}{inner}{f',{inner}'.join(items)}{margin}{end}" if items else begin + end


@cache
def _keys(cls: type[Any]) -> list[tuple[str, str]]:
    """Return the stored fields of a dataclass, as names and as keys of JSON."""
    return [(name, f"{_quoted(name)}: ") for name in stored_fields(cls)]


def _float_text(value: float) -> str:
    return repr(value) if math.isfinite(value) else f'"{value}"'


_quoted = json.encoder.encode_basestring
_PLAIN: dict[type[Any], Callable[[Any], str]] = {
    str: _quoted,
    float: _float_text,
    int: repr,
    bool: lambda value: "true" if value else "false",
    type(None): lambda value: "null",
}
"""Texts of values that hold no others."""


def write_json(path: Path, value: Any) -> None:
    """Write ``value`` as JSON, whole or not at all.

    Raises:
        OutputError: The folder cannot be written to, or the disk is full.
    """
    write_bytes(Path(path), dumps(value).encode())


def check_version(data: Any, newest: int, path: Path, error: type[GraycardError] = NewerRecordError) -> None:
    """Refuse a newer format before its unknown keys are called misspelt.

    Raises:
        NewerRecordError: (or ``error``) ``format_version`` is newer than ``newest``.
    """
    version = data.get("format_version", newest) if isinstance(data, dict) else newest
    if isinstance(version, int) and version > newest:
        raise error(
            f"expected format version {newest} or older in {path}, got version {version}. "
            "Install a newer graycard"
        )


def read_json(path: Path, error: type[GraycardError] = RecordError) -> Any:
    """Return the data in a JSON file.

    Raises:
        RecordError: (or ``error``) There is no such file, or it is not JSON.
    """
    return _read(path, "JSON", parse_json, error)


def read_toml(path: Path, error: type[GraycardError] = RecordError) -> dict[str, Any]:
    """Return the data in a TOML file.

    Raises:
        RecordError: (or ``error``) There is no such file, or it is not TOML.
    """
    return _read(path, "TOML", parse_toml, error)


def read_text(path: Path, kind: str, error: type[GraycardError] = RecordError) -> str:
    """Return the text of a file.

    Args:
        path: The file.
        kind: Kind of text, for messages, as ``JSON``.
        error: What is raised.

    Raises:
        RecordError: (or ``error``) There is no such file, it is too large, or it is no text.
    """
    try:
        return decode_text(read_bytes(Path(path), LONGEST_TEXT))
    except OSError as cause:
        raise error(f"expected a {kind} file at {path}, got {cause.strerror or cause}") from cause
    except ValueError as cause:
        raise error(f"expected {kind} in {path}, got what is no text in UTF-8: {cause}") from cause


def _read(path: Path, kind: str, parse: Callable[[str], Any], error: type[GraycardError]) -> Any:
    text = read_text(path, kind, error)
    try:
        return parse(text)
    except ValueError as cause:
        raise error(f"expected {kind} in {path}, got text that breaks off or is none: {cause}") from cause
