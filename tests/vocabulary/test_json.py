# SPDX-License-Identifier: Apache-2.0
import dataclasses
import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from types import UnionType
from typing import Annotated, Any, Literal, Union, get_args, get_origin, get_type_hints

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from graycard import GraycardError, MethodError, RecordError, UnknownNameError
from graycard.io import AnyPlace, FolderBelow, Label, Name, RelativePath, dumps, from_builtins, to_builtins
from graycard.io._decode import IN_MEMORY
from graycard.lights import (
    GaussianLight,
    Light,
    PointLight,
    RectangleLight,
    SphereLight,
    SphericalGaussian,
    SpotLight,
    light_from_json,
    light_to_json,
)
from graycard.records import Comparison, Ledger, RunRecord, ScoreSheet, Size

Kind = Literal["soft", "hard"]


@dataclass(frozen=True, slots=True)
class Part:
    size: float
    kind: Kind = "soft"
    shares: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if self.size < 0:
            raise ValueError(f"expected a size of 0 or more, got {self.size}")
        if self.shares and "all" not in self.shares:
            raise UnknownNameError("share", "all", self.shares)


@dataclass(frozen=True, slots=True, eq=False)
class Whole:
    """One field of every type that a record may have."""

    name: str
    parts: tuple[Part, ...] = ()
    spare: Part | None = None
    by_name: Mapping[str, Part] = field(default_factory=dict)
    count: int = 0
    ready: bool = False
    corner: tuple[float, float, float] | None = None
    mixed: tuple[str, float] = ("", 0.0)
    choice: Kind | None = None
    either: int | str = 0
    labelled: float | str = 0.0
    anything: Any = None
    pose: np.ndarray | None = None
    folder: Path | None = None
    root: Path | None = field(default=None, metadata=IN_MEMORY)


JSON_VALUES = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False, allow_infinity=False) | st.text(),
    lambda inner: (
        st.lists(inner, max_size=3).map(tuple) | st.dictionaries(st.text(max_size=3), inner, max_size=3)
    ),
    max_leaves=5,
)
"""Untyped values as records hold them: tuples for lists, and no infinities, which come back as text."""

NAMED: dict[Any, st.SearchStrategy[Any]] = {
    kind: st.sampled_from(["a", "Süd 1", "test_000"])
    for kind in (AnyPlace, FolderBelow, Label, Name, RelativePath)
}
PLAIN: dict[Any, st.SearchStrategy[Any]] = {
    float: st.floats(allow_nan=False),
    int: st.integers(),
    str: st.text(max_size=8),
    bool: st.booleans(),
    type(None): st.none(),
    Any: JSON_VALUES,
}

BOUNDED: dict[Any, st.SearchStrategy[Any]] = {
    Size: st.builds(
        Size,
        width=st.none() | st.integers(4),
        train_views=st.none() | st.integers(2),
        surfels=st.floats(0, exclude_min=True, allow_infinity=False),
    ),
}
"""Records that refuse some values of their fields' types."""


def values_of(kind: Any) -> st.SearchStrategy[Any]:
    """Draw values of a field's type."""
    origin, args = get_origin(kind), get_args(kind)
    if origin is Annotated:
        return NAMED[kind]
    if kind in BOUNDED:
        return BOUNDED[kind]
    if isinstance(kind, type) and dataclasses.is_dataclass(kind):
        hints = get_type_hints(kind, include_extras=True)
        return st.builds(
            kind, **{f.name: values_of(hints[f.name]) for f in dataclasses.fields(kind) if f.init}
        )
    if origin is Literal:
        return st.sampled_from(args)
    if origin in (Union, UnionType):
        return st.one_of(*map(values_of, args))
    if origin is tuple:
        many = args[-1] is ...
        return (
            st.lists(values_of(args[0]), max_size=2).map(tuple) if many else st.tuples(*map(values_of, args))
        )
    if origin is Mapping:
        return st.dictionaries(values_of(args[0]), values_of(args[1]), max_size=2)
    return PLAIN[kind]


