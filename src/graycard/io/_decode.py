# SPDX-License-Identifier: Apache-2.0
"""Decode JSON data into dataclasses: msgspec checks types, this module keys, names and strings of numbers.

msgspec ignores keys that are no field of a dataclass, and knows no infinities in JSON. So data is prepared
first: every key is checked, names pass the check of their type (``graycard.io.Name`` and its like), and
``"inf"``, ``"-inf"`` and ``"nan"`` become floats where a float is expected.
"""

import dataclasses
import math
from collections.abc import Callable, Mapping, Sequence
from functools import cache, lru_cache, partial
from itertools import chain, repeat
from pathlib import Path
from types import NoneType, UnionType
from typing import Annotated, Any, NamedTuple, TypeVar, Union, get_args, get_origin, get_type_hints

import msgspec
import numpy as np

from graycard.io._names import TextRule

T = TypeVar("T")

IN_MEMORY: dict[str, Any] = {"in_memory": True}
"""Metadata of a dataclass field that is never written to disk."""

Prepare = Callable[[Any], Any]

_AS_IT_IS = frozenset({NoneType, bool, int, float})
"""Types of values that no preparation changes; most values of a record are of these."""
_KNOWN_TEXTS = 1 << 14
"""Texts of one type whose check is remembered: a record has the same names again and again."""
_NON_FINITE = {"inf": math.inf, "-inf": -math.inf, "nan": math.nan}


class RefusedError(ValueError):
    """A part of the data that is refused before msgspec sees it."""

    def __init__(self, words: str) -> None:
        super().__init__(words)
        self.path = ""
        """Place of the part, as in ``.scores[3]``."""


class UnknownKeyError(RefusedError):
    """A key that is no field of its dataclass."""

    def __init__(self, key: str, fields: Sequence[str]) -> None:
        super().__init__(f'can not match "{key}" to any field')
        self.key, self.fields = key, fields


def decode(cls: type[T], data: Any) -> T:
    """Return a dataclass made of JSON data.

    Raises:
        UnknownKeyError: A key is no field, or one that is never written.
        RefusedError: A text is none for its type, as a name that leaves its folder.
        msgspec.ValidationError: A key is missing, a value has another type, or a dataclass refuses it.
        TypeError: The dataclass has a field of a type that msgspec does not know.
    """
    return msgspec.convert(_prepare_record(cls, data), cls, dec_hook=_decode_other)


def stored_fields(cls: type[Any]) -> list[str]:
    """Return the names of the fields that are written to disk, in order."""
    return [f.name for f in dataclasses.fields(cls) if not f.metadata.get("in_memory")]


class _Record(NamedTuple):
    """Fields of a dataclass that may be in a file, and how to prepare those that need it."""

    names: list[str]
    keys: frozenset[str]
    """The same, to look them up."""
    prepared: list[tuple[str, Prepare]]


@cache
def _record_of(cls: type[Any]) -> _Record:
    kinds, names = get_type_hints(cls, include_extras=True), stored_fields(cls)
    prepared = [(name, p) for name in names if (p := _preparation(kinds[name])) is not None]
    return _Record(names, frozenset(names), prepared)


@cache
def _preparation(kind: Any) -> Prepare | None:
    """Return a function that makes data of a type ready for msgspec; None where it is ready as it is."""
    origin, args = get_origin(kind) or kind, get_args(kind)
    if origin is Annotated:
        rules = [rule for rule in args[1:] if isinstance(rule, TextRule)]
        known = [lru_cache(_KNOWN_TEXTS)(rule.check) for rule in rules[:1]]
        return partial(_prepare_text, known[0]) if known else _preparation(args[0])
    if isinstance(kind, type) and dataclasses.is_dataclass(kind):
        return partial(_prepare_record, kind)
    if kind is float:
        return _prepare_number
    if kind in (Any, object):
        return _prepare_anything
    if origin in (Union, UnionType):
        return _preparation_of_union(args)
    if isinstance(origin, type) and issubclass(origin, Mapping):
        keys, values = (_preparation(part) for part in args or (str, Any))
        return partial(_prepare_mapping, keys or _keep, values or _keep) if keys or values else None
    if isinstance(origin, type) and issubclass(origin, tuple | list | Sequence) and origin is not str:
        return _preparation_of_items([_preparation(item) for item in args if item is not ...])
    return None


