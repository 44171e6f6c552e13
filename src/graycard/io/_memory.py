# SPDX-License-Identifier: Apache-2.0
"""Memory: how much is touched at a time, and what becomes of it when it is freed."""

import contextlib
import ctypes
import resource
import sys
from collections.abc import Iterator
from pathlib import Path

BLOCK = 1 << 14
"""Numbers of a block: several arrays of them fit the nearest cache."""
_TRIM_THRESHOLD, _MMAP_THRESHOLD = -1, -3
"""``M_TRIM_THRESHOLD`` and ``M_MMAP_THRESHOLD`` of glibc's ``malloc.h``."""
_KEPT, _LARGEST = 1 << 28, 1 << 25
"""Bytes that may lie idle, and of the largest array that is treated so (old versions take no more)."""

_ALONE = 1 << 20
"""Bytes from which on an array is handed back alone."""


def keep_freed_memory() -> bool:
    """Keep freed memory for the next array instead of handing it back to the system.

    Whatever works on images makes and frees arrays of one size again and again. glibc returns each to the
    system, which then clears the next page by page: a seventh of the time of scoring a scene of 512 x 512.

    Returns:
        Whether the C library took the setting; elsewhere than with glibc nothing changes.
    """
    return _mallopt(_MMAP_THRESHOLD, _LARGEST) and _mallopt(_TRIM_THRESHOLD, _KEPT)


def hand_back_freed_memory() -> bool:
    """Hand memory of arrays of 1 MiB or more back to the system when it is freed, from now on.

    :func:`keep_freed_memory` undoes it. Such arrays take longer to make then. But else much memory is lost
    where arrays of one size come and go while small ones stay: glibc before 2.38 finds no place for an
    aligned block, such as torch's, where one of its very size was.

    Returns:
        As of :func:`keep_freed_memory`.
    """
    return _mallopt(_MMAP_THRESHOLD, _ALONE)


def _mallopt(parameter: int, value: int) -> bool:
    """Change how the C library hands out memory, if it is glibc."""
    if not sys.platform.startswith("linux"):
        return False
    mallopt = getattr(ctypes.CDLL(None), "mallopt", None)
    return bool(mallopt and mallopt(parameter, value))


def blocks(count: int) -> Iterator[slice]:
    """Slices of a long array, for work on each number whose steps shall stay in the cache.

    Examples:
        >>> [(b.start, b.stop) for b in blocks(20000)]
        [(0, 16384), (16384, 20000)]
    """
    return (slice(start, min(start + BLOCK, count)) for start in range(0, count, BLOCK))


def peak_memory_mib(pid: int | None = None) -> float:
    """Return the most memory that a process has held, MiB.

    On Linux from the kernel's high-water mark: what ``getrusage`` says is inherited from the parent.

    Args:
        pid: Of the process; None for this one. Of others only Linux tells: elsewhere it is the most that any
            process has held which this one started and which ended.
    """
    with contextlib.suppress(OSError, KeyError):  # there is no /proc, or the process has ended
        status = Path(f"/proc/{pid or 'self'}/status").read_text()
        lines = dict(line.split(":", 1) for line in status.splitlines() if ":" in line)
        return int(lines["VmHWM"].split()[0]) / 2**10
    peak = resource.getrusage(resource.RUSAGE_SELF if pid is None else resource.RUSAGE_CHILDREN).ru_maxrss
    return peak / 2**20 if sys.platform == "darwin" else peak / 2**10
