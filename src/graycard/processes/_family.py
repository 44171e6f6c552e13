# SPDX-License-Identifier: Apache-2.0
"""A process with all that it started: they end together.

A worker leads a session of its own, and its environment holds a mark that its children inherit. So whatever
it leaves behind is found by session or by mark, and killed; without ``/proc``, by its process group. A child
with a session of its own and another environment is found on Linux, as the starter above it adopts it when
its parent ends. It is not found once that starter has been killed by others.
"""

import contextlib
import ctypes
import os
import shutil
import signal
import sys
import tempfile
import time
from collections.abc import Iterator
from itertools import count
from pathlib import Path

from graycard.io import process_space

MARK = "GRAYCARD_WORKER"
"""Environment variable: machine and namespace, id and start of the bench's process, and a number."""
_TEMPORARY = "graycard-worker-"
"""Begin of the names of folders for temporary files; the mark follows."""
_PDEATHSIG, _SUBREAPER = 1, 36
"""Options of prctl: the signal that comes when the parent dies, and to adopt orphans (``linux/prctl.h``)."""
_NUMBERS = count()
_PROC = Path("/proc")
_ATTEMPTS = 20
"""Most rounds of killing: a child may start others meanwhile."""


def lead_family() -> None:
    """Make this process the leader of a session, which ends with the process that started it."""
    with contextlib.suppress(OSError, AttributeError):
        os.setsid()
    die_with_parent()


def die_with_parent() -> None:
    """Let the kernel kill this process when the one that started it ends; on Linux alone."""
    if sys.platform == "linux":
        ctypes.CDLL(None, use_errno=True).prctl(_PDEATHSIG, signal.SIGKILL, 0, 0, 0)


def adopt_orphans() -> None:
    """Become the parent of what this process's children leave behind; on Linux alone."""
    if sys.platform == "linux":
        ctypes.CDLL(None, use_errno=True).prctl(_SUBREAPER, 1, 0, 0, 0)


def end_adopted() -> None:
    """Kill the children of this process, and those that they leave to it, until there are none."""
    with contextlib.suppress(ChildProcessError):
        while True:
            if os.waitpid(-1, os.WNOHANG)[0]:
                continue
            if not _kill([pid for pid, parent in _parents().items() if parent == os.getpid()]):
                return  # without /proc nobody knows them
            os.waitpid(-1, 0)


@contextlib.contextmanager
def marked() -> Iterator[str]:
    """Mark the processes that are started within the block; yields the mark."""
    before = os.environ.get(MARK)
    os.environ[MARK] = mark = f"{_space()}-{os.getpid()}-{_started(os.getpid())}-{next(_NUMBERS)}"
    try:
        yield mark
    finally:
        if before is None:
            del os.environ[MARK]
        else:
            os.environ[MARK] = before


def end_family(leader: int, mark: str, spared: int = 0) -> None:
    """Kill a process and all that it started; return when nothing of it runs any more.

    Args:
        leader: Its id, which is that of its session too.
        mark: Its mark; this process, which may bear it too, is spared.
        spared: Id of another process with this mark.
    """
    for attempt in range(_ATTEMPTS if _stat(leader) else 0):
        if not _kill(_adopted_below(leader)):  # while those that adopt them are there
            break
        time.sleep(0.005 * (attempt + 1))
    with contextlib.suppress(ProcessLookupError, PermissionError):
        os.killpg(leader, signal.SIGKILL)
    quiet = 0
    for attempt in range(_ATTEMPTS):
        marks = ((pid, own == mark) for pid, _, own in _processes() if pid != spared)
        found = [pid for pid, is_marked in marks if is_marked or _session(pid) == leader]
        quiet = 0 if _kill(found) else quiet + 1
        if quiet == 2:  # one that was just being started shows its environment a moment later
            return
        time.sleep(0.005 * (attempt + 1))


def end_orphans() -> None:
    """Kill what workers of a bench that is gone have left running, and remove their temporary files."""
    if not _PROC.exists():
        return
    for pid, _, mark in _processes():
        if _is_orphan(mark):
            _kill([pid])
    for folder in Path(tempfile.gettempdir()).glob(f"{_TEMPORARY}*"):
        if _is_orphan(folder.name.removeprefix(_TEMPORARY)):
            shutil.rmtree(folder, ignore_errors=True)


def temporary_folder(mark: str) -> Path:
    """Make the folder for temporary files of a worker; they go with it."""
    return Path(tempfile.mkdtemp(prefix=f"{_TEMPORARY}{mark}-"))


def _is_orphan(mark: str) -> bool:
    """Tell whether the bench that made a mark is gone."""
    parts = mark.split("-")
    if len(parts) < 4 or not parts[0] or parts[0] != _space() or not parts[1].isdecimal():
        return False
    return _started(int(parts[1])) != parts[2]


def _space() -> str:
    """Return the machine's start and the namespace that process ids belong to, without hyphens.

    Folders for temporary files may be shared by machines, and a container numbers its own processes. Empty
    where nobody knows.
    """
    return "".join(filter(str.isalnum, "".join(process_space())))


def _kill(processes: list[int]) -> int:
    """Kill processes, and count those that were still there."""
    killed = 0
    for pid in processes:
        with contextlib.suppress(ProcessLookupError, PermissionError):
            os.kill(pid, signal.SIGKILL)
            killed += 1
    return killed


def _processes() -> Iterator[tuple[int, str, str]]:
    """Yield id, state and mark (empty without one) of other living processes of this user."""
    for entry in _PROC.glob("[0-9]*"):
        pid = int(entry.name)
        state = _stat(pid)[:1]
        if pid == os.getpid() or state in ([], ["Z"], ["X"]):
            continue
        try:
            content = (entry / "environ").read_bytes()
        except OSError:
            content = b""
        found = [part for part in content.split(b"\0") if part.startswith(f"{MARK}=".encode())]
        yield pid, state[0], found[0].decode(errors="replace").partition("=")[2] if found else ""


def _parents() -> dict[int, int]:
    """Return the parent of each living process."""
    found = ((int(entry.name), _stat(int(entry.name))) for entry in _PROC.glob("[0-9]*"))
    return {pid: int(fields[1]) for pid, fields in found if fields and fields[0] not in "ZX"}


def _adopted_below(leader: int) -> list[int]:
    """Return what a process's children have started or adopted, but for those children themselves."""
    parents = _parents()
    children = below = {pid for pid, parent in parents.items() if parent == leader}
    while more := {pid for pid, parent in parents.items() if parent in below} - below:
        below = below | more
    return sorted(below - children)


def _session(pid: int) -> int:
    fields = _stat(pid)
    return int(fields[3]) if len(fields) > 3 else -1


def _started(pid: int) -> str:
    """Return the start of a process in the kernel's ticks; empty for one that is not there."""
    fields = _stat(pid)
    return fields[19] if len(fields) > 19 else ""


def _stat(pid: int) -> list[str]:
    """Return the fields of ``/proc/<pid>/stat`` from the state on; none for a process that is not there."""
    try:
        return (_PROC / str(pid) / "stat").read_text(errors="replace").rpartition(")")[2].split()
    except OSError:
        return []
