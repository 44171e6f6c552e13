# SPDX-License-Identifier: Apache-2.0
"""Find and remove what processes that were killed have left behind, and nothing that is in use.

Whoever writes a partial file, holds a lock or has a temporary folder holds it for the kernel as well. So what
nobody holds is left over, however young it is, and what is held is in use, however old.
"""

import contextlib
import os
import re
import shutil
import sys
import tempfile
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from graycard.io._files import PARTIAL_NAME, output_error
from graycard.io._hold import hold, is_at, let_go, remove_unheld
from graycard.io.sharing._marks import BEAT_S, Sign, read_sign, set_aside
from graycard.io.sharing._systems import is_shared

_LOCK = re.compile(r"(\..+)?\.lock")
_HOLDER = re.compile(rb"(process \d+ on \S*)?")
"""Content of a lock file."""
_TEMPORARY = "graycard-held-"
_OLD_TEST = ".graycard-write-test"
"""A file that older versions made for a moment; no process of this one does."""


def remove_leftovers(root: Path) -> list[Path]:
    """Remove partial files and folders and locks below a folder that no process holds.

    Args:
        root: A run, a dataset or a predictions folder; links in it are not followed.

    Returns:
        What was removed.
    """
    found: list[Path] = []
    if sys.platform == "win32":  # nothing can be told there
        return found
    for folder, folders, files in os.walk(root):
        here = Path(folder)
        partial = [name for name in folders if PARTIAL_NAME.fullmatch(name)]
        folders[:] = [name for name in folders if name not in partial]
        found += [here / name for name in partial if remove_unheld(here / name, shutil.rmtree)]
        found += [here / name for name in files if _is_left(here / name) and _remove(here / name)]
    return found


@contextmanager
def temporary_folder() -> Iterator[Path]:
    """Yield a folder for temporary files, which goes with the block; those of killed processes go first.

    Raises:
        OutputError: There is no room for it.
    """
    place = Path(tempfile.gettempdir())
    for left in place.glob(f"{_TEMPORARY}*"):
        remove_unheld(left, shutil.rmtree)
    try:
        root, held = _held_folder()
    except OSError as cause:
        raise output_error(place, cause) from cause
    ended = threading.Event()
    if is_shared(place):  # where the kernel does not tell other machines that it is held
        threading.Thread(target=_beat, args=(root, ended), daemon=True).start()
    try:
        yield root
    finally:
        ended.set()
        shutil.rmtree(root, ignore_errors=True)
        if held is not None:
            let_go(held)


@contextmanager
def used_folder(folder: Path) -> Iterator[Path]:
    """Keep a folder from being removed by :func:`remove_unheld` for the time of the block; yield it.

    Others may use it at the same time. It is made anew where a removal was quicker.

    Raises:
        OutputError: It cannot be made or opened.
    """
    if sys.platform == "win32":
        yield folder
        return
    try:
        real, held = _used(folder)
    except OSError as cause:
        raise output_error(folder, cause) from cause
    try:
        yield real
    finally:
        let_go(held)


def _used(folder: Path) -> tuple[Path, int]:
    """Return a folder, links resolved, with a descriptor that holds it beside others."""
    while True:
        folder.mkdir(parents=True, exist_ok=True)
        real = folder.resolve()
        try:
            held = os.open(real, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
        except FileNotFoundError:
            continue  # another process has just removed it
        hold(held, shared=True)
        if is_at(held, real):
            return real, held
        let_go(held)


def _beat(root: Path, ended: threading.Event) -> None:
    """Give signs of life, as long as a folder is in use."""
    while not ended.wait(BEAT_S):
        with contextlib.suppress(OSError):
            os.utime(root)


def _held_folder() -> tuple[Path, int | None]:
    """Make a temporary folder and hold it; return it with a descriptor, None where nothing can be held."""
    while True:
        root = Path(tempfile.mkdtemp(prefix=_TEMPORARY))
        if sys.platform == "win32":
            return root, None
        try:
            held = os.open(root, os.O_RDONLY)
        except FileNotFoundError:
            continue  # another process took it for left over, before it was held
        hold(held)
        if is_at(held, root):
            return root, held
        let_go(held)


def _remove(path: Path) -> bool:
    """Remove a file that may be left over; return whether it is gone."""
    if not _LOCK.fullmatch(path.name) or (dead := _dead(path)) is None:
        return remove_unheld(path, os.unlink)
    with contextlib.suppress(OSError):  # as in a folder of another user
        set_aside(path, dead)
    return not path.exists()


def _is_left(path: Path) -> bool:
    """Tell whether a file may be one of graycard's that was left behind, by its name and content."""
    if path.name == _OLD_TEST or PARTIAL_NAME.fullmatch(path.name):
        return True
    if not _LOCK.fullmatch(path.name):
        return False
    try:
        content = path.read_bytes()[:400] if path.is_file() else b"no lock"
    except OSError:
        return False
    return _HOLDER.fullmatch(content) is not None or _dead(path) is not None


def _dead(path: Path) -> Sign | None:
    """Return the sign of a lock whose holder is gone, and which needs no lock of the kernel; else None."""
    try:
        sign = read_sign(path)
    except OSError:
        return None
    return sign if sign is not None and sign.is_gone else None
