# SPDX-License-Identifier: Apache-2.0
"""Code and interpreter of a command: where they lie, what they hash to, and copies of them."""

import hashlib
import os
import shutil
import stat
import sys
import time
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

from graycard import MethodError
from graycard.benchmarks.commands._command import Command, is_fixed, words_of
from graycard.io import dumps, inside, output_error, sha256

_PYTHON = ("python", "python3")
_SCRIPTS = (".py", ".sh")
_SKIPPED = ("__pycache__",)
_NO_DATA = ("__pycache__", ".git")
"""Folders in what a command reads that change and decide nothing."""
MOST = 20_000
"""Files that code may have: more are no code."""
_SETTLED_S = 2.0
"""Age of a change from which times of a file tell it from a later one: file systems round them."""


@dataclass(frozen=True, slots=True)
class Interpreter:
    """The interpreter of a command, and what it reads."""

    path: Path
    readable: tuple[Path, ...]
    """Its environment, and the installation that this was made from."""
    version: str = ""
    """Version by its environment; empty where it tells none."""

    @property
    def variables(self) -> dict[str, str]:
        """Return variables by which programs of its environment are found."""
        search = os.pathsep.join([str(self.path.parent), os.environ.get("PATH", os.defpath)])
        return {"PATH": search, "VIRTUAL_ENV": str(self.path.parent.parent), "PYTHONNOUSERSITE": "1"}


@dataclass(frozen=True, slots=True)
class Code:
    """Files of the code of a command."""

    folder: Path
    """Folder of them."""
    files: dict[str, str]
    """SHA-256 of each by its path in that folder."""
    named: tuple[str, ...]
    """Those that the command names."""

    def copy(self, target: Path) -> None:
        """Copy the files.

        Raises:
            OutputError: There is no room for them.
        """
        for name in self.files:
            copy = inside(target, name)
            try:
                copy.parent.mkdir(parents=True, exist_ok=True)
                shutil.copy2(self.folder / name, copy)
            except OSError as cause:
                raise output_error(copy, cause) from cause


def interpreter_of(command: Command) -> Interpreter:
    """Return the interpreter of a command.

    Raises:
        MethodError: There is none.
    """
    path = Path(command.python).expanduser().absolute() if command.python else Path(sys.executable)
    if not path.is_file() or not os.access(path, os.X_OK):
        raise MethodError(
            f"expected an interpreter at {path}, got none. Make its environment first, as by `python -m venv`"
        )
    told = _told_of(path.parent.parent / "pyvenv.cfg")
    home = Path(told["home"]).parent if told.get("home") else None
    found = [path.parent.parent, *([home] if home else []), path.resolve().parent.parent]
    roots = tuple(dict.fromkeys(place for place in found if _is_installation(place)))
    return Interpreter(path, roots, told.get("version", told.get("version_info", "")))


def code_of(command: Command) -> Code:
    """Return the code of a command, hashed.

    Raises:
        MethodError: A file is missing, is no file of the folder, or there are too many.
    """
    folder = Path(command.folder or ".").expanduser().absolute()
    if not folder.is_dir():
        raise MethodError(f"expected a folder of code at {folder}, got none. Mend `folder`")
    named = [word for text in (command.run, command.setup) for word in _files_in(folder, text)]
    files: dict[str, str] = {}
    for name in dict.fromkeys([*named, *command.code]):
        for path in _files_of(folder, name):
            files[path.relative_to(folder).as_posix()] = _sha256(path)
            if len(files) > MOST:
                raise MethodError(f"expected at most {MOST} files of code in {folder}, got more. Mend `code`")
    return Code(folder, files, tuple(dict.fromkeys(named)))


def digest(files: dict[str, str]) -> str:
    """Return SHA-256 over the hashes of files."""
    return hashlib.sha256(dumps(files).encode()).hexdigest()


def hashes_of_reads(command: Command) -> dict[str, str]:
    """Return SHA-256 of each file or folder that a command reads in its place.

    A process hashes a file once, and again when its size or its times have changed.

    Raises:
        MethodError: It is not there.
    """
    return {name: _hash_of(Path(name).expanduser().absolute()) for name in command.reads}


def check_reads(command: Command, known: Mapping[str, str], grows: Path) -> None:
    """Refuse what a command reads in its place where that is not what it was.

    Args:
        command: Names what it reads.
        known: SHA-256 that each had; others are not looked at.
        grows: Folder of the run: a folder around it, by any path, changes with every job, and is let through.

    Raises:
        MethodError: It has changed, or is gone.
    """
    grown = grows.resolve().parents
    names = [n for n in command.reads if n in known and Path(n).expanduser().resolve() not in grown]
    for name, found in hashes_of_reads(replace(command, reads=tuple(names))).items():
        if found != known[name]:
            raise MethodError(
                f"expected {name} as it was when the bench began, got another. Start the bench again"
            )


