# SPDX-License-Identifier: Apache-2.0
"""One process at a time makes a scene or a fit; the others wait and then find it made."""

import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path


@contextmanager
def file_lock(path: Path, on_wait: Callable[[], None]) -> Iterator[None]:
    """Hold the lock file ``path`` for the time of the block; the kernel frees it if this process dies.

    Args:
        path: The lock file; it is gone afterwards.
        on_wait: Called once if another process holds it.
    """
    if sys.platform == "win32":  # has no flock; two processes then race, and one of them says so
        yield
        return
    descriptor = _acquire(path, on_wait)
    try:
        yield
    finally:
        path.unlink(missing_ok=True)
        os.close(descriptor)


def _acquire(path: Path, on_wait: Callable[[], None]) -> int:
    """An open and locked descriptor of the file that bears the name now, not of one removed meanwhile."""
    import fcntl

    waited = False
    while True:
        descriptor = os.open(path, os.O_CREAT | os.O_RDWR, 0o666)
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            if not waited:
                on_wait()
            waited = True
            fcntl.flock(descriptor, fcntl.LOCK_EX)
        if path.exists() and os.path.samestat(os.fstat(descriptor), path.stat()):
            return descriptor
        os.close(descriptor)