@pytest.mark.parametrize("cls", [ScoreSheet, RunRecord, Comparison, Ledger])
@given(data=st.data())
@settings(max_examples=30, deadline=None)
def test_records_survive_json(cls: type[Any], data: st.DataObject):
    record = data.draw(values_of(cls))
    assert from_builtins(cls, json.loads(dumps(record))) == record


numbers = st.floats(0, 1e6)
vectors = st.tuples(numbers, numbers, numbers)
frames: st.SearchStrategy[Literal["world", "camera"]] = st.sampled_from(["world", "camera"])
lobes = st.builds(SphericalGaussian, st.just((0.0, 0.0, 1.0)), numbers, vectors)
names = NAMED[Label]
lights = st.one_of(
    st.builds(PointLight, names, vectors, vectors, frames),
    st.builds(SpotLight, names, vectors, vectors, vectors, st.floats(0, 90), st.floats(90, 180), frames),
    st.builds(GaussianLight, names, vectors, st.lists(lobes, min_size=1, max_size=3).map(tuple), frames),
    st.builds(RectangleLight, names, vectors, vectors, vectors, vectors),
    st.builds(SphereLight, names, vectors, st.floats(1e-3, 9), vectors),
)


@given(light=lights)
@settings(deadline=None)
def test_lights_survive_json(light: Light):
    assert light_from_json(json.loads(dumps(light_to_json(light)))) == light


def test_every_type_is_read_back():
    part = Part(math.inf, "hard", {"all": -math.inf})
    whole = Whole(
        "w", (part, Part(0.5)), part, {"a": part}, 3, True, (1.0, math.inf, 2.0), ("inf", -math.inf), "hard",
        "inf", "nan", {"a": [1, [2, "inf"]]}, np.eye(2), Path("a/b"),
    )  # fmt: skip
    back = from_builtins(Whole, json.loads(dumps(whole)))
    for name in (
        "name",
        "parts",
        "spare",
        "by_name",
        "count",
        "ready",
        "corner",
        "mixed",
        "choice",
        "either",
    ):
        assert getattr(back, name) == getattr(whole, name), name
    assert (back.labelled, back.folder) == ("nan", Path("a/b")), "text stays text where text is allowed"
    assert back.anything == {"a": (1, (2, "inf"))}, "untyped lists become tuples, untyped text stays text"
    assert back.pose is not None
    assert np.array_equal(back.pose, np.eye(2))
    assert back.pose.dtype == np.float64


def test_numbers_that_are_not_finite():
    found = [from_builtins(Part, {"size": size}).size for size in ("inf", math.inf, 1, np.float64(2), "nan")]
    assert found[:4] == [math.inf, math.inf, 1.0, 2.0]
    assert math.isnan(found[4])
    assert [type(size) for size in found] == [float] * 5


def test_what_is_a_dataclass_already_is_kept():
    part = Part(1.0)
    assert from_builtins(Whole, {"name": "w", "parts": (part,), "spare": part}).parts[0] is part


def test_data_is_left_as_it_was():
    data = {"name": "w", "parts": [{"size": "inf"}], "anything": [1, [2]]}
    before = json.dumps(data)
    from_builtins(Whole, data)
    assert json.dumps(data) == before


