# SPDX-License-Identifier: Apache-2.0
"""One process at a time makes a scene or a fit; the others wait and then find it made."""

import contextlib
import os
import socket
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from graycard.io._hold import hold, is_at, let_go
from graycard.io._names import printable


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
    descriptor = _acquire(path, on_wait)
    try:
        with contextlib.suppress(OSError):  # a full disk is met by what is written next
            os.ftruncate(descriptor, 0)
            os.write(descriptor, f"process {os.getpid()} on {socket.gethostname()}".encode())
        yield
    finally:
        path.unlink(missing_ok=True)
        let_go(descriptor)


def _acquire(path: Path, on_wait: Callable[[str], None]) -> int:
    """An open and locked descriptor of the file that bears the name now, not of one removed meanwhile."""
    waited = False
    while True:
        descriptor = os.open(path, os.O_CREAT | os.O_RDWR | os.O_CLOEXEC, 0o666)
        if not hold(descriptor, wait=False):
            if not waited:
                on_wait(_holder(path))
            waited = True
            hold(descriptor)
        if is_at(descriptor, path):
            return descriptor
        let_go(descriptor)


def _holder(path: Path) -> str:
    """Say who holds a lock, as its file does."""
    try:
        found = path.read_bytes()[:200].decode(errors="replace")
    except OSError:
        found = ""
    return printable(found) or "another process"
