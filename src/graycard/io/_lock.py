# SPDX-License-Identifier: Apache-2.0
"""One process at a time makes a scene or a fit; the others wait and then find it made."""

import contextlib
import os
import socket
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path

from graycard.io._names import printable

_held: set[int] = set()
"""Descriptors of locks that this process holds."""


@contextmanager
def file_lock(path: Path, on_wait: Callable[[str], None]) -> Iterator[None]:
    """Hold the lock file ``path`` for the time of the block; the kernel frees it if this process dies.

    A process that is forked meanwhile does not hold it.

    Args:
        path: The lock file; it is gone afterwards.
        on_wait: Called once if another process holds it, with words for it, as ``process 12 on host``.
    """
    if sys.platform == "win32":  # has no flock; two processes then race, and one of them says so
        yield
        return
    _forget_at_fork()
    descriptor = _acquire(path, on_wait)
    _held.add(descriptor)
    try:
        with contextlib.suppress(OSError):  # a full disk is met by what is written next
            os.ftruncate(descriptor, 0)
            os.write(descriptor, f"process {os.getpid()} on {socket.gethostname()}".encode())
        yield
    finally:
        path.unlink(missing_ok=True)
        _held.discard(descriptor)
        os.close(descriptor)


def _acquire(path: Path, on_wait: Callable[[str], None]) -> int:
    """An open and locked descriptor of the file that bears the name now, not of one removed meanwhile."""
    import fcntl

    waited = False
    while True:
        descriptor = os.open(path, os.O_CREAT | os.O_RDWR | os.O_CLOEXEC, 0o666)
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            if not waited:
                on_wait(_holder(path))
            waited = True
            fcntl.flock(descriptor, fcntl.LOCK_EX)
        if path.exists() and os.path.samestat(os.fstat(descriptor), path.stat()):
            return descriptor
        os.close(descriptor)


def _holder(path: Path) -> str:
    """Say who holds a lock, as its file does."""
    try:
        found = path.read_bytes()[:200].decode(errors="replace")
    except OSError:
        found = ""
    return printable(found) or "another process"


def _forget_locks() -> None:
    """Close the locks of the process that this one was forked from: they end with that one."""
    for descriptor in _held:
        with contextlib.suppress(OSError):
            os.close(descriptor)
    _held.clear()


@cache
def _forget_at_fork() -> None:
    """Let forked processes forget locks, from the first lock on."""
    os.register_at_fork(after_in_child=_forget_locks)
