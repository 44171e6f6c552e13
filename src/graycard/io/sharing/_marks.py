# SPDX-License-Identifier: Apache-2.0
"""Locks that need no lock of the kernel: a file that one alone can make, with a sign of life.

Making a file that must not exist yet (``O_EXCL``) is atomic on NFS from version 3 on, and on all others that
clusters use. Whoever holds the lock sets the time of the file again and again. Whoever waits takes it over
when that has not changed for two minutes of its own clock. Where the holder was on the same machine and is
gone, it does so at once. A holder that was stopped for so long may then be one of two: both write the same,
whole.
"""

import contextlib
import errno
import os
import secrets
import socket
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from graycard.io._files import output_error
from graycard.io._names import printable

BEAT_S = 10.0
"""Time between two signs of life."""
DEAD_S = 120.0
"""Time without one after which a holder counts as dead; NFS shows a sign up to a minute late."""
_LOOK_S = 0.5
NAMED_S = 1.0
"""Time that a new holder is given to write its name."""
_LONGEST = 400
"""Bytes of a lock file that are read."""
_GONE = (errno.ENOENT, errno.ESTALE)
"""Errors of a file that is not there any more; the second is that of NFS."""


@dataclass(frozen=True, slots=True)
class Sign:
    """A lock file as it was seen."""

    words: str
    """The holder, as ``process 12 on node7``."""
    place: str
    """Boot, process ids' namespace, id and start of the holder."""
    content: bytes
    changed_ns: int

    @property
    def is_gone(self) -> bool:
        """Tell whether the holder was a process of this machine that has ended."""
        parts = self.place.split()
        here = _place(int(parts[2])).split() if len(parts) == 4 and parts[2].isdecimal() else []
        return bool(here) and parts[:2] == here[:2] and parts[3] != here[3]


@contextmanager
def marked_lock(path: Path, on_wait: Callable[[str], None]) -> Iterator[None]:
    """Hold a lock file for the time of the block.

    Args:
        path: The lock file; it is gone afterwards.
        on_wait: Called once if another process holds it, with words for it.

    Raises:
        OutputError: It cannot be made, or that of another can be neither read nor removed.
    """
    content = (
        f"process {os.getpid()} on {socket.gethostname()}\n{_place(os.getpid())}\n{secrets.token_hex(8)}"
    )
    try:
        _claim(path, content.encode(), on_wait)
    except OSError as cause:
        raise output_error(path, cause) from cause
    ended = threading.Event()
    beats = threading.Thread(target=_beat, args=(path, content.encode(), ended), daemon=True)
    beats.start()
    try:
        yield
    finally:
        ended.set()
        beats.join()
        with contextlib.suppress(OSError):
            if (found := read_sign(path)) and found.content == content.encode():
                path.unlink(missing_ok=True)


def read_sign(path: Path) -> Sign | None:
    """Return what a lock file says now, as the server has it; None where there is none.

    Raises:
        OSError: It may not be read, or is no file.
    """
    try:
        descriptor = os.open(path, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC)
        try:
            content, changed = os.read(descriptor, _LONGEST), os.fstat(descriptor).st_mtime_ns
        finally:
            os.close(descriptor)
    except OSError as error:
        if error.errno not in _GONE:
            raise OSError(error.errno, error.strerror, str(path)) from error
        return None
    words, *rest = [*content.decode(errors="replace").split("\n"), ""]
    return Sign(printable(words) or "another process", rest[0], content, changed)


def _claim(path: Path, content: bytes, on_wait: Callable[[str], None]) -> None:
    """Make the lock file, once there is none or its holder is dead."""
    seen, since, told = None, time.monotonic(), False
    while not _made(path, content):
        sign = read_sign(path)
        if sign != seen:
            seen, since = sign, time.monotonic()
        if sign is None:
            time.sleep(_LOOK_S / 10)
            continue
        if sign.is_gone or time.monotonic() > since + DEAD_S:
            set_aside(path, sign)
            continue
        if not told and (sign.content or time.monotonic() > since + NAMED_S):
            on_wait(sign.words)
            told = True
        time.sleep(_LOOK_S)


def _made(path: Path, content: bytes) -> bool:
    """Make the lock file; False if there is one.

    Raises:
        OSError: There can be none.
    """
    try:
        descriptor = os.open(path, os.O_CREAT | os.O_EXCL | os.O_WRONLY | os.O_CLOEXEC, 0o666)
    except FileExistsError:
        return False
    try:
        with contextlib.suppress(OSError):  # a full disk is met by what is written next
            os.write(descriptor, content)
    finally:
        os.close(descriptor)
    return True


def set_aside(path: Path, dead: Sign) -> None:
    """Remove the lock file of a dead holder, and put back that of one which was quicker.

    Raises:
        OSError: It cannot be removed.
    """
    aside = path.with_name(f"{path.name}.{secrets.token_hex(4)}.lock")
    with contextlib.suppress(FileNotFoundError):
        os.rename(path, aside)  # one of those who wait does it
        try:
            is_dead = read_sign(aside) == dead
        except OSError:
            is_dead = False  # that of the dead holder could be read
        if is_dead:
            aside.unlink()
        else:
            _put_back(aside, path)


def _put_back(aside: Path, path: Path) -> None:
    """Give a lock file its name again, unless another process has made one meanwhile."""
    try:
        os.link(aside, path)
    except FileExistsError:
        pass
    except OSError:  # the file system has no hard links
        os.rename(aside, path)
        return
    aside.unlink()


def _beat(path: Path, content: bytes, ended: threading.Event) -> None:
    """Give signs of life, as long as the lock is still that of this process."""
    while not ended.wait(BEAT_S):
        with contextlib.suppress(OSError):  # the next may get through
            sign = read_sign(path)
            if sign is None or sign.content != content:
                return
            os.utime(path)


def process_space() -> tuple[str, str]:
    """Return boot and namespace that ids of processes belong to; empty words without ``/proc``.

    The namespace alone is not enough: Linux gives the first one of each machine the same number.
    """
    try:
        boot = Path("/proc/sys/kernel/random/boot_id").read_text().strip()
        return boot, os.readlink("/proc/self/ns/pid")
    except OSError:
        return "", ""


def _place(pid: int) -> str:
    """Return boot, namespace of process ids, id and start of a process; empty without ``/proc``."""
    boot, space = process_space()
    if not boot:
        return ""
    try:
        start = Path(f"/proc/{pid}/stat").read_text(errors="replace").rpartition(")")[2].split()[19]
    except (OSError, IndexError):
        start = "gone"
    return f"{boot} {space} {pid} {start}"