def _preparation_of_items(every: list[Prepare | None]) -> Prepare | None:
    """Prepare items by their places; the last preparation is that of all further items."""
    if not any(every):
        return None
    return partial(_prepare_items, [prepare or _keep for prepare in every])


def _preparation_of_union(kinds: tuple[Any, ...]) -> Prepare | None:
    """Apply the preparation of every member in turn: each leaves alone what is not of its type."""
    if sum(map(dataclasses.is_dataclass, kinds)) > 1:
        return None  # msgspec refuses the type, and says so
    kinds = tuple(kind for kind in kinds if not (kind is float and str in kinds))
    every = [prepare for kind in kinds if (prepare := _preparation(kind)) is not None]
    return partial(_prepare_in_turn, every) if len(every) > 1 else next(iter(every), None)


def _prepare_in_turn(every: Sequence[Prepare], data: Any) -> Any:
    for prepare in every:
        data = prepare(data)
    return data


def _prepare_record(cls: type[Any], data: Any) -> Any:
    if not isinstance(data, Mapping):
        return data
    known = _record_of(cls)
    if not data.keys() <= known.keys:
        raise UnknownKeyError(min(data.keys() - known.keys, key=str), known.names)
    ready = dict(data)
    for name, prepare in known.prepared:
        if type(value := ready.get(name)) not in _AS_IT_IS:
            try:
                ready[name] = prepare(value)
            except RefusedError as error:
                error.path = f".{name}{error.path}"
                raise
    return ready


def _keep(value: Any) -> Any:
    return value


def _prepare_number(value: Any) -> Any:
    if type(value) is str:
        return _NON_FINITE.get(value, value)
    return float(value) if isinstance(value, float) else value  # a float64 of NumPy is no float to msgspec


def _prepare_mapping(prepare_key: Prepare, prepare: Prepare, data: Any) -> Any:
    if not isinstance(data, Mapping):
        return data
    ready = {}
    for key, value in data.items():
        try:
            ready[prepare_key(key)] = value if type(value) in _AS_IT_IS else prepare(value)
        except RefusedError as error:
            error.path = f"[{key!r}]{error.path}"
            raise
    return ready


def _prepare_text(check: Callable[[str], str], value: Any) -> Any:
    if type(value) is not str:
        return value
    try:
        return check(value)
    except ValueError as cause:
        raise RefusedError(str(cause)) from cause


def _prepare_items(every: Sequence[Prepare], data: Any) -> Any:
    if not isinstance(data, list | tuple):
        return data
    ready: list[Any] = []
    try:
        for prepare, value in zip(chain(every, repeat(every[-1])), data, strict=False):
            ready.append(value if type(value) in _AS_IT_IS else prepare(value))
    except RefusedError as error:
        error.path = f"[{len(ready)}]{error.path}"
        raise
    return ready


def _prepare_anything(value: Any) -> Any:
    """Return untyped data with tuples for its lists, as frozen dataclasses have them."""
    match value:
        case dict():
            return {key: _prepare_anything(item) for key, item in value.items()}
        case list() | tuple():
            return tuple(_prepare_anything(item) for item in value)
        case _:
            return value


def _decode_other(kind: type[Any], value: Any) -> Any:
    """Decode the types that msgspec does not know."""
    if kind is np.ndarray:
        return np.asarray(value, dtype=np.float64)
    if kind is Path and isinstance(value, str | Path):
        return Path(value)
    raise ValueError(f"expected {'a path' if kind is Path else kind.__name__}, got {value!r}")
