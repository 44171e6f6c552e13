# SPDX-License-Identifier: Apache-2.0
"""The fuzzer sees what it is to see: planted faults are found, and a case is made again from its number."""

import os
from collections.abc import Callable
from pathlib import Path
from random import Random

import pytest

from fuzzer.child import _judge
from fuzzer.kind import WrongWordsError, check_words, cli
from fuzzer.outcome import Outcome, Report, table
from fuzzer.structure import attack_json, json_text
from fuzzer.tree import seal
from fuzzer.watch import Watch
from graycard import DatasetError, GraycardError

WRITES: dict[str, Callable[[Path], object]] = {
    "a file": lambda root: (root / "x").write_text("x"),
    "a folder": lambda root: (root / "new").mkdir(),
    "a link": lambda root: (root / "new").symlink_to("nowhere"),
    "a removal": lambda root: (root / "there").unlink(),
    "through a link": lambda root: (root / "out" / "link" / "x").write_text("x"),
    "another name": lambda root: (root / "there").rename(root / "out" / "there"),
}


@pytest.fixture(scope="module")
def watch(tmp_path_factory: pytest.TempPathFactory) -> Watch:
    """One for all: a hook is never taken off again."""
    return Watch([tmp_path_factory.mktemp("allowed")])


@pytest.fixture
def root(tmp_path: Path) -> Path:
    for name in ("out", "outside"):
        (tmp_path / name).mkdir()
    (tmp_path / "there").write_text("x")
    (tmp_path / "out" / "link").symlink_to(tmp_path / "outside")
    return tmp_path


@pytest.mark.parametrize("what", WRITES)
def test_what_is_written_outside_is_seen_twice(watch: Watch, root: Path, what: str):
    """By the event, and by the listing, which sees what native code writes, too."""
    with watch.over(root, [root / "out"]) as written:
        WRITES[what](root)
    assert any(line.startswith(("open: ", "os.")) for line in written)
    assert any(line.startswith("changed: ") for line in written)


def test_what_is_written_inside_is_nobodys_business(watch: Watch, root: Path):
    with watch.over(root, [root / "out"]) as written:
        (root / "out" / "a").mkdir()
        (root / "out" / "a" / "x").write_text("x")
        (root / "there").read_text()
    assert written == []


def test_refusals_and_faults_are_told_apart():
    refused, fault, _ = _judge(DatasetError("expected this, got that"))
    assert (refused, fault) == (True, "")
    for error in (ValueError("x"), RecursionError(), KeyboardInterrupt(), SystemExit(1)):
        refused, fault, _ = _judge(error)
        assert not refused
        assert fault.startswith(type(error).__name__)
    assert "without words" in _judge(GraycardError(""))[1]


def test_the_command_line_is_held_to_its_promises(monkeypatch: pytest.MonkeyPatch):
    for words, code, said in (
        ("", 2, "exit code 2"),
        ("Traceback (most recent call last):\nE", 1, "traceback"),
        ("a\x1b[2J", 0, "raw control"),
    ):

        def run(_: object, words: str = words, code: int = code) -> int:
            print(words, end="")  # noqa: T201 - it stands for a verb
            return code

        monkeypatch.setattr("graycard.cli.main", run)
        with pytest.raises(WrongWordsError, match=said):
            cli("score")
    with pytest.raises(WrongWordsError, match="characters"):
        check_words("x" * 100_000)


def test_seed_and_number_make_a_case_again(tmp_path: Path):
    found = []
    for name in ("a", "b"):
        path = tmp_path / name / "x.json"
        path.parent.mkdir()
        path.write_text(
            json_text({"views": [{"name": "a", "size": [1, 2.5]}], "more": {"deep": [None, True]}})
        )
        said = [attack_json(Random(f"1/json/{number}"), path) for number in range(5)]
        found.append((said, path.read_bytes()))
    assert found[0] == found[1]


@pytest.mark.parametrize("change", ["pipe", "folder", "gone"])
def test_sealing_does_not_wait_for_a_manifest_that_is_none(tmp_path: Path, change: str):
    manifest = tmp_path / "manifest.json"
    (tmp_path / "there").write_text("x")
    if change == "pipe":
        os.mkfifo(manifest)
    elif change == "folder":
        manifest.mkdir()
    seal(tmp_path)
    assert not manifest.is_file()


def test_the_table_counts_tries_and_failures():
    report = Report(7)
    for number in range(3):
        report.add(Outcome("exr", number, fault="ValueError in x" if number else "", refused=not number))
    lines = table(report).splitlines()
    assert lines[0] == "seed 7"
    assert lines[2].split() == ["exr", "3", "1", "2", "0"]
    assert lines[4] == "2 x ValueError in x"
