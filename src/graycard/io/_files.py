# SPDX-License-Identifier: Apache-2.0
"""Whole files or none: atomic writing, hashing, and folders that can be written to."""

import codecs
import errno
import hashlib
import os
import re
import shutil
import stat
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from graycard._errors import OutputError
from graycard.io._hold import hold, is_at, let_go, remove_unheld

PARTIAL = ".partial"
"""Suffix of what is being written; a name that ends so is never read as data."""

PARTIAL_NAME = re.compile(r"\..+\.[a-z0-9_]{8}\.partial")
"""Names of partial files and folders: hidden, with eight characters of :mod:`tempfile`."""

_OUT_OF_SPACE = {errno.ENOSPC, errno.EDQUOT}


@contextmanager
def atomic_path(path: Path) -> Iterator[Path]:
    """Yield a path to write to; it becomes ``path`` in one step when the block ends well.

    The process holds the partial file meanwhile: one that nobody holds was left by a process that was killed.

    Raises:
        OutputError: The folder cannot be written to, the disk is full, or ``path`` is a device.
    """
    path = Path(path)
    if path.is_char_device() or path.is_block_device() or path.absolute().parent == Path("/dev"):
        raise OutputError(f"expected the path of a file, got {path}, which is a device. Choose another")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        held, partial = _held_file(path)
    except OSError as error:
        raise output_error(path, error) from error
    try:
        yield partial
        _flush(partial)
        partial.chmod(0o666 & ~_umask())  # mkstemp makes files that only the owner can read
        os.replace(partial, path)
    except OSError as error:
        raise output_error(path, error) from error
    finally:
        partial.unlink(missing_ok=True)
        let_go(held)


def _held_file(path: Path) -> tuple[int, Path]:
    """Make a partial file for a path and hold it; return a descriptor and where it lies."""
    while True:
        held, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.", suffix=PARTIAL)
        hold(held)
        if sys.platform == "win32" or is_at(held, Path(name)):
            return held, Path(name)  # else another process took it for left over, before it was held
        let_go(held)


@contextmanager
def atomic_folder(path: Path) -> Iterator[Path]:
    """Yield a hidden folder to fill; it becomes ``path`` in one step when the block ends well.

    What killed processes left of the same goes first. Nothing stays behind when the block fails, not even
    folders that were made on the way to ``path``.

    Raises:
        OutputError: There is something at ``path`` already, or it cannot be written to.
    """
    path = Path(path)
    if path.is_file() or (path.is_dir() and any(path.iterdir())):
        raise OutputError(f"expected a new or an empty folder at {path}, got one in use. Choose another")
    made = [p for p in path.parents if not p.exists()]
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        for left in path.parent.glob(f".{path.name}.*{PARTIAL}"):
            if PARTIAL_NAME.fullmatch(left.name) and left.is_dir():
                remove_unheld(left, shutil.rmtree)
        held, partial = _held_folder(path)
    except OSError as error:
        raise output_error(path, error) from error
    try:
        yield partial
        partial.chmod(0o777 & ~_umask())  # mkdtemp makes folders that only the owner can read
        os.replace(partial, path)
    except OSError as error:
        raise output_error(path, error) from error
    finally:
        if partial.exists():
            shutil.rmtree(partial, ignore_errors=True)
            _remove_empty(made)
        let_go(held)


def _held_folder(path: Path) -> tuple[int, Path]:
    """Make a partial folder for a path and hold it; return a descriptor (-1 for none) and where it lies."""
    while True:
        name = tempfile.mkdtemp(dir=path.parent, prefix=f".{path.name}.", suffix=PARTIAL)
        if sys.platform == "win32":
            return -1, Path(name)
        try:
            held = os.open(name, os.O_RDONLY | os.O_CLOEXEC)
        except FileNotFoundError:
            continue  # taken for left over, before it was held
        hold(held)
        if is_at(held, Path(name)):
            return held, Path(name)
        let_go(held)


def decode_text(data: bytes) -> str:
    """Return text in UTF-8, or in UTF-16 where it begins with the mark of it; the mark is left out.

    Raises:
        UnicodeDecodeError: It is neither.
    """
    wide = data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE))
    return data.decode("utf-16" if wide else "utf-8-sig")


def write_bytes(path: Path, data: bytes) -> None:
    """Write a file whole or not at all.

    Raises:
        OutputError: The folder cannot be written to, or the disk is full.
    """
    with atomic_path(path) as partial:
        partial.write_bytes(data)


