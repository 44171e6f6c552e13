# SPDX-License-Identifier: Apache-2.0
"""JSON and TOML of strangers: an error in words, whatever stands there."""

import json
import os
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from graycard import DatasetError, RecordError
from graycard.io import parse_json, read_json, read_toml
from graycard.io._strict import DEEPEST, parse_toml
from graycard.lights import read_lights

texts = st.text(st.characters(exclude_categories=["Cs"]))
numbers = st.integers(-(2**63), 2**64 - 1) | st.floats(allow_nan=False, allow_infinity=False)
plain = st.recursive(
    st.none() | st.booleans() | numbers | texts,
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(texts, inner, max_size=4),
)


@given(plain)
def test_plain_json_comes_back(data: object):
    assert parse_json(json.dumps(data)) == data


def test_a_file_with_holes_is_not_read(tmp_path: Path):
    with open(tmp_path / "capture.json", "wb") as file:
        file.truncate(2**36)
    with pytest.raises(DatasetError, match="65536 MiB, more than 256"):
        read_json(tmp_path / "capture.json", DatasetError)


def test_more_lights_than_can_be_judged_are_refused(tmp_path: Path):
    (tmp_path / "lights.json").write_text(json.dumps([{}] * 40_000))
    with pytest.raises(DatasetError, match="at most 1024 lights"):
        read_lights(tmp_path / "lights.json")


HOSTILE = {
    "deep list": ("[" * 100_000, "nested"),
    "closed deep list": ("[" * 500 + "]" * 500, "nested"),
    "deep object": ('{"a":' * 50_000, "nested"),
    "twice": ('{"a": 1, "a": 2}', "'a' stands there twice"),
    "twice within": ('[{"a": {"b": 1, "b": 1}}]', "'b' stands there twice"),
    "long number": ("1" + "0" * 400, "beyond 64 bits"),
    "longer number": ("[" + "9" * 5000 + "]", "beyond 64 bits"),
    "wide number": (str(2**64), "beyond 64 bits"),
    "negative number": (str(-(2**63) - 1), "beyond 64 bits"),
    "large float": ("1e999", "beyond what a float holds"),
    "nan": ('{"a": NaN}', '"nan"'),
    "infinity": ("-Infinity", '"-inf"'),
    "half a character": ('["\\ud800"]', "surrogates not allowed"),
    "half a key": ('{"\\udc00": 1}', "surrogates not allowed"),
    "cut off": ('{"a": ', "Expecting value"),
}


@pytest.mark.parametrize("text", HOSTILE)
def test_hostile_json_is_an_error_in_words(tmp_path: Path, text: str):
    content, words = HOSTILE[text]
    (tmp_path / "x.json").write_text(content)
    with pytest.raises(DatasetError, match="expected JSON in .*x.json") as caught:
        read_json(tmp_path / "x.json", DatasetError)
    assert words in str(caught.value)
    assert len(str(caught.value)) < 500


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ("name = " + "[" * 2000 + "]" * 2000, "nested"),
        ("a = " + "1" * 400, "beyond 64 bits"),
        ("a = 1\na = 2", "overwrite"),
        ("a = '", "Unterminated|Expected"),
    ],
)
def test_hostile_toml_is_an_error_in_words(tmp_path: Path, content: str, words: str):
    (tmp_path / "x.toml").write_text(content)
    with pytest.raises(RecordError, match=f"expected TOML in .*x.toml.*({words})"):
        read_toml(tmp_path / "x.toml")


def test_bytes_that_are_no_text_and_missing_files_are_errors_in_words(tmp_path: Path):
    (tmp_path / "x.json").write_bytes(b"\xff{}")
    with pytest.raises(RecordError, match="no text in UTF-8"):
        read_json(tmp_path / "x.json")
    with pytest.raises(RecordError, match="expected a TOML file at .*none.toml"):
        read_toml(tmp_path / "none.toml")
    with pytest.raises(RecordError, match="Is a directory"):
        read_json(tmp_path)


@pytest.mark.parametrize("what", ["pipe", "device"])
def test_what_has_no_end_is_not_read(tmp_path: Path, what: str):
    path = tmp_path / "x.json"
    os.mkfifo(path) if what == "pipe" else path.symlink_to("/dev/zero")
    with pytest.raises(RecordError, match="expected a JSON file at .*x.json, got a pipe or a device"):
        read_json(path)


def test_nesting_is_allowed_up_to_a_depth():
    assert parse_json("[" * DEEPEST + "]" * DEEPEST) is not None
    with pytest.raises(ValueError, match="nested"):
        parse_json("[" * (DEEPEST + 2) + "]" * (DEEPEST + 2))
    assert parse_toml("a = inf")["a"] == float("inf")