def argv_of(text: str, interpreter: Interpreter, values: dict[str, object]) -> list[str]:
    """Return the words of a command; ``python`` is its interpreter."""
    first, *others = words_of(text, values)
    return [str(interpreter.path) if first in _PYTHON else first, *others]


def _files_in(folder: Path, text: str) -> Iterator[str]:
    """Yield words of a command that name files or folders of its code.

    Raises:
        MethodError: A script is missing.
    """
    for word in words_of(text):
        if not is_fixed(word) or Path(word).is_absolute() or word.startswith("-"):
            continue
        if (folder / word).exists() and word not in (".", ".."):
            yield word
        elif word.endswith(_SCRIPTS):
            raise MethodError(f"expected {word} in {folder}, got none. Mend `run` or `folder`")


def _files_of(folder: Path, name: str) -> Iterator[Path]:
    """Yield a file, or the files of a folder but for hidden ones; links are not followed.

    Raises:
        MethodError: There is none, or it lies elsewhere.
    """
    place = folder if name == "." else inside(folder, name.rstrip("/"), error=MethodError)
    if place.is_file():
        yield place
        return
    if not place.is_dir():
        raise MethodError(f"expected code {name} in {folder}, got none. Mend `code`")
    for here, folders, files in os.walk(place):
        folders[:] = sorted(n for n in folders if not _is_left_out(Path(here) / n))
        paths = (Path(here) / n for n in sorted(files) if not n.startswith("."))
        yield from (path for path in paths if stat.S_ISREG(path.lstat().st_mode))


def _is_left_out(folder: Path) -> bool:
    """Tell whether a folder holds no code: hidden ones, caches and environments."""
    return folder.name.startswith(".") or folder.name in _SKIPPED or _is_environment(folder)


def _is_environment(folder: Path) -> bool:
    return (folder / "pyvenv.cfg").is_file()


def _hash_of(path: Path) -> str:
    if path.is_file():
        return _known_sha256(path)
    if not path.is_dir():
        raise MethodError(f"expected a file or folder at {path}, got none. Mend `reads`")
    return digest(dict(_hashes_below(path)))


def _hashes_below(root: Path) -> Iterator[tuple[str, str]]:
    """Yield SHA-256 of each file below a folder, hidden ones too, and of where each link leads."""
    for here, folders, files in os.walk(root):
        links = [name for name in folders if (Path(here) / name).is_symlink()]
        folders[:] = sorted(n for n in folders if n not in _NO_DATA and not _is_environment(Path(here) / n))
        for path in (Path(here) / name for name in sorted([*files, *links])):
            name = path.relative_to(root).as_posix()
            if path.is_symlink():
                yield name, hashlib.sha256(os.fsencode(os.readlink(path))).hexdigest()
            elif path.is_file():
                yield name, _known_sha256(path)


def _known_sha256(path: Path) -> str:
    """Return SHA-256 of a file that may be large, and that was probably hashed before."""
    try:
        told = path.stat()
    except OSError:
        return _sha256(path)  # which says why
    if time.time() - max(told.st_mtime, told.st_ctime) < _SETTLED_S:
        return _sha256(path)
    return _sha256_at(path, (told.st_dev, told.st_ino, told.st_size, told.st_mtime_ns, told.st_ctime_ns))


@cache
def _sha256_at(path: Path, stamp: tuple[int, ...]) -> str:
    """Return SHA-256 of a file that has some size and times.

    All are kept: in folders of more files than a limit each walk would push out what the next one asks for.
    """
    return _sha256(path)


def _sha256(path: Path) -> str:
    """Return SHA-256 of a file.

    Raises:
        MethodError: It cannot be read.
    """
    try:
        return sha256(path)
    except OSError as cause:
        raise MethodError(
            f"expected {path} to be readable, got {cause.strerror}. Change its permissions"
        ) from cause


def _told_of(path: Path) -> dict[str, str]:
    """Return what the settings of a virtual environment say; nothing where there are none."""
    try:
        lines = path.read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:
        return {}
    pairs = (line.partition("=") for line in lines)
    return {key.strip().lower(): value.strip() for key, _, value in pairs}


def _is_installation(place: Path) -> bool:
    """Tell whether a folder is an environment or an installation of Python, and no more."""
    if place in (Path(place.anchor), Path.home()):
        return False  # all that is there would be open
    return (place / "pyvenv.cfg").is_file() or any((place / "lib").glob("python3*/os.py"))
