# SPDX-License-Identifier: Apache-2.0
"""Numba's ``njit`` with a cache on disk that is addressed by the code of a kernel.

Numba compiles a kernel anew if its own file changes, but not if a function or a constant that it took from
another file does. It also keeps kernels beside the source, so a second checkout compiles everything again.
Here the cache folder of a file is named after the hash of that file and of all files of graycard that it can
import. Kernels of equal code are shared between checkouts; a change of any file that they reach is seen.

The cache is in ``NUMBA_CACHE_DIR`` if that is set, else in the user's cache folder. Where neither can be
written to, Numba's own places are tried.

A confined process (:mod:`graycard.processes`) has a cache of its own, with links to the kernels that there
are: what it compiles reaches no other process, for compiled kernels are code.
"""

import hashlib
import os
import re
import shutil
import tempfile
import time
from collections.abc import Callable
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numba.core.config
from numba import njit as njit
from numba import prange as prange

from graycard.methods._kernel_places import SHARED_KERNELS, kernel_root

METHODS = __name__.rpartition(".")[0]
"""The package whose kernels are kept here."""
UNUSED_DAYS = 30
"""Folders of kernels that no process has loaded for so long are removed."""

_NUMBAS_OWN = "UserProvidedCacheLocator,InTreeCacheLocator,UserWideCacheLocator,IPythonCacheLocator"
_IMPORT = re.compile(
    rb"^\s*(?:from|import)\s+(graycard[\w.]*)(?:\s+import\s+(\([^)]*\)|[^\n]*))?", re.MULTILINE
)
_NAME = re.compile(rb"\w+")


def cache_root() -> Path:
    """Return the folder of all compiled kernels; it need not exist."""
    shared = os.environ.get(SHARED_KERNELS)
    return Path(shared) if shared else _own_root()


def link_shared() -> list[str]:
    """Link the kernels that there are by now into the cache of this process, if it is confined.

    Returns:
        The names of the folders that were looked for.
    """
    folders = [folder for folder in _own_root().glob("*") if folder.is_dir()] if _is_confined() else []
    for folder in folders:
        _link_files(cache_root() / folder.name, folder)
    return [folder.name for folder in folders]


def _is_confined() -> bool:
    return bool(os.environ.get(SHARED_KERNELS))


def _link_files(source: Path, folder: Path) -> None:
    """Link the files of a folder into another, but for those that it has."""
    for path in source.iterdir() if source.is_dir() else ():
        link = folder / path.name
        if not link.exists():
            link.unlink(missing_ok=True)
            link.symlink_to(path)


def _own_root() -> Path:
    """Return the folder that this process writes kernels to."""
    chosen = numba.core.config.CACHE_DIR  # pyright: ignore[reportAttributeAccessIssue]  # set by its import
    return kernel_root(chosen)


def package_folder(package: str) -> Path:
    """Return the folder of a package, such as ``graycard.methods``, wherever the installation maps it.

    Nothing of it is imported here: every kernel would depend on all of that.
    """
    spec = find_spec(package)
    if spec is None or spec.origin is None:
        raise ModuleNotFoundError(f"expected a package {package}, got none. Run `pip install -e .`")
    return Path(spec.origin).parent


@cache
def reached_files(path: Path) -> frozenset[Path]:
    """Return a source file of graycard and all files of it that the file imports, directly or not."""
    found, todo = set(), [Path(path).resolve()]
    while todo:
        file = todo.pop()
        if file not in found:
            found.add(file)
            todo += _imported_files(file)
    return frozenset(found)


@cache
def _imported_files(path: Path) -> tuple[Path, ...]:
    """Files of the modules that a file names after ``from`` and ``import``, where they exist.

    The package of a module is executed too, but what it re-exports cannot enter a kernel unless it is named.
    """
    named = []
    for source, names in _IMPORT.findall(path.read_bytes()):
        named += [source.decode(), *(f"{source.decode()}.{name.decode()}" for name in _NAME.findall(names))]
    return tuple(file for file in map(_file_of, named) if file is not None)


@cache
def _file_of(module: str) -> Path | None:
    """Return the source file of a module of graycard by its dotted name; None for anything else."""
    inside = module.startswith(f"{METHODS}.")
    package = METHODS if inside else METHODS.partition(".")[0]
    base = package_folder(package).joinpath(*module.removeprefix(package).split(".")[1:])
    files = (base / "__init__.py", base.with_suffix(".py"))
    return next((file.resolve() for file in files if file.is_file()), None)


@cache
def code_digest(path: Path) -> str:
    """Return a SHA-256 over a source file and all files of graycard that it reaches, hexadecimal."""
    digest = hashlib.sha256()
    for file in sorted(reached_files(path), key=lambda file: (file.name, str(file))):
        digest.update(hashlib.sha256(file.read_bytes()).digest())
    return digest.hexdigest()


class KernelCacheLocator:
    """Place of the compiled kernels of one source file, in the form that Numba asks for."""

    def __init__(self, function: Callable[..., Any], path: Path) -> None:
        self._line = function.__code__.co_firstlineno
        self._digest = code_digest(path)
        self._folder = _own_root() / f"{path.parent.name}{path.stem}-{self._digest[:16]}"

    @classmethod
    def from_function(cls, py_func: Callable[..., Any], py_file: str) -> "KernelCacheLocator | None":
        """Return the place for a function; None for a function that is not graycard's, or without a place."""
        path = Path(py_file).resolve()
        if not path.is_relative_to(package_folder(METHODS).resolve()):
            return None
        found = cls(py_func, path)
        try:
            found.ensure_cache_path()
        except OSError:
            return None
        return found

    def ensure_cache_path(self) -> None:
        """Make the folder, and note that it is in use.

        Raises:
            OSError: It cannot be written to.
        """
        self._folder.mkdir(parents=True, exist_ok=True)
        tempfile.TemporaryFile(dir=self._folder).close()
        os.utime(self._folder)
        if _is_confined():
            _link_files(cache_root() / self._folder.name, self._folder)

    def get_cache_path(self) -> str:
        """Return the folder."""
        return str(self._folder)

    def get_source_stamp(self) -> str:
        """Return what must be equal for a compiled kernel to be taken: the hash of the code it reaches."""
        return self._digest

    def get_disambiguator(self) -> str:
        """Return what tells functions of one name apart: the line."""
        return str(self._line)


def remove_unused(root: Path, now: float | None = None) -> list[Path]:
    """Remove folders of kernels that have not been used for :data:`UNUSED_DAYS` days and return them."""
    limit = (time.time() if now is None else now) - UNUSED_DAYS * 86400
    folders = [p for p in Path(root).glob("*-" + "?" * 16) if p.is_dir() and p.stat().st_mtime < limit]
    for folder in folders:
        shutil.rmtree(folder, ignore_errors=True)
    return folders


def _use_kernel_cache() -> None:
    """Put this cache before Numba's own places, for graycard's functions alone."""
    if not getattr(numba.core.config, "CACHE_LOCATOR_CLASSES", ""):  # before Numba 0.62 there was none
        ours = f"{__name__}.{KernelCacheLocator.__name__}"
        numba.core.config.CACHE_LOCATOR_CLASSES = (  # pyright: ignore[reportAttributeAccessIssue]  # likewise
            f"{ours},{_NUMBAS_OWN}"
        )


_use_kernel_cache()  # before the first kernel is declared, which asks for its place at once
