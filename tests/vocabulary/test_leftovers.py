# SPDX-License-Identifier: Apache-2.0
"""Leftovers of killed processes are removed; a file that a process still writes stays, however old."""

import os
import shutil
import signal
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from graycard.io import (
    atomic_folder,
    atomic_path,
    file_lock,
    remove_leftovers,
    temporary_folder,
    writable_folder,
    write_bytes,
)
from graycard.io._hold import remove_unheld

BEGIN = """
import sys, time
from pathlib import Path
from graycard.io import atomic_folder, atomic_path, file_lock, temporary_folder
root = Path({root!r})
with (
    atomic_path(root / "deep" / "scores.json") as partial,
    atomic_folder(root / "published") as folder,
    file_lock(root / "deep" / ".corridor-0001.lock", print),
    file_lock(root / "deep" / ".lock", print),
    temporary_folder() as temporary,
):
    partial.write_text("half")
    (folder / "run.json").write_text("half")
    (temporary / "capture").mkdir()
    print("begun", flush=True)
    time.sleep(60)
"""


def below(root: Path) -> set[str]:
    return {path.relative_to(root).as_posix() for path in root.rglob("*")}


@contextmanager
def writing(root: Path) -> Iterator[subprocess.Popen[str]]:
    """Let another process write and hold whatever can be left behind."""
    environment = {**os.environ, "TMPDIR": str(root / "tmp")}
    (root / "tmp").mkdir(parents=True, exist_ok=True)
    command = [sys.executable, "-c", BEGIN.format(root=str(root))]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=environment) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "begun\n"
        try:
            yield process
        finally:
            process.kill()


def test_what_a_process_writes_stays_and_what_it_leaves_goes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with writing(tmp_path) as process:
        before = below(tmp_path)
        for path in tmp_path.rglob("*"):
            os.utime(path, (0, 0))  # age says nothing
        assert len([name for name in before if name.endswith((".partial", ".lock"))]) == 4
        assert remove_leftovers(tmp_path) == []
        assert below(tmp_path) == before
        process.send_signal(signal.SIGKILL)
        process.wait()
        assert below(tmp_path) == before, "a kill leaves all of it"
        assert len(remove_leftovers(tmp_path)) == 4
        assert {name for name in below(tmp_path) if "held" not in name} == {"deep", "tmp"}
        monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "tmp"))
        with temporary_folder() as folder:
            assert os.listdir(tmp_path / "tmp") == [folder.name], "that of the killed process is gone"
        assert os.listdir(tmp_path / "tmp") == []


def test_two_processes_do_not_take_each_other_for_dead(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "tmp"))
    with writing(tmp_path), temporary_folder(), atomic_path(tmp_path / "mine.json") as mine:
        with file_lock(tmp_path / ".mine.lock", print):
            assert remove_leftovers(tmp_path) == []
            assert (tmp_path / ".mine.lock").is_file()
        assert len(os.listdir(tmp_path / "tmp")) == 2
        mine.write_bytes(b"whole")
    assert (tmp_path / "mine.json").read_bytes() == b"whole"


@pytest.mark.skipif(sys.platform == "win32", reason="nothing can be held there")
def test_a_folder_that_is_taken_for_left_over_before_it_is_held_is_made_anew(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    made, make = [], tempfile.mkdtemp

    def make_and_lose(**options: str) -> str:
        made.append(make(**options))
        if len(made) == 1:
            assert remove_unheld(Path(made[0]), shutil.rmtree), "as another process does"
        return made[-1]

    monkeypatch.setattr(tempfile, "mkdtemp", make_and_lose)
    with temporary_folder() as folder:
        assert folder.is_dir()
    assert len(made) == 2


def test_what_is_not_graycards_stays(tmp_path: Path) -> None:
    """A name alone does not do, and neither does a link to what bears one."""
    kept = [".a.partial", "b.x1y2z3a4.partial", ".c.X1Y2Z3A4.partial", ".poetry.lock", "uv.lock", ".d.json"]
    for name in kept:
        (tmp_path / name).write_text("of somebody else")
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    (elsewhere / "kept").write_text("of somebody else")
    (tmp_path / ".link.x1y2z3a4.partial").symlink_to(elsewhere)
    (tmp_path / "linked").symlink_to(elsewhere)
    os.mkfifo(tmp_path / ".pipe.x1y2z3a4.partial")
    before = below(tmp_path)
    assert remove_leftovers(tmp_path) == []
    assert below(tmp_path) == before


def test_what_older_versions_left_goes(tmp_path: Path) -> None:
    names = [".graycard-write-test.ab12cd34.partial", ".graycard-write-test", ".lock", ".corridor-0001.lock"]
    for name in names:
        (tmp_path / name).write_text("process 12 on host" if name.endswith("lock") else "x")
    assert len(remove_leftovers(tmp_path)) == 4
    assert below(tmp_path) == set()
    assert remove_leftovers(tmp_path / "none") == []


def test_a_folder_that_was_half_written_goes_with_the_next_one(tmp_path: Path) -> None:
    with writing(tmp_path) as process:
        process.kill()
    half = {name for name in below(tmp_path) if name.startswith(".published.")}
    assert half
    with atomic_folder(tmp_path / "published") as folder:
        (folder / "run.json").write_text("whole")
    assert not half & below(tmp_path)
    assert (tmp_path / "published" / "run.json").read_text() == "whole"


def test_a_folder_is_proved_writable_without_a_trace(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    seen: list[list[str]] = []
    monkeypatch.setattr(os, "fsync", lambda handle: seen.append(os.listdir(tmp_path)))
    writable_folder(tmp_path)
    assert seen == [[]], "at no time is there a name that a kill could leave"


def test_a_file_that_another_takes_for_left_over_is_made_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Between its making and its holding nobody can tell that a file is in use."""
    made = tempfile.mkstemp
    taken: list[str] = []

    def taken_at_once(*args: object, **kwargs: object) -> tuple[int, str]:
        handle, name = made(*args, **kwargs)  # pyright: ignore
        if not taken:
            assert len(remove_leftovers(tmp_path)) == 1
            taken.append(name)
        return handle, name

    monkeypatch.setattr(tempfile, "mkstemp", taken_at_once)
    write_bytes(tmp_path / "a.txt", b"whole")
    assert taken
    assert os.listdir(tmp_path) == ["a.txt"]


FORK = """
import os, signal
from pathlib import Path
from graycard.io import atomic_path
with atomic_path(Path({path!r})) as partial:
    child = os.fork()
    if child == 0:
        os.close(1)
        signal.pause()
    partial.write_bytes(b"x")
print(child)
"""


def test_a_child_does_not_hold_what_its_parent_writes(tmp_path: Path) -> None:
    """Else a fork that outlives its parent would keep what that one has left."""
    path, left = tmp_path / "a.txt", tmp_path / ".a.txt.x1y2z3a4.partial"
    command = [sys.executable, "-c", FORK.format(path=str(path))]
    child = int(subprocess.run(command, check=True, stdout=subprocess.PIPE, timeout=60).stdout)
    try:
        os.link(path, left)
        assert remove_leftovers(tmp_path) == [left]
    finally:
        os.kill(child, signal.SIGKILL)
