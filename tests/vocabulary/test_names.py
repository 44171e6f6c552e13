# SPDX-License-Identifier: Apache-2.0
"""Names and paths that files give: good ones pass, and no other one becomes a path."""

import dataclasses
import importlib
import inspect
import re
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, get_args, get_origin, get_type_hints

import pytest
from hypothesis import given
from hypothesis import strategies as st

from graycard import DatasetError, OutputError, RecordError
from graycard.io import check_distinct, check_label, check_name, inside, printable
from graycard.io._names import TextRule, check_relative_path
from graycard.records import Job, JobResult, job_folder
from house import modules

GOOD = ["test_000", "a", "Lampe Süd", "view.left-1", "日本", "x" * 200]
BAD = [
    "", ".", "..", "../a", "a/../b", "/abs", "a\\b", "C:", "c:x", "a\0", "a\nb", "a\x1b[2J", "a\u202eb",
    "a\u200bb", ".hidden", " a", "a ", "a.",
    "con", "NUL.exr", "com1", "a.partial", "a|b", "x" * 201, "ü" * 101, "\ud800",
]  # fmt: skip


@pytest.mark.parametrize("name", GOOD)
def test_good_names_pass(name: str, tmp_path: Path):
    assert check_name(name) == check_relative_path(name) == name
    assert inside(tmp_path, f"views/{name}").parent == tmp_path / "views"


@pytest.mark.parametrize("name", BAD)
def test_bad_names_are_refused(name: str, tmp_path: Path):
    with pytest.raises(ValueError, match="expected a (name|path)"):
        check_name(name)
    for path in (name, f"views/{name}", f"{name}/x.exr"):
        with pytest.raises(OutputError, match="Rename it"):
            inside(tmp_path, path)


@given(st.text(max_size=30))
def test_whatever_passes_stays_inside(text: str):
    root = Path("/nowhere/root")
    try:
        path = inside(root, text)
    except OutputError:
        return
    assert root in path.resolve().parents
    assert printable(text) == text


@given(st.text(max_size=30))
def test_printable_texts_hold_no_control_character_and_are_left_alone(text: str):
    shown = printable(text)
    assert printable(shown) == shown
    assert not re.search(r"[\x00-\x08\x0b-\x1f\x7f-\x9f\u202a-\u202e\u2066-\u2069]", shown)


@pytest.mark.parametrize("folder", ["", ".", "jobs/dark/a"])
def test_a_job_lies_in_its_run(tmp_path: Path, folder: str):
    result = JobResult(Job("dark", "s", "m", 0, {}), "", folder, "done")
    assert job_folder(tmp_path, result) == tmp_path / folder
    for bad in ("..", "../x", "/tmp", "./x"):
        with pytest.raises(RecordError, match="expected a path that stays in its folder"):
            job_folder(tmp_path, replace(result, folder=bad))


def test_labels_may_hold_what_files_may_not():
    assert check_label("mine: w/o light?") == "mine: w/o light?"
    with pytest.raises(ValueError, match="control characters"):
        check_label("a\x07")


@pytest.mark.parametrize("what", ["folder", "file", "dangling"])
def test_links_out_of_a_root_are_refused(tmp_path: Path, what: str):
    root, outside = tmp_path / "root", tmp_path / "outside"
    root.mkdir()
    outside.mkdir()
    (outside / "x.exr").write_bytes(b"secret")
    if what == "folder":
        (root / "views").symlink_to(outside)
    else:
        (root / "views").mkdir()
        (root / "views" / "x.exr").symlink_to(outside / ("x.exr" if what == "file" else "new.exr"))
    with pytest.raises(DatasetError, match="expected views/x.exr to lie in"):
        inside(root, "views", "x.exr", error=DatasetError)


def test_links_in_a_circle_are_refused(tmp_path: Path):
    (tmp_path / "views").symlink_to("views")
    with pytest.raises(DatasetError, match="expected views/x.exr to lie in .*, got a link to itself"):
        inside(tmp_path, "views", "x.exr", error=DatasetError)


def test_a_message_of_any_length_can_be_read():
    words = str(DatasetError(f"expected a name, got {'x' * 100_000}. Rename it"))
    assert len(words) < 5000
    assert words.startswith("expected a name")
    assert words.endswith("Rename it")


def test_a_root_may_be_a_link_and_hold_links_of_its_own(tmp_path: Path):
    (tmp_path / "real" / "views").mkdir(parents=True)
    (tmp_path / "real" / "again").symlink_to(tmp_path / "real" / "views")
    (tmp_path / "root").symlink_to(tmp_path / "real")
    assert inside(tmp_path / "root", "again", "x.exr") == tmp_path / "root" / "again" / "x.exr"


@pytest.mark.parametrize("names", [("a", "A"), ("straße", "STRASSE"), ("é", "e\u0301"), ("a", "a")])
def test_names_of_one_file_are_not_distinct(names: tuple[str, str]):
    with pytest.raises(ValueError, match="different files"):
        check_distinct(names)


FREE = {
    "Ledger.suite": "empty for tables that need no run, and only compared",
    "LedgerEntry.suite": "the same",
    "PriorSpec.path": "where a user's own weights are, from the command line or a suite of theirs",
    "Command.folder": "where a user's own code is, from the command line or a suite of theirs",
    "SuiteMethod.folder": "the same",
}
"""Fields that are no checked type, each with why."""
_READ = re.compile(
    r"graycard\.(records|edits|lights|predictions|_sensor|_capture|_truth|io\._manifest|synth\._spec|"
    r"benchmarks\.(_suites|_ranges|gates\._(gate|history)))\b"
)
"""Modules with records that are read from files."""
_WORDS = re.compile(r"(^|_)(name|track|scene|view|family|image|folder|file|files|path|row|rows|suite)$")


def _dataclasses() -> list[type[Any]]:
    content = [vars(importlib.import_module(name)) for name in modules() if _READ.match(name)]
    classes = {c for names in content for c in names.values() if inspect.isclass(c)}
    return [c for c in classes if dataclasses.is_dataclass(c) and c.__module__.startswith("graycard.")]


def _plain_text(kind: Any) -> bool:
    """Return true if a type holds texts that no rule checks."""
    if get_origin(kind) is Annotated:
        return not any(isinstance(part, TextRule) for part in get_args(kind)[1:])
    return kind is str or any(_plain_text(part) for part in get_args(kind)[:1])


def test_every_name_in_a_record_is_of_a_checked_type():
    unchecked = [
        f"{cls.__name__}.{field.name}"
        for cls in _dataclasses()
        for hints in [get_type_hints(cls, include_extras=True)]
        for field in dataclasses.fields(cls)
        if _WORDS.search(field.name) and _plain_text(hints[field.name])
    ]
    assert set(unchecked) == FREE.keys()
