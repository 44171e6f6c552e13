# SPDX-License-Identifier: Apache-2.0
"""Parse JSON and TOML from strangers: whatever is no plain data of a sensible size is a ValueError.

The parsers of Python's library follow nesting until the stack ends, take the last of two equal keys, make
whole numbers of any length, and read ``NaN``, ``1e999`` and halves of characters, which no text can hold.
"""

import json
import math
import tomllib
from collections.abc import Sequence
from typing import Any

DEEPEST = 100
"""Levels of nesting that data may have; graycard's own has fewer than 20."""
_NESTED = frozenset({dict, list})
_LEAST, _MOST = -(2**63), 2**64 - 1
"""Range of whole numbers that arrays can hold."""


def parse_json(text: str) -> Any:
    """Return the data of a JSON text.

    Raises:
        ValueError: It is no JSON, two keys of an object are equal, a number is not finite or beyond 64 bits,
            a character is half of one, or the nesting is too deep.
    """
    halves = "\\u" in text  # of characters: other texts that can be written as UTF-8 have none
    text.encode()
    try:
        data = json.loads(
            text,
            object_pairs_hook=_distinct,
            parse_int=_whole_number,
            parse_float=_finite_number,
            parse_constant=_refuse_constant,
        )
    except RecursionError as cause:
        raise ValueError(_too_deep()) from cause
    return _checked(data, values=halves)


def parse_toml(text: str) -> dict[str, Any]:
    """Return the data of a TOML text.

    Raises:
        ValueError: As for :func:`parse_json`; ``inf`` and ``nan`` are numbers in TOML.
    """
    try:
        data = tomllib.loads(text)
    except RecursionError as cause:
        raise ValueError(_too_deep()) from cause
    return _checked(data)


def _distinct(pairs: Sequence[tuple[str, Any]]) -> dict[str, Any]:
    found = dict(pairs)
    if len(found) < len(pairs):
        known: set[str] = set()
        double = next(key for key, _ in pairs if key in known or known.add(key))
        raise ValueError(f"the key {double!a} stands there twice")
    return found


def _whole_number(digits: str) -> int:
    if len(digits) > 20 or not _LEAST <= int(digits) <= _MOST:
        raise ValueError(f"the number {digits[:20]}… is beyond 64 bits")
    return int(digits)


def _finite_number(digits: str) -> float:
    if not math.isfinite(value := float(digits)):
        raise ValueError(f"the number {digits[:20]} is beyond what a float holds")
    return value


def _refuse_constant(name: str) -> Any:
    raise ValueError(f'{name} is no number of JSON; write "{name.lower().replace("infinity", "inf")}"')


def _checked(data: Any, *, values: bool = True) -> Any:
    """Return data whose depth is sensible, and if ``values`` is true its whole numbers and texts as well.

    It goes level by level, as calls for each value would take longer than parsing.
    """
    level, depth = [data], 0
    while level:
        if depth > DEEPEST:
            raise ValueError(_too_deep())
        if values:
            for value in level:
                _check_value(value)
        within = [value for value in level if type(value) in _NESTED]
        level = [item for value in within for item in (value.values() if type(value) is dict else value)]
        depth += 1
    return data


def _check_value(value: Any) -> None:
    """Refuse a text that is none, or a whole number that is too large; of an object look at the keys."""
    match value:
        case str():
            if not value.isascii():
                value.encode()  # a lone half of a surrogate pair raises UnicodeEncodeError, a ValueError
        case bool():
            pass
        case int() if not _LEAST <= value <= _MOST:
            raise ValueError(f"the number {str(value)[:20]}… is beyond 64 bits")
        case dict():
            for key in value:
                _check_value(key)


def _too_deep() -> str:
    return f"it is nested more than {DEEPEST} levels deep"
