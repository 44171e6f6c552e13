# SPDX-License-Identifier: Apache-2.0
"""Hold files and folders while they are in use: the kernel lets go of them when the process dies."""

import contextlib
import itertools
import os
import stat
import sys
import time
from collections.abc import Callable
from functools import cache
from pathlib import Path

from graycard.io.sharing._systems import is_shared

_QUIET_S = 3600.0
"""Time after which what nobody changes is left over, where no kernel tells what other machines hold."""
_held: set[int] = set()
"""Descriptors that this process holds something by."""


def hold(descriptor: int, *, wait: bool = True, shared: bool = False) -> bool:
    """Hold what a descriptor is open on, until :func:`let_go` or the end of the process.

    A process that is forked meanwhile does not hold it.

    Args:
        descriptor: An open file or folder; on Windows, which has no such holding, it is closed.
        wait: Wait for another process that holds it.
        shared: Hold it beside others that do the same.

    Returns:
        False where another process holds it and is not waited for, or the file system knows no holding.
    """
    if sys.platform == "win32":
        os.close(descriptor)
        return False
    import fcntl

    _forget_at_fork()
    _held.add(descriptor)
    try:
        fcntl.flock(descriptor, (fcntl.LOCK_SH if shared else fcntl.LOCK_EX) | (0 if wait else fcntl.LOCK_NB))
    except OSError:
        return False
    return True


def let_go(descriptor: int) -> None:
    """Close a descriptor, and so end a holding; one that a fork has closed is left alone."""
    if descriptor in _held:
        _held.discard(descriptor)
        os.close(descriptor)


def is_at(descriptor: int, path: Path) -> bool:
    """Tell whether a path leads to what a descriptor is open on, and to no link."""
    try:
        return os.path.samestat(os.fstat(descriptor), os.lstat(path))
    except OSError:
        return False


def remove_unheld(path: Path, remove: Callable[[Path], None]) -> bool:
    """Remove a file or folder of this user that no process holds; it is held meanwhile.

    On file systems that other machines may share: in which nobody has changed anything for an hour.

    Args:
        path: Where it lies.
        remove: How it is removed.

    Returns:
        Whether it is gone.
    """
    if sys.platform == "win32":
        return False
    shared = is_shared(path.parent)
    try:
        descriptor = os.open(path, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC)
    except OSError:
        return False
    held = _is_quiet(path) if shared else hold(descriptor, wait=False)
    try:
        if not held or not is_at(descriptor, path) or not _is_own(descriptor):
            return False
        with contextlib.suppress(OSError):
            remove(path)
        return not path.exists()
    finally:
        if descriptor in _held:
            let_go(descriptor)
        else:
            os.close(descriptor)


def _is_quiet(path: Path) -> bool:
    """Tell whether neither a file or folder nor anything in it has been changed for long."""
    since = time.time() - _QUIET_S
    inside = (Path(at) / name for at, folders, files in os.walk(path) for name in (*folders, *files))
    with contextlib.suppress(OSError):  # what goes meanwhile is in use
        return all(os.lstat(each).st_mtime < since for each in itertools.chain([path], inside))
    return False


def _is_own(descriptor: int) -> bool:
    """Tell whether this user owns an open file or folder, and it is nothing else."""
    found = os.fstat(descriptor)
    return found.st_uid == os.getuid() and (stat.S_ISREG(found.st_mode) or stat.S_ISDIR(found.st_mode))


def _forget() -> None:
    """Close what the process that this one was forked from holds: it ends with that one."""
    for descriptor in _held:
        with contextlib.suppress(OSError):
            os.close(descriptor)
    _held.clear()


@cache
def _forget_at_fork() -> None:
    """Let forked processes forget, from the first holding on."""
    os.register_at_fork(after_in_child=_forget)