def writable_folder(path: Path) -> Path:
    """Make a folder and prove that it takes a file, before any time is spent on its content.

    The file has no name where the system can do that, so that nothing is left of it.

    Raises:
        OutputError: It is a file, cannot be made, or cannot be written to.
    """
    path = Path(path)
    try:
        path.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=path, prefix=".graycard-write-test.", suffix=PARTIAL) as file:
            file.write(b"x")
            file.flush()
            os.fsync(file.fileno())
    except OSError as error:
        raise output_error(path, error) from error
    return path


def remove(path: Path) -> None:
    """Remove what is at a path, be it a file, a folder, a link or nothing."""
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path, ignore_errors=True)
    else:
        path.unlink(missing_ok=True)


def read_bytes(path: Path, most: int = 2**33) -> bytes:
    """Return what a file holds; a pipe or a device, which may have no end, is none.

    Args:
        path: The file.
        most: Bytes that it may have: a file with holes can be larger than any disk.

    Raises:
        OSError: There is no such file, it is too large, or it cannot be read.
    """
    found = os.stat(path)
    if stat.S_ISDIR(found.st_mode):
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(path))
    if not stat.S_ISREG(found.st_mode):
        raise OSError(errno.EINVAL, "a pipe or a device", str(path))
    if found.st_size > most:
        raise OSError(errno.EFBIG, f"{found.st_size / 2**20:.0f} MiB, more than {most // 2**20}", str(path))
    return Path(path).read_bytes()


def sha256(path: Path) -> str:
    """SHA-256 of a file's bytes, in hexadecimal."""
    with open(path, "rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def sha256_of_files(root: Path, skip: Callable[[str], bool] = lambda name: False) -> dict[str, str]:
    """SHA-256 of each file below a folder, by its relative POSIX path, sorted; hidden files are left out."""
    names = (p.relative_to(root) for p in root.rglob("*") if p.is_file())
    kept = sorted(n.as_posix() for n in names if not any(part.startswith(".") for part in n.parts))
    return {name: sha256(root / name) for name in kept if not skip(name)}


def strange_entries(root: Path) -> dict[str, str]:
    """Return what below a folder is neither a file nor a folder of its own, hidden or not, with what it is.

    A copy of such a folder would follow links to places that have nothing to do with it, and read devices
    without end. A link to a file in the folder is as good as the file.
    """
    found, home = {}, root.resolve()
    for folder, folders, files in os.walk(root):
        for name in (*folders, *files):
            path = Path(folder) / name
            if fault := _strangeness(path, home):
                found[path.relative_to(root).as_posix()] = fault
    return found


def _strangeness(path: Path, home: Path) -> str:
    if not path.is_symlink():
        return "" if path.is_file() or path.is_dir() else "neither a file nor a folder"
    target = end_of_links(path)
    if target is None or not target.is_relative_to(home):
        return f"got a link to {target or 'itself'}"
    return "" if target.is_file() else "a link to no file"


def end_of_links(path: Path) -> Path | None:
    """Return where a path leads if all links are followed; None where they lead in a circle."""
    try:
        return path.resolve()
    except (RuntimeError, OSError):  # RuntimeError before Python 3.13
        return None


def output_error(path: Path, cause: OSError) -> OutputError:
    """Return advice for a write that failed."""
    if cause.errno in _OUT_OF_SPACE:
        return OutputError(
            f"the disk is full ({free_mib(path):.0f} MiB free): {path} was not written. "
            "Free some space, or choose another output folder; the same command then goes on "
            "where it stopped"
        )
    return OutputError(
        f"expected an output folder that can be written to, got {path} ({cause.strerror or cause}). "
        "Choose another output folder, or change its permissions"
    )


def free_mib(path: Path) -> float:
    """Free disk space in MiB where ``path`` lies or would lie."""
    while not path.exists() and path != path.parent:
        path = path.parent
    return shutil.disk_usage(path).free / 2**20


def _flush(path: Path) -> None:
    """Hand the bytes to the disk before the name points at them: a power cut leaves no empty file."""
    with open(path, "rb+") as file:
        os.fsync(file.fileno())


def _remove_empty(folders: list[Path]) -> None:
    """Remove folders, the deepest first, up to one that holds something."""
    for folder in folders:
        try:
            folder.rmdir()
        except OSError:
            return


def _umask() -> int:
    current = os.umask(0)
    os.umask(current)
    return current
