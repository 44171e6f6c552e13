# SPDX-License-Identifier: Apache-2.0
"""The files that a confined process may open: its interpreter, libraries, code, and what it is handed."""

import glob
import os
import sys
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from importlib.machinery import all_suffixes
from pathlib import Path

from graycard.processes._landlock import LIST, OF_DEVICES, TO_READ, TO_WRITE

_SYSTEM = (
    "/usr", "/bin", "/sbin", "/lib", "/lib32", "/lib64", "/libx32", "/nix/store", "/gnu/store", "/sys",
    "/etc/ld.so.cache", "/etc/ld.so.conf", "/etc/ld.so.conf.d", "/etc/ld.so.preload", "/etc/alternatives",
    "/etc/localtime", "/etc/timezone", "/etc/os-release", "/etc/lsb-release", "/etc/debian_version",
    "/etc/nsswitch.conf", "/etc/passwd", "/etc/group", "/etc/hosts", "/etc/mime.types", "/etc/ssl",
    "/etc/fonts", "/etc/OpenCL", "/etc/vulkan",
)  # fmt: skip
"""The system's own programs, libraries and settings."""
_PROCESS = (
    "self", "cpuinfo", "meminfo", "stat", "sys", "version", "uptime", "loadavg", "filesystems", "devices",
    "driver/nvidia",
)  # fmt: skip
"""Entries of ``/proc`` that tell of this process or of the machine, and of no other process."""
_DEVICES = (
    "/dev/null", "/dev/zero", "/dev/full", "/dev/random", "/dev/urandom", "/dev/dri", "/dev/kfd",
    "/dev/nvidia*",
)  # fmt: skip
_VARIABLES = ("LD_LIBRARY_PATH", "DRJIT_LIBLLVM_PATH", "DRJIT_LIBOPTIX_PATH", "CUDA_HOME", "CUDA_PATH")
"""Environment variables that name libraries."""
_PREFIXES = (sys.prefix, sys.base_prefix, sys.exec_prefix, sys.base_exec_prefix)
_LIBRARIES = frozenset({"site-packages", "dist-packages"})
"""Names of folders of libraries, which a user may have elsewhere."""


@dataclass(frozen=True, slots=True)
class Places:
    """Files open to a confined process besides interpreter and libraries, and files closed to it."""

    scratch: str
    """Folder of its own, for its files and those that it is handed."""
    readable: tuple[str, ...] = ()
    """Files and folders besides."""
    writable: tuple[str, ...] = ()
    """Folders besides."""
    closed: tuple[str, ...] = ()
    """Data: none of it is opened, even where it lies in a folder of code."""
    opened: tuple[str, ...] = ()
    """Folders in what is closed that are open nonetheless."""


def has_nvidia() -> bool:
    """Tell whether this machine has a GPU of NVIDIA with its driver."""
    return os.path.exists("/dev/nvidiactl")


def is_inside(path: str, folder: str) -> bool:
    """Tell whether a real path is a folder or lies below it."""
    return path == folder or path.startswith(folder.rstrip(os.sep) + os.sep)


def rules_of(places: Places, code: Sequence[str]) -> Iterator[tuple[str, int]]:
    """Yield the rules for Landlock.

    Args:
        places: What is open besides.
        code: Files and folders of code.
    """
    closed = [os.path.realpath(path) for path in places.closed]
    libraries = [part for name in _VARIABLES for part in os.environ.get(name, "").split(os.pathsep) if part]
    system = [*_SYSTEM, *(os.path.join("/proc", name) for name in _PROCESS)]
    for path in _each([*system, *_PREFIXES, *libraries, *code, *places.readable]):
        yield from ((part, TO_READ) for part in open_parts(path, closed))
    for pattern in _DEVICES:
        yield from ((path, OF_DEVICES) for path in glob.glob(pattern))
    if has_nvidia():
        yield os.path.realpath("/proc/self/task"), TO_WRITE  # CUDA names its threads, or does not start
    for path in _each([places.scratch, *places.writable, *places.opened]):
        yield path, TO_WRITE


def open_parts(path: str, closed: Sequence[str]) -> Iterator[str]:
    """Yield a path, or the parts of the folder that hold nothing closed.

    Args:
        path: The file or folder.
        closed: Real paths.
    """
    real = os.path.realpath(path)
    if any(is_inside(real, place) for place in closed):
        return
    if not any(is_inside(place, real) for place in closed):
        yield real
        return
    for name in sorted(_listed(real)):
        yield from open_parts(os.path.join(real, name), closed)


def open_code(entries: Iterable[str], places: Places) -> tuple[list[str], list[tuple[str, int]]]:
    """Return places to import from of which nothing is closed, and the rules that they need.

    Libraries are open as a whole, other folders for modules and packages alone: what else lies there is data.
    A rule of Landlock opens a folder with all below. So a folder of code in which closed data lie is replaced
    by one of links to its other parts.

    Args:
        entries: As in ``sys.path``.
        places: What is closed, and where links may be made.
    """
    closed = [os.path.realpath(path) for path in places.closed]
    found: list[str] = []
    rules: list[tuple[str, int]] = []
    for number, entry in enumerate(entries):
        real = os.path.realpath(entry)
        if any(is_inside(real, place) for place in closed):
            continue
        if any(is_inside(place, real) for place in closed):
            entry = os.path.join(places.scratch, f"code-{number}")
            parts = list(_link_open(real, Path(entry), closed))
            rules += [(part, TO_READ) for part in parts if _is_code(part)]
        elif _is_installed(real) or not os.path.isdir(real):
            rules.append((real, TO_READ))
        else:
            parts = [os.path.realpath(os.path.join(real, name)) for name in _listed(real)]
            rules += [(real, LIST), *((part, TO_READ) for part in parts if _is_code(part))]
        found.append(entry)
    return found, rules


def _is_installed(place: str) -> bool:
    """Tell whether a folder is one of the interpreter or of libraries."""
    prefixes = map(os.path.realpath, _PREFIXES)
    return any(is_inside(place, prefix) for prefix in prefixes) or not _LIBRARIES.isdisjoint(
        Path(place).parts
    )


def _is_code(path: str) -> bool:
    """Tell whether a file can be imported, or a folder holds one that can."""
    names = _listed(path) if os.path.isdir(path) else [path]
    return any(name.endswith(tuple(all_suffixes())) for name in names)


def _link_open(folder: str, target: Path, closed: Sequence[str]) -> Iterator[str]:
    """Make a folder of links to what is not closed in another, and yield what they lead to."""
    target.mkdir()
    for name in _listed(folder):
        path = os.path.join(folder, name)
        real = os.path.realpath(path)
        if any(is_inside(real, place) for place in closed):
            continue
        if any(is_inside(place, real) for place in closed):
            yield from _link_open(real, target / name, closed)
        else:
            (target / name).symlink_to(real)
            yield real


def _listed(folder: str) -> list[str]:
    try:
        return os.listdir(folder)
    except OSError:
        return []


def _each(paths: Iterable[str]) -> Iterator[str]:
    """Yield real paths, each once."""
    yield from dict.fromkeys(os.path.realpath(path) for path in paths)
