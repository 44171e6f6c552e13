# SPDX-License-Identifier: Apache-2.0
"""One process at a time makes a scene or a fit; the others wait and then find it made."""

import contextlib
import errno
import os
import socket
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from graycard.io._files import output_error
from graycard.io._hold import hold, is_at, let_go
from graycard.io._names import printable
from graycard.io.sharing._marks import NAMED_S, marked_lock
from graycard.io.sharing._systems import is_shared, kind_of

_NO_LOCKS = {errno.ENOLCK, errno.EOPNOTSUPP, errno.ENOSYS}
"""Errors of ``flock`` where a file system has none."""


@contextmanager
def file_lock(path: Path, on_wait: Callable[[str], None]) -> Iterator[None]:
    """Hold the lock file ``path`` for the time of the block; the kernel frees it if this process dies.

    A process that is forked meanwhile does not hold it. On file systems that several machines may share, and
    on those without locks, the file itself is the lock: one whose holder died is free two minutes later.

    Args:
        path: The lock file; it is gone afterwards.
        on_wait: Called once if another process holds it, with words for it, as ``process 12 on host``.

    Raises:
        OutputError: It cannot be made, or that of another user cannot be read or removed.
    """
    if sys.platform == "win32":  # has no flock; two processes then race, and one of them says so
        yield
    elif is_shared(path.parent) or not _has_locks(path.parent):
        with marked_lock(path, on_wait):
            yield
    else:
        with _kernel_lock(path, on_wait):
            yield


def lock_words(folder: Path) -> str:
    """Say how work in a folder is kept apart, where the kernel does not do it; empty where it does."""
    if sys.platform == "win32" or (not is_shared(folder) and _has_locks(folder)):
        return ""
    return (
        f"locks of the kernel do not hold on {kind_of(folder) or 'this file system'} at {folder} between "
        "machines; files with signs of life are used, and the work of a machine that died is taken over "
        "after two minutes"
    )


def _has_locks(folder: Path) -> bool:
    """Tell whether a folder's file system has ``flock``; one that cannot be asked is taken to have it."""
    try:
        descriptor = os.open(folder, os.O_RDONLY | os.O_CLOEXEC)
    except OSError:
        return True
    import fcntl

    try:
        fcntl.flock(descriptor, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except OSError as error:
        return error.errno not in _NO_LOCKS
    finally:
        os.close(descriptor)
    return True


@contextmanager
def _kernel_lock(path: Path, on_wait: Callable[[str], None]) -> Iterator[None]:
    """Hold a lock file for the kernel as well."""
    try:
        descriptor = _acquire(path, on_wait)
    except OSError as cause:
        raise output_error(path, cause) from cause
    try:
        with contextlib.suppress(OSError):  # a full disk is met by what is written next
            os.ftruncate(descriptor, 0)
            os.write(descriptor, f"process {os.getpid()} on {socket.gethostname()}".encode())
        yield
    finally:
        path.unlink(missing_ok=True)
        let_go(descriptor)


def _acquire(path: Path, on_wait: Callable[[str], None]) -> int:
    """Return an open and locked descriptor of the file that bears the name now, not of one removed
    meanwhile.
    """
    waited = False
    while True:
        descriptor = os.open(path, os.O_CREAT | os.O_RDWR | os.O_NOFOLLOW | os.O_CLOEXEC, 0o666)
        if not hold(descriptor, wait=False):
            if not waited:
                on_wait(_holder(descriptor))
            waited = True
            hold(descriptor)
        if is_at(descriptor, path):
            return descriptor
        let_go(descriptor)


def _holder(descriptor: int) -> str:
    """Say who holds an open lock file, as it does; a holder locks it first and then writes its name."""
    until = time.monotonic() + NAMED_S
    while not (found := os.pread(descriptor, 200, 0)) and time.monotonic() < until:
        time.sleep(0.01)
    return printable(found.decode(errors="replace")) or "another process"
