# SPDX-License-Identifier: Apache-2.0
"""Change JSON and TOML by their structure: values, keys, types, nesting, and what no writer would write."""

import json
import tomllib
from collections.abc import Callable
from copy import deepcopy
from pathlib import Path
from random import Random
from typing import Any

from fuzzer.hostile import NUMBERS, TEXTS, Raw, hostile_value
from fuzzer.plain import attack_bytes


class Obj(list[list[Any]]):
    """An object as pairs of key and value, which may have a key twice."""


def attack_json(rng: Random, path: Path) -> str:
    """Change a part of a JSON file, or its bytes."""
    return _attack(rng, path, lambda text: json.loads(text, object_pairs_hook=_obj_of_pairs), json_text)


def attack_toml(rng: Random, path: Path) -> str:
    """Change a part of a TOML file, or its bytes; tables come back on one line each."""
    return _attack(rng, path, lambda text: _obj(tomllib.loads(text)), _toml_document)


def attack_json_text(rng: Random, text: str) -> str:
    """Return a JSON text of which a part is changed."""
    data = json.loads(text, object_pairs_hook=_obj_of_pairs)
    data, _ = _changed(rng, data)
    return json_text(data)


def json_text(value: Any) -> str:
    """Return JSON as it stands, with raw parts and double keys."""
    match value:
        case Raw():
            return value
        case Obj():
            return "{" + ", ".join(f"{_key(key)}: {json_text(item)}" for key, item in value) + "}"
        case dict():
            return json_text(_obj(value))
        case list():
            return "[" + ", ".join(map(json_text, value)) + "]"
        case _:
            return json.dumps(value, ensure_ascii=False)


def _key(key: str) -> str:
    return key if isinstance(key, Raw) and key.startswith('"') else json.dumps(key, ensure_ascii=False)


def _attack(rng: Random, path: Path, read: Callable[[str], Any], write: Callable[[Any], str]) -> str:
    if rng.random() < 0.15:
        return attack_bytes(rng, path)
    try:
        data = read(path.read_text(encoding="utf-8"))
    except (ValueError, RecursionError):
        return attack_bytes(rng, path)
    data, words = _changed(rng, data)
    path.write_bytes(write(data).encode("utf-8", "surrogatepass"))
    return f"{words} of {path.name}"


def _changed(rng: Random, data: Any) -> tuple[Any, str]:
    """Return data with one change, and what it was."""
    root = [data]
    place, where = _walk(rng, root)
    name = rng.choice(list(_CHANGES))
    _CHANGES[name](rng, place, root)
    return root[0], f"{name} at {where or 'the top'}"


Place = tuple[Any, int]
"""A list and an index of it: an item of an array, or the pair of a key and a value."""


def _walk(rng: Random, root: list[Any]) -> tuple[Place, str]:
    """Return a place, shallow ones above all, and the way to it."""
    place, names = (root, 0), []
    while True:
        value = _value(place)
        if not isinstance(value, list) or not value or rng.random() < (0.05 if len(names) < 2 else 0.2):
            return place, ".".join(names)
        at = rng.randrange(len(value))
        names.append(str(value[at][0])[:30] if isinstance(value, Obj) else str(at))
        place = value, at


def _value(place: Place) -> Any:
    holder, at = place
    return holder[at][1] if isinstance(holder, Obj) else holder[at]


def _put(place: Place, value: Any) -> None:
    holder, at = place
    if isinstance(holder, Obj):
        holder[at] = [holder[at][0], value]
    else:
        holder[at] = value


def _replace(rng: Random, place: Place, root: list[Any]) -> None:
    _put(place, hostile_value(rng))


def _of_its_type(rng: Random, place: Place, root: list[Any]) -> None:
    """Put a hostile value of the type that is expected: it passes checks of types."""
    match _value(place):
        case str():
            _put(place, rng.choice(TEXTS))
        case int() | float():
            _put(place, rng.choice(NUMBERS))
        case Obj() | list() as value:
            _put(place, type(value)(value[: rng.randrange(len(value) + 1)]))
        case _:
            _put(place, hostile_value(rng))


def _nudge(rng: Random, place: Place, root: list[Any]) -> None:
    match _value(place):
        case str() as text:
            _put(
                place,
                rng.choice((text.upper(), text + "/", f"../{text}", text[:-1], text * 2, f"{text}\u202e")),
            )
        case bool() as value:
            _put(place, not value)
        case int() | float() as number:
            _put(
                place,
                rng.choice((-number, number + 1, number * 1000, number * 1e30, float(number), str(number))),
            )
        case value:
            _put(place, [value])


def _delete(rng: Random, place: Place, root: list[Any]) -> None:
    holder, at = place
    if holder is not root:
        del holder[at]


def _double(rng: Random, place: Place, root: list[Any]) -> None:
    holder, at = place
    if holder is not root:
        holder[at:at] = [holder[at]] * rng.choice((1, 1, 2, 200))


def _rename(rng: Random, place: Place, root: list[Any]) -> None:
    holder, at = place
    if isinstance(holder, Obj):
        holder[at] = [rng.choice(TEXTS), holder[at][1]]
    else:
        _put(place, rng.choice(TEXTS))


def _swap(rng: Random, place: Place, root: list[Any]) -> None:
    other, _ = _walk(rng, root)
    one, two = deepcopy((_value(place), _value(other)))  # copies: one may hold the other
    if place[0] is not root and other[0] is not root and len(json_text(one)) + len(json_text(two)) < 10_000:
        _put(place, two)
        _put(other, one)


def _copy(rng: Random, place: Place, root: list[Any]) -> None:
    other, _ = _walk(rng, root)
    found = deepcopy(_value(other))
    if place[0] is not root and len(json_text(found)) < 10_000:
        _put(place, found)


def _extra(rng: Random, place: Place, root: list[Any]) -> None:
    value = _value(place)
    if isinstance(value, Obj):
        value.append([rng.choice(TEXTS), hostile_value(rng)])
    elif isinstance(value, list):
        value.append(hostile_value(rng))
    else:
        _put(place, {"value": value})


_CHANGES: dict[str, Callable[[Random, Place, list[Any]], None]] = {
    "replace": _replace,
    "replace by its like": _of_its_type,
    "replace by its like ": _of_its_type,
    "nudge": _nudge,
    "delete": _delete,
    "double": _double,
    "rename": _rename,
    "swap": _swap,
    "copy": _copy,
    "add": _extra,
}


def _obj_of_pairs(pairs: list[tuple[str, Any]]) -> Obj:
    return Obj([key, value] for key, value in pairs)


def _obj(value: Any) -> Any:
    match value:
        case dict():
            return Obj([key, _obj(item)] for key, item in value.items())
        case list():
            return [_obj(item) for item in value]
        case _:
            return value


def _toml_document(data: Any) -> str:
    if not isinstance(data, Obj):
        return _toml(data)
    return "\n".join(f"{json.dumps(key)} = {_toml(value)}" for key, value in data) + "\n"


def _toml(value: Any) -> str:
    match value:
        case Raw():
            return value
        case Obj() | dict():
            pairs = value if isinstance(value, Obj) else value.items()
            return "{" + ", ".join(f"{json.dumps(key)} = {_toml(item)}" for key, item in pairs) + "}"
        case list():
            return "[" + ", ".join(map(_toml, value)) + "]"
        case str():
            return json.dumps(value)
        case None:
            return '""'
        case bool() | int() | float():
            return str(value).lower()
        case _:
            return str(value)  # a date