BAD: list[tuple[dict[str, Any], str]] = [
    ({"nmae": 1}, "can not match \"nmae\" to any field (did you mean 'name'?)"),
    ({"parts": [{"size": 1}, {"sise": 1}]},
     "can not match \"sise\" to any field at parts[1] (did you mean 'size'?)"),
    ({"by_name": {"a b": {"x": 1}}}, "can not match \"x\" to any field at by_name['a b']"),
    ({"spare": {"kind": "soft"}}, 'missing value for field "size" at spare'),
    ({"name": None}, "expected a text, got None at name"),
    ({"name": 3}, "expected a text, got 3 at name"),
    ({"count": True}, "expected a whole number, got True at count"),
    ({"count": 1.0}, "expected a whole number, got 1.0 at count"),
    ({"count": "1"}, "expected a whole number, got '1' at count"),
    ({"ready": 1}, "expected true or false, got 1 at ready"),
    ({"parts": {"size": 1}}, "expected a list, got {'size': 1} at parts"),
    ({"parts": "soft"}, "expected a list, got 'soft' at parts"),
    ({"parts": [{"size": 1}, 4]}, "expected an object, got 4 at parts[1]"),
    ({"parts": [{"size": "1"}]}, "expected a number, got '1' at parts[0].size"),
    ({"parts": [{"size": "Infinity"}]}, "expected a number, got 'Infinity' at parts[0].size"),
    ({"parts": [{"size": False}]}, "expected a number, got False at parts[0].size"),
    ({"parts": [{"size": -1}]}, "expected a size of 0 or more, got -1.0 at parts[0]"),
    ({"parts": [{"size": 1, "kind": "sotf"}]},
     "expected 'soft' or 'hard', got 'sotf' at parts[0].kind (did you mean 'soft'?)"),
    ({"parts": [{"size": 1, "shares": {"all": "x"}}]}, "expected a number, got a text at parts[0].shares[…]"),
    ({"parts": [{"size": 1, "shares": [1]}]}, "expected an object, got [1] at parts[0].shares"),
    ({"choice": 1}, "expected a text or null, got 1 at choice"),
    ({"choice": "firm"}, "expected 'soft' or 'hard', got 'firm' at choice"),
    ({"corner": [1, 2]}, "expected a list of length 3, got 2 at corner"),
    ({"corner": [1, 2, None]}, "expected a number, got None at corner[2]"),
    ({"mixed": ["a", "b"]}, "expected a number, got 'b' at mixed[1]"),
    ({"mixed": ["a", 1, 2]}, "expected a list of length 2, got 3 at mixed"),
    ({"either": 1.5}, "expected a whole number or a text, got 1.5 at either"),
    ({"spare": [1] * 99}, f"expected an object or null, got {str([1] * 99)[:57]}... at spare"),
    ({"pose": [[1, "x"]]}, "could not convert string to float: 'x' at pose"),
    ({"folder": 3}, "expected a path, got 3 at folder"),
    ({"root": "/"}, 'can not match "root" to any field'),
]  # fmt: skip


@pytest.mark.parametrize(("changes", "message"), BAD, ids=[message for _, message in BAD])
def test_bad_data_is_refused_in_plain_words(changes: dict[str, Any], message: str):
    with pytest.raises(RecordError) as refused:
        from_builtins(Whole, {"name": "w"} | changes, source="a.json")
    start, _, reason = str(refused.value).partition(", got: ")
    assert reason == message
    assert start.startswith("expected a Whole with name, parts, spare, ")
    assert start.endswith(", folder in a.json")


@pytest.mark.parametrize("data", [[], None, "text", 3])
def test_what_is_no_object_is_refused(data: Any):
    with pytest.raises(
        MethodError, match=r"expected a Part with size, kind, shares, got: expected an object"
    ):
        from_builtins(Part, data, MethodError)


def test_an_error_of_graycard_comes_through_as_it_is():
    with pytest.raises(UnknownNameError, match="expected a share that exists, got 'all'"):
        from_builtins(Whole, {"name": "w", "spare": {"size": 1, "shares": {"al": 1}}})


def test_a_type_that_cannot_be_read_is_refused_not_guessed():
    @dataclass
    class Torn:
        value: Part | Whole

    with pytest.raises(GraycardError, match="more than one"):
        from_builtins(Torn, {"value": {"size": 1}})


values = (
    st.none()
    | st.booleans()
    | st.integers()
    | st.floats()
    | st.text(st.characters(exclude_categories=["Cs"]))
)
values |= st.floats(width=32).map(np.float32) | st.just(Path("a/b")) | st.builds(Part, st.floats(0, 9))
nested = st.recursive(
    values,
    lambda inner: (
        st.lists(inner, max_size=4)
        | st.lists(inner, max_size=3).map(tuple)
        | st.dictionaries(st.text(max_size=3) | st.integers(), inner, max_size=4)
        | st.lists(st.floats(), max_size=3).map(np.array)
    ),
)


@given(nested)
def test_the_text_is_that_of_the_standard_encoder(data: object):
    assert dumps(data) == json.dumps(to_builtins(data), indent=2, allow_nan=False, ensure_ascii=False) + "\n"
