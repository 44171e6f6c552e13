# SPDX-License-Identifier: Apache-2.0
"""Watch what a case writes: by Python's audit events, and by listing everything around its folders."""

import os
import resource
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from fuzzer.hostile import OUTSIDE
from graycard.io._files import PARTIAL

_WRITES = {
    "os.rename": 2,
    "os.link": 2,
    "os.symlink": 2,
    "os.remove": 1,
    "os.rmdir": 1,
    "os.mkdir": 1,
    "os.truncate": 1,
    "os.chmod": 1,
    "os.chown": 1,
    "os.utime": 1,
}
"""Events whose first arguments are paths that are changed."""
_FLAGS = os.O_WRONLY | os.O_RDWR | os.O_CREAT | os.O_TRUNC | os.O_APPEND
_DEVICES = ("/dev/null", "/dev/shm/", "/dev/tty", "/proc/self/")


class Watch:
    """The places that a case may write to; all else that it writes is noted."""

    def __init__(self, allowed: Sequence[Path]) -> None:
        self._always = tuple(os.path.realpath(path) for path in allowed)
        self._allowed: tuple[str, ...] = ()
        self.written: list[str] | None = None
        """Paths that were written elsewhere; None while no case runs."""
        sys.addaudithook(self._hear)

    @contextmanager
    def over(self, root: Path, targets: Sequence[Path]) -> Iterator[list[str]]:
        """Watch a block: what it writes outside of ``targets`` is in the list.

        What native code writes is seen below ``root`` alone.
        """
        self._allowed = (*self._always, *(os.path.abspath(path) for path in targets))
        found: list[str] = []
        before = self._listing(root)
        self.written = found
        try:
            yield found
        finally:
            self.written = None
            after = self._listing(root)
            changed = {path for path in before.keys() | after.keys() if before.get(path) != after.get(path)}
            found += [f"changed: {path}" for path in sorted(changed)]

    def _hear(self, event: str, args: tuple[Any, ...]) -> None:
        if self.written is None:
            return
        if event == "open":
            path, mode, flags = args
            writes = (isinstance(mode, str) and set(mode) & set("wax+")) or (
                isinstance(flags, int) and flags & _FLAGS
            )
            self._note(event, path if writes else None)
        elif event in _WRITES:
            folders = [x for x in args[_WRITES[event] :] if isinstance(x, int) and x >= 0]
            for path in args[: _WRITES[event]]:
                where = _below(path, folders)
                if event != "os.mkdir" or not os.path.isdir(where):
                    self._note(event, where)

    def _note(self, event: str, path: Any) -> None:
        if path is None or isinstance(path, int) or self.written is None:
            return
        text = os.path.abspath(os.fsdecode(path))
        real = os.path.join(os.path.realpath(os.path.dirname(text)), os.path.basename(text))
        if event == "open":
            real = os.path.realpath(text)
        if not self._is_allowed(real) and not real.startswith(_DEVICES):
            self.written.append(f"{event}: {real}")

    def _is_allowed(self, path: str) -> bool:
        """Tell whether a path is a target, lies in one, or is what is renamed to one."""
        folder, name = os.path.split(path)
        return any(
            path == place
            or path.startswith(place + os.sep)
            or (
                name.endswith(PARTIAL)
                and name.startswith(f".{os.path.basename(place)}.")
                and folder == os.path.dirname(place)
            )
            for place in self._allowed
        )

    def _listing(self, root: Path) -> dict[str, tuple[int, int, int]]:
        """Return kind, size and time of everything below a folder, but of what may change."""
        found = {}
        for folder, names, files in os.walk(root):
            for name in [*names, *files]:
                path = os.path.join(folder, name)
                if not self._is_allowed(path):
                    facts = os.lstat(path)
                    size, time = (0, 0) if os.path.isdir(path) else (facts.st_size, facts.st_mtime_ns)
                    found[path] = facts.st_mode, size, time
            names[:] = [name for name in names if not self._is_allowed(os.path.join(folder, name))]
        return found | ({OUTSIDE: (0, 0, 0)} if os.path.lexists(OUTSIDE) else {})


def _below(path: Any, folders: Sequence[int]) -> Any:
    """Return a path that is relative to the folder of an open descriptor as an absolute one."""
    text = os.fsdecode(path) if isinstance(path, str | bytes | os.PathLike) else ""
    if not text or os.path.isabs(text) or not folders:
        return path
    try:
        return os.path.join(os.readlink(f"/proc/self/fd/{folders[0]}"), text)
    except OSError:
        return path


def forget_peak_memory() -> None:
    """Let the peak of this process's memory begin again, where the system can."""
    with suppress(OSError):
        Path("/proc/self/clear_refs").write_text("5")


def peak_memory_mib() -> float:
    """Return the peak of this process's memory since :func:`forget_peak_memory`."""
    try:
        lines = Path("/proc/self/status").read_text().splitlines()
        return next(int(line.split()[1]) / 1024 for line in lines if line.startswith("VmHWM"))
    except (OSError, StopIteration):
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
