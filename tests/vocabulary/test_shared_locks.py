# SPDX-License-Identifier: Apache-2.0
"""Locks and leftovers on file systems that several machines share, and on those without locks."""

import errno
import fcntl
import multiprocessing
import os
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from graycard import OutputError
from graycard.io import (
    _leftovers,
    _lock,
    await_file,
    file_lock,
    lock_words,
    remove_leftovers,
    silent,
    temporary_folder,
)
from graycard.io._hold import remove_unheld
from graycard.io.sharing import _marks, _systems
from graycard.io.sharing._marks import read_sign
from graycard.processes import run_all
from worker_jobs import wait_for

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="has no flock to stand in for")


@pytest.fixture
def shared(monkeypatch: pytest.MonkeyPatch) -> None:
    """Take every file system for one that machines share."""
    monkeypatch.setenv(_systems.LOCKS, "files")


def refuse(number: int) -> Callable[..., None]:
    def flock(descriptor: int, operation: int) -> None:
        raise OSError(number, os.strerror(number))

    return flock


@pytest.mark.parametrize("number", [errno.ENOLCK, errno.EOPNOTSUPP, errno.ENOSYS])
def test_a_file_system_without_locks_is_told_of_and_locked_by_files(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, number: int
) -> None:
    monkeypatch.setattr(fcntl, "flock", refuse(number))
    assert "locks of the kernel do not hold" in lock_words(tmp_path)
    heard: list[str] = []
    with file_lock(tmp_path / ".lock", heard.append):
        sign = read_sign(tmp_path / ".lock")
    assert sign is not None
    assert sign.words.startswith(f"process {os.getpid()} on ")
    assert heard == []
    assert [*tmp_path.iterdir()] == []


