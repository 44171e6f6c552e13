# SPDX-License-Identifier: Apache-2.0
"""Say in plain words why JSON data was refused: where, what was expected, and what came."""

import dataclasses
import re
from collections.abc import Iterable, Mapping
from difflib import get_close_matches
from types import UnionType
from typing import Any, Literal, Union, get_args, get_origin, get_type_hints

import msgspec

from graycard.io._decode import RefusedError, UnknownKeyError

_PLACE = re.compile(r"(?P<words>.*) - at (?:`key` in )?`\$(?P<path>[^`]*)`", re.DOTALL)
"""Message as msgspec ends its messages: ``Expected `float`, got `str` - at `$.scores[3].value` ``."""
_STEP = re.compile(r"\.(?P<name>\w+)|\[(?P<index>\d+)\]|\[(?P<any>\.\.\.)\]")
_WORDS = {
    "float": "a number",
    "int": "a whole number",
    "str": "a text",
    "bool": "true or false",
    "null": "null",
    "array": "a list",
    "object": "an object",
}
_UNKNOWN = object()
"""Stands for a value that msgspec does not name: it leaves out the key of a mapping."""


def explain(cls: type[Any], data: Any, cause: Exception) -> str:
    """Return why ``data`` is no ``cls``, in one line, with the place and a name that was probably meant."""
    if isinstance(cause, UnknownKeyError):
        return f"{cause}{_at(cause.path)}{_nearest(cause.key, cause.fields)}"
    if isinstance(cause, RefusedError):
        return f"{cause}{_at(cause.path)}"
    if not isinstance(cause, msgspec.ValidationError):
        return str(cause)
    placed = _PLACE.fullmatch(str(cause))
    words, path = (placed["words"], placed["path"]) if placed else (str(cause), "")
    return _translate(words, path, *_look(cls, data, path))


def _translate(words: str, path: str, kind: Any, value: Any) -> str:
    """Return a message of msgspec in plain words; that of a dataclass stays as it is."""
    if missing := re.fullmatch(r"Object missing required field `(\w+)`", words):
        return f'missing value for field "{missing[1]}"{_at(path)}'
    if words.startswith("Invalid enum value"):
        return _choice(kind, words.removeprefix("Invalid enum value "), path)
    if mistaken := re.fullmatch(r"Expected `([^`]+)`, got `([^`]+)`", words):
        found = _WORDS.get(mistaken[2], mistaken[2]) if value is _UNKNOWN else _short(value)
        return f"expected {_plain(mistaken[1])}, got {found}{_at(path)}"
    plain = re.sub(r"^Expected `([^`]+)`", lambda found: f"expected {_plain(found[1])}", words)
    return f"{plain}{_at(path)}"


def _at(path: str) -> str:
    place = path.removeprefix(".").replace("...", "…")
    return f" at {place}" if place else ""


def _nearest(name: str, known: Iterable[Any]) -> str:
    near = get_close_matches(str(name), [str(k) for k in known], n=1)
    return f" (did you mean {near[0]!r}?)" if near else ""


def _plain(names: str) -> str:
    return " or ".join(_WORDS.get(name, name) for name in names.split(" | "))


def _short(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= 60 else f"{text[:57]}..."


def _choice(kind: Any, got: str, path: str) -> str:
    """Name the values that a field may have."""
    literal = next((part for part in (kind, *get_args(kind)) if get_origin(part) is Literal), None)
    choices = get_args(literal)
    known = " or ".join(repr(choice) for choice in choices) or "a known value"
    return f"expected {known}, got {got}{_at(path)}{_nearest(got.strip(chr(39)), choices)}"


def _look(kind: Any, value: Any, path: str) -> tuple[Any, Any]:
    """Return the type that is expected at a path of msgspec, and the value that is there."""
    for step in _STEP.finditer(path):
        kind, value = _inner(kind, step), _value_at(value, step)
    return kind, value


def _value_at(value: Any, step: re.Match[str]) -> Any:
    try:
        return value[step["name"] or int(step["index"])]
    except (KeyError, IndexError, TypeError):  # int(None) too: the key of a mapping is not known
        return _UNKNOWN


def _inner(kind: Any, step: re.Match[str]) -> Any:
    """Return the type of a field, of the values of a mapping or of the items of a list; None for others."""
    for part in get_args(kind) if get_origin(kind) in (Union, UnionType) else (kind,):
        origin, args = get_origin(part), get_args(part)
        if step["name"] and dataclasses.is_dataclass(part):
            return get_type_hints(part).get(step["name"])
        if step["any"] and isinstance(origin, type) and issubclass(origin, Mapping):
            return args[1]
        if step["index"] and args and origin is not Literal:
            return args[min(int(step["index"]), len([a for a in args if a is not ...]) - 1)]
    return None
