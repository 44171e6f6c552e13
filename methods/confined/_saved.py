# SPDX-License-Identifier: Apache-2.0
"""Take what a method has saved in its own folder to where it is wanted."""

import os
import shutil
import stat
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import NoReturn

from graycard import MethodError
from graycard.io import atomic_path, inside, printable


def take_files(made: Path, folder: Path) -> None:
    """Copy what a method has written to where it is wanted; its index, in the folder itself, comes last.

    The method may go on and change names meanwhile. So files are opened from folders that are open.

    Args:
        made: Folder that the method has written; it goes.
        folder: Where to.

    Raises:
        MethodError: There is something else than files and folders, or they cannot be read.
        OutputError: The folder cannot be written to, or the disk is full.
    """
    try:
        is_folder = stat.S_ISDIR(os.lstat(made).st_mode)
        for here, folders, files, number in os.fwalk(made, topdown=False, onerror=_refuse):
            below = Path(here).relative_to(made).parts
            for name in folders:
                with _opened(name, number, stat.S_ISDIR):
                    pass
            for name in sorted(files, key=lambda name: (name.endswith(".json"), name)):
                with _opened(name, number, stat.S_ISREG) as source:
                    _copy(source, inside(folder, *below, name, error=MethodError))
    except FileNotFoundError as cause:
        _refuse(cause)
    if not is_folder:
        raise MethodError(f"expected a folder of files, got {made.name}, which is none")
    shutil.rmtree(made, ignore_errors=True)


def end_of_file(folder: Path, name: str, most: int) -> bytes:
    """Return the end of a file in a folder that code of others may still change; empty where there is none.

    Neither the folder nor the file may be a link, and a pipe is no file.

    Args:
        folder: The folder.
        name: Of the file.
        most: Number of bytes at most.
    """
    try:
        number = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW | os.O_CLOEXEC)
    except OSError:
        return b""
    try:
        with suppress(MethodError), _opened(name, number, stat.S_ISREG) as file:
            return os.pread(file, most, max(0, os.fstat(file).st_size - most))
    finally:
        os.close(number)
    return b""


@contextmanager
def _opened(name: str, folder: int, is_kind: Callable[[int], bool]) -> Iterator[int]:
    """Return a descriptor of what a method has written.

    Args:
        name: Of the file or folder.
        folder: Descriptor of the folder that it lies in.
        is_kind: Tells by the mode of a file whether it is what is expected.

    Raises:
        MethodError: It is something else, or cannot be read.
    """
    try:
        number = os.open(name, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC, dir_fd=folder)
    except OSError as cause:
        _refuse(cause)
    try:
        if not is_kind(os.fstat(number).st_mode):
            raise MethodError(f"expected files of a method, got {printable(name)}, which is none")
        yield number
    finally:
        os.close(number)


def _copy(source: int, target: Path) -> None:
    with (
        atomic_path(target) as partial,
        partial.open("wb") as file,
        open(source, "rb", closefd=False) as data,
    ):
        shutil.copyfileobj(data, file)


def _refuse(cause: OSError) -> NoReturn:
    """Say of a file that it cannot be read.

    Raises:
        MethodError: Always.
    """
    words = f"expected files of a method, got {printable(str(cause.filename))}: {cause.strerror}"
    raise MethodError(words) from None