def test_a_file_system_with_locks_is_not_told_of(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(_systems.LOCKS, "kernel")
    assert lock_words(tmp_path) == ""


@pytest.mark.parametrize("value", ["file", "nfs", "1"])
def test_no_other_kind_of_lock_can_be_asked_for(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, value: str
) -> None:
    """A misspelt one would mean locks of the kernel, which exclude nobody on NFS."""
    monkeypatch.setenv(_systems.LOCKS, value)
    words = f"expected GRAYCARD_LOCKS to be files or kernel, got '{value}'"
    with pytest.raises(OutputError, match=words), file_lock(tmp_path / ".lock", lambda who: None):
        pass


def add_one(folder: str, times: int) -> None:
    """Add to a number in a file, in the lock, as often as is said."""
    path = Path(folder) / "number"
    for _ in range(times):
        with file_lock(Path(folder) / ".lock", lambda who: None):
            number = int(path.read_text())
            time.sleep(0.002)
            path.write_text(str(number + 1))


def test_processes_exclude_each_other_where_flock_lets_all_in(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, shared: None
) -> None:
    """On NFS with ``local_lock`` each machine has locks of its own: ``flock`` succeeds for all."""
    monkeypatch.setattr(_marks, "_LOOK_S", 0.01)
    monkeypatch.setattr(fcntl, "flock", lambda *_: None)
    (tmp_path / "number").write_text("0")
    fork = multiprocessing.get_context("fork")
    counters = [fork.Process(target=add_one, args=(str(tmp_path), 20)) for _ in range(3)]
    for counter in counters:
        counter.start()
    for counter in counters:
        counter.join()
    assert (tmp_path / "number").read_text() == "60"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["number"]


def test_who_waits_says_for_whom(tmp_path: Path, shared: None) -> None:
    first, second = run_all(wait_for, [(str(tmp_path), 60.0)] * 2, 2, silent)
    (words,) = first.value or second.value
    assert words.startswith("process ")


def hold_and_name(path: Path, words: str, held: threading.Event, told: threading.Event) -> None:
    """Hold a lock file, write its holder's name late, and let go once somebody was told of it."""
    with path.open("w") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        held.set()
        time.sleep(0.2)
        file.write(words)
        file.flush()
        told.wait(60)
        path.unlink()


@pytest.mark.parametrize("kind", ["kernel", "files"])
@pytest.mark.parametrize(
    ("words", "given_s", "said"), [("process 7 on b", 60.0, "process 7 on b"), ("", 0.1, "another process")]
)
def test_a_new_holder_is_given_time_to_write_its_name(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, kind: str, words: str, given_s: float, said: str
) -> None:
    monkeypatch.setenv(_systems.LOCKS, kind)
    monkeypatch.setattr(_marks, "_LOOK_S", 0.01)
    for module in (_lock, _marks):
        monkeypatch.setattr(module, "NAMED_S", given_s)
    heard: list[str] = []
    held, told = threading.Event(), threading.Event()
    path = tmp_path / ".lock"
    holder = threading.Thread(target=hold_and_name, args=(path, words, held, told))
    holder.start()
    assert held.wait(60)

    def hear(who: str) -> None:
        heard.append(who)
        told.set()

    with file_lock(path, hear):
        holder.join()
    assert heard == [said]


HOLD = """
import sys, time
from pathlib import Path
from graycard.io import file_lock
with file_lock(Path(sys.argv[1]), print):
    print("held", flush=True)
    time.sleep(60)
"""


def killed_holder(path: Path) -> None:
    """Let a process die that holds a lock."""
    with subprocess.Popen([sys.executable, "-c", HOLD, str(path)], stdout=subprocess.PIPE) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == b"held\n"
        process.kill()


def test_the_lock_of_a_process_of_this_machine_that_died_is_free_at_once(
    tmp_path: Path, shared: None
) -> None:
    killed_holder(tmp_path / ".lock")
    assert (tmp_path / ".lock").exists()
    start, heard = time.monotonic(), []
    with file_lock(tmp_path / ".lock", heard.append):
        assert time.monotonic() - start < _marks.DEAD_S / 2
    assert heard == []
    assert [*tmp_path.iterdir()] == []


def of_another_machine(path: Path) -> None:
    path.write_text("process 12 on node7\nanother-boot pid:[1] 12 345\nabc")


def test_that_of_another_machine_when_it_gives_no_sign_of_life(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, shared: None
) -> None:
    monkeypatch.setattr(_marks, "DEAD_S", 1.0)
    of_another_machine(tmp_path / ".lock")
    start, heard = time.monotonic(), []
    with file_lock(tmp_path / ".lock", heard.append):
        waited = time.monotonic() - start
    assert waited > 1.0
    assert heard == ["process 12 on node7"]
    assert [*tmp_path.iterdir()] == []


def test_a_holder_gives_signs_of_life(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, shared: None) -> None:
    monkeypatch.setattr(_marks, "BEAT_S", 0.05)
    with file_lock(tmp_path / ".lock", print):
        first = read_sign(tmp_path / ".lock")
        until = time.monotonic() + 30
        while read_sign(tmp_path / ".lock") == first:
            assert time.monotonic() < until
            time.sleep(0.05)


def test_who_lost_its_lock_leaves_that_of_the_next(tmp_path: Path, shared: None) -> None:
    with file_lock(tmp_path / ".lock", print):
        of_another_machine(tmp_path / ".lock")
    assert (tmp_path / ".lock").read_text().startswith("process 12 on node7")


def test_a_lock_that_was_taken_meanwhile_is_put_back(tmp_path: Path) -> None:
    """Two wait for a dead holder; the second must not set aside the lock of the first."""
    of_another_machine(tmp_path / ".lock")
    dead = read_sign(tmp_path / ".lock")
    assert dead is not None
    (tmp_path / ".lock").write_text("process 13 on node8\nanother-boot pid:[1] 13 345\ndef")
    _marks.set_aside(tmp_path / ".lock", dead)
    assert (tmp_path / ".lock").read_text().startswith("process 13 on node8")
    assert [path.name for path in tmp_path.iterdir()] == [".lock"]


@pytest.mark.parametrize("missing", ["link", "reading"])
def test_a_live_lock_is_put_back_whatever_fails(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, missing: str
) -> None:
    of_another_machine(tmp_path / ".lock")
    dead = read_sign(tmp_path / ".lock")
    assert dead is not None
    (tmp_path / ".lock").write_text("process 13 on node8\nanother-boot pid:[1] 13 345\ndef")
    if missing == "link":
        monkeypatch.setattr(os, "link", refuse_call)
    else:
        monkeypatch.setattr(_marks, "read_sign", refuse_call)
    _marks.set_aside(tmp_path / ".lock", dead)
    assert (tmp_path / ".lock").read_text().startswith("process 13 on node8")
    assert [path.name for path in tmp_path.iterdir()] == [".lock"]


def test_what_another_machine_may_still_write_is_not_left_over(tmp_path: Path, shared: None) -> None:
    young, old = tmp_path / ".a.exr.abcdefgh.partial", tmp_path / ".b.exr.abcdefgh.partial"
    folder = tmp_path / ".run.abcdefgh.partial"
    for path in (young, old):
        path.touch()
    folder.mkdir()
    os.utime(old, (0, time.time() - 2 * 3600))
    assert remove_leftovers(tmp_path) == [old]
    assert not remove_unheld(young, os.unlink)
    assert sorted(path.name for path in tmp_path.iterdir()) == [young.name, folder.name]


def test_nor_is_its_lock_but_that_of_a_dead_process_of_this_one_is(tmp_path: Path, shared: None) -> None:
    of_another_machine(tmp_path / ".lock")
    killed_holder(tmp_path / ".a.lock")
    assert remove_leftovers(tmp_path) == [tmp_path / ".a.lock"]
    with file_lock(tmp_path / ".b.lock", print):
        assert remove_leftovers(tmp_path) == []


def of_a_dead_process_here(path: Path) -> None:
    """Write the lock of a process of this machine that is gone."""
    boot, space = _marks.process_space()
    path.write_text(f"process 1 on here\n{boot} {space} 1 another-start\nabc")


def refuse_call(*_: object, **__: object) -> None:
    raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))


