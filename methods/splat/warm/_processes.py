# SPDX-License-Identifier: Apache-2.0
"""Compiled kernels: which kernels are compiled already, and processes that compile the others.

Numba compiles in one thread at a time, and keeps what it compiled on disk. Processes of their own therefore
compile, and this one loads what they kept.
"""

import hashlib
import os
import platform
import subprocess
import sys
import time
from collections.abc import Iterable, Sequence
from pathlib import Path

import numba
from llvmlite import binding

from graycard import Progress, UnknownNameError
from graycard.io import file_lock, silent
from graycard.methods._numba import cache_root, code_digest, remove_unused
from graycard.methods.splat.warm import _jobs
from graycard.methods.splat.warm._jobs import JOBS, PARTS
from graycard.resources import usable_cores

WAIT = 0.1
"""Seconds between two looks at how far the processes are."""


def warmed(parts: Sequence[str], progress: Progress = silent) -> list[str]:
    """Do what :func:`graycard.methods.splat.warm_kernels` says.

    Raises:
        UnknownNameError: There is no such part.
    """
    stamps = stamps_folder()
    missing = missing_jobs(parts)
    if not missing or not _is_writable(stamps):
        return []
    remove_unused(cache_root())
    with file_lock(stamps / "lock", lambda who: progress(0.0, f"waiting for kernels of {who}")):
        _compile_apart([name for name in missing if not _stamp(stamps, name).exists()], stamps, progress)
    left = [name for name in missing if not _stamp(stamps, name).exists()]
    for number, name in enumerate(left, len(missing) - len(left)):
        progress(number / len(missing), f"compiling kernels: {name}")
        compile_here([name])
    progress(1.0, "kernels are compiled")
    return missing


def missing_jobs(parts: Sequence[str]) -> list[str]:
    """Return the names of the jobs of parts that the cache lacks.

    Raises:
        UnknownNameError: There is no such part.
    """
    stamps = stamps_folder()
    return [name for name in _jobs_of(parts) if not _stamp(stamps, name).exists()]


def compile_here(names: Iterable[str]) -> None:
    """Compile jobs in this process, one after the other, and note that the cache has them.

    Raises:
        UnknownNameError: There is no such job.
    """
    stamps = stamps_folder()
    stamps.mkdir(parents=True, exist_ok=True)
    for name in names:
        if name not in JOBS:
            raise UnknownNameError("job of the engine", name, list(JOBS))
        JOBS[name].run()
        _stamp(stamps, name).touch()


def stamps_folder() -> Path:
    """Return the folder beside the kernels that holds an empty file for each job that is in the cache.

    Its name depends on all that makes Numba compile again: code, processor and versions.
    """
    digest = hashlib.sha256(code_digest(Path(_jobs.__file__)).encode())
    processor = os.environ.get("NUMBA_CPU_NAME") or binding.get_host_cpu_name()
    features = os.environ.get("NUMBA_CPU_FEATURES") or binding.get_host_cpu_features().flatten()
    versions = numba.__version__, platform.python_version(), platform.machine()
    digest.update("\n".join([processor, features, *versions]).encode())
    return cache_root() / f"compiled-{digest.hexdigest()[:16]}"


def hands(names: Iterable[str], count: int) -> list[list[str]]:
    """Deal jobs to so many processes, the longest first, each to the one that has least to do."""
    dealt: list[list[str]] = [[] for _ in range(count)]
    for name in sorted(names, key=lambda one: -JOBS[one].seconds):
        min(dealt, key=lambda hand: sum(JOBS[one].seconds for one in hand)).append(name)
    return dealt


def _jobs_of(parts: Iterable[str]) -> list[str]:
    """Return the names of the jobs of parts, each once.

    Raises:
        UnknownNameError: There is no such part.
    """
    found: dict[str, None] = {}
    for part in parts:
        if part not in PARTS:
            raise UnknownNameError("part of the engine", part, list(PARTS))
        found |= dict.fromkeys(PARTS[part])
    return list(found)


def _compile_apart(names: Sequence[str], stamps: Path, progress: Progress) -> None:
    """Compile jobs in other processes; those that die leave jobs without a stamp."""
    if not names:
        return
    processes = [_started(hand) for hand in hands(names, min(len(names), usable_cores()))]
    try:
        while any(process.poll() is None for process in processes):
            done = sum(_stamp(stamps, name).exists() for name in names)
            progress(done / len(names), f"compiling kernels, once for all fits: {done} of {len(names)}")
            time.sleep(WAIT)
    finally:
        for process in processes:
            process.kill()
            process.wait()


def _started(names: Sequence[str]) -> subprocess.Popen[bytes]:
    """Start a process that compiles jobs."""
    command = [sys.executable, "-P", "-m", "graycard.methods.splat.warm", *names]
    nowhere = subprocess.DEVNULL
    return subprocess.Popen(command, stdin=nowhere, stdout=nowhere, stderr=nowhere)


def _stamp(stamps: Path, name: str) -> Path:
    return stamps / name.replace(", ", "-").replace(" ", "-")


def _is_writable(folder: Path) -> bool:
    """Say whether files can be written to a folder, which is made if it is missing."""
    probe = folder / f"probe-{os.getpid()}"
    try:
        folder.mkdir(parents=True, exist_ok=True)
        probe.touch()
        probe.unlink()
    except OSError:
        return False
    return True
