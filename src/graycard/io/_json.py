# SPDX-License-Identifier: Apache-2.0
"""Dataclasses to JSON and strictly back: an unknown or misspelt key is an error."""

import dataclasses
import json
import math
from collections.abc import Mapping, Sequence
from difflib import get_close_matches
from pathlib import Path
from typing import Any, TypeVar

import dacite
import numpy as np

from graycard._errors import GraycardError, RecordError
from graycard.io._files import write_bytes

T = TypeVar("T")

IN_MEMORY: dict[str, Any] = {"in_memory": True}
"""Metadata of a dataclass field that is never written to disk."""

_NON_FINITE = {"inf": math.inf, "-inf": -math.inf, "nan": math.nan}


def to_builtins(value: Any) -> Any:
    """Plain JSON data from dataclasses, arrays and containers.

    Non-finite numbers become the strings ``"inf"``, ``"-inf"`` and ``"nan"``, since JSON has none.
    """
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        kept = (f.name for f in dataclasses.fields(value) if not f.metadata.get("in_memory"))
        return {name: to_builtins(getattr(value, name)) for name in kept}
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
    """A dataclass from JSON data; every key must be a field and every value of its type.

    Raises:
        RecordError: (or ``error``) A key is unknown or missing, or a value has another type.
    """
    hooks = {float: decode_float, int: _integer, np.ndarray: _array, Path: Path}
    config = dacite.Config(strict=True, strict_unions_match=True, type_hooks=hooks)
    every = dataclasses.fields(cls)  # pyright: ignore[reportArgumentType]
    fields = [f.name for f in every if not f.metadata.get("in_memory")]
    try:
        if isinstance(data, dict) and (surplus := data.keys() & {f.name for f in every} - set(fields)):
            raise dacite.UnexpectedDataError(surplus)
        return dacite.from_dict(cls, _tuples(data), config)  # pyright: ignore[reportArgumentType]
    except (dacite.DaciteError, ValueError, TypeError, AttributeError) as cause:
        where = f" in {source}" if source else ""
        words = f"expected a {cls.__name__} with {', '.join(fields)}{where}, got: {cause}"
        raise error(words + _nearest(cause, fields)) from cause


def _nearest(cause: Exception, fields: list[str]) -> str:
    """What a misspelt key was probably meant to be."""
    unknown = sorted(cause.keys) if isinstance(cause, dacite.UnexpectedDataError) else []
    near = [match for key in unknown for match in get_close_matches(str(key), fields, n=1)]
    return f" (did you mean {near[0]!r}?)" if near else ""


def decode_float(value: Any) -> float:
    """A float from a JSON number or one of ``"inf"``, ``"-inf"``, ``"nan"``."""
    if isinstance(value, str) and value in _NON_FINITE:
        return _NON_FINITE[value]
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise ValueError(f"expected a number, got {value!r}")
    return float(value)


def dumps(value: Any) -> str:
    """JSON text of ``value``: sorted by field, two spaces, one newline at the end."""
    return json.dumps(to_builtins(value), indent=2, allow_nan=False, ensure_ascii=False) + "\n"


def write_json(path: Path, value: Any) -> None:
    """Write ``value`` as JSON, whole or not at all.

    Raises:
        OutputError: The folder cannot be written to, or the disk is full.
    """
    write_bytes(Path(path), dumps(value).encode())


def check_version(data: Any, newest: int, path: Path, error: type[GraycardError] = RecordError) -> None:
    """Meet a newer format before its unknown keys are called misspelt.

    Raises:
        RecordError: (or ``error``) ``format_version`` is newer than ``newest``.
    """
    version = data.get("format_version", newest) if isinstance(data, dict) else newest
    if isinstance(version, int) and version > newest:
        raise error(
            f"expected format version {newest} or older in {path}, got version {version}. "
            "Install a newer graycard"
        )


def read_json(path: Path, error: type[GraycardError] = RecordError) -> Any:
    """The data in a JSON file.

    Raises:
        RecordError: (or ``error``) There is no such file, or it is not JSON.
    """
    try:
        return json.loads(Path(path).read_text(encoding="utf-8"))
    except OSError as cause:
        raise error(f"expected a JSON file at {path}, got {cause.strerror or cause}") from cause
    except ValueError as cause:
        raise error(f"expected JSON in {path}, got text that breaks off or is none: {cause}") from cause


def _tuples(value: Any) -> Any:
    """JSON data with tuples for its lists, as frozen dataclasses have them; a string stays a string."""
    match value:
        case dict():
            return {key: _tuples(item) for key, item in value.items()}
        case list():
            return tuple(_tuples(item) for item in value)
        case _:
            return value


def _array(value: Any) -> np.ndarray:
    return np.asarray(value, dtype=np.float64)


def _integer(value: Any) -> int:
    """An int from a JSON number; ``true`` is an int to Python only."""
    if isinstance(value, bool) or not isinstance(value, int):
        raise ValueError(f"expected a whole number, got {value!r}")
    return value