def test_a_lock_that_is_no_file_is_told_of_at_once(tmp_path: Path, shared: None) -> None:
    (tmp_path / "folder.lock").mkdir()
    (tmp_path / "link.lock").symlink_to(tmp_path / "nowhere")
    for name in ("folder.lock", "link.lock"):
        with pytest.raises(OutputError, match=name), file_lock(tmp_path / name, print):
            pass


def test_a_lock_that_may_not_be_read_is_told_of_at_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, shared: None
) -> None:
    of_another_machine(tmp_path / ".lock")
    opened = os.open

    def open_own(path: str | Path, flags: int, *rest: int) -> int:
        if not flags & os.O_CREAT and Path(path).name == ".lock":
            refuse_call()
        return opened(path, flags, *rest)

    monkeypatch.setattr(os, "open", open_own)
    with (
        pytest.raises(OutputError, match=r"\.lock \(Permission denied\)"),
        file_lock(tmp_path / ".lock", print),
    ):
        pass
    assert remove_leftovers(tmp_path) == []


def test_a_dead_lock_that_cannot_be_removed_is_told_of_at_once_and_stays(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, shared: None
) -> None:
    """It is another user's, in a folder where this one may not write."""
    of_a_dead_process_here(tmp_path / ".lock")
    monkeypatch.setattr(os, "rename", refuse_call)
    with pytest.raises(OutputError, match="Permission denied"), file_lock(tmp_path / ".lock", print):
        pass
    assert remove_leftovers(tmp_path) == []
    monkeypatch.undo()
    assert remove_leftovers(tmp_path) == [tmp_path / ".lock"]


def test_a_folder_is_in_use_while_anything_in_it_changes(tmp_path: Path, shared: None) -> None:
    folder = tmp_path / ".run.abcdefgh.partial"
    (folder / "views").mkdir(parents=True)
    (folder / "views" / "0.exr").touch()
    long_ago = time.time() - 2 * 3600
    for old in (folder / "views", folder):
        os.utime(old, (0, long_ago))
    assert remove_leftovers(tmp_path) == []
    os.utime(folder / "views" / "0.exr", (0, long_ago))
    assert remove_leftovers(tmp_path) == [folder]


def test_a_temporary_folder_gives_signs_of_life(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, shared: None
) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    monkeypatch.setattr(_leftovers, "BEAT_S", 0.05)
    with temporary_folder() as folder:
        os.utime(folder, (0, 0))
        until = time.monotonic() + 30
        while folder.stat().st_mtime == 0:
            assert time.monotonic() < until
            time.sleep(0.05)
        with temporary_folder() as other:
            assert folder.exists()
    assert not other.exists()
    assert not folder.exists()


MOUNTS = r"""
22 28 0:21 / /proc rw - proc proc rw
28 1 254:0 / / rw - ext4 /dev/vda rw
40 28 0:50 / /home/a\040b rw - nfs4 server:/home rw,local_lock=all
41 28 0:51 / /scratch rw - lustre mds:/scratch rw
42 41 0:52 / /scratch/tmp rw - tmpfs tmpfs rw
"""
KINDS = {
    "/": ("ext4", False),
    "/home/a": ("ext4", False),
    "/home/a b/c": ("nfs4", True),
    "/scratch": ("lustre", True),
    "/scratches": ("ext4", False),
    "/scratch/tmp/d": ("tmpfs", False),
}


@pytest.mark.parametrize("folder", KINDS)
def test_kinds_follow_the_innermost_mount(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, folder: str
) -> None:
    (tmp_path / "mountinfo").write_text(MOUNTS.lstrip())
    monkeypatch.setattr(_systems, "_MOUNTS", tmp_path / "mountinfo")
    kind, is_shared = KINDS[folder]
    _systems._kind_of.cache_clear()
    try:
        assert _systems._kind_of(0, folder) == kind
        assert (kind not in _systems._LOCAL) is is_shared
    finally:
        _systems._kind_of.cache_clear()


def test_a_late_file_is_waited_for_where_another_machine_may_have_written_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(_systems, "_LOOK_S", 0.01)
    looks: list[Path] = []

    def look(folder: Path) -> None:
        looks.append(folder)
        if len(looks) > 5:
            (tmp_path / "late").touch()

    monkeypatch.setattr(_systems, "_look_anew", look)
    monkeypatch.setenv(_systems.LOCKS, "kernel")
    await_file(tmp_path / "late")
    assert looks == []
    monkeypatch.setenv(_systems.LOCKS, "files")
    await_file(tmp_path / "late")
    assert (tmp_path / "late").exists()
    before = len(looks)
    await_file(tmp_path / "late")
    assert len(looks) == before
