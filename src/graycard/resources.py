# SPDX-License-Identifier: Apache-2.0
"""Cores and memory that this process may use: those of the machine, or less in a container or a batch job.

Docker, Kubernetes and Slurm limit a process by control groups of Linux, versions 1 and 2. Neither
:func:`os.cpu_count` nor psutil knows of them. What counts is the tightest limit of the group that a process
is in and of all groups around it. Files and their meaning are those of the kernel's
``Documentation/admin-guide/cgroup-v2.rst`` and ``cgroup-v1/memory.rst``, and of
``Documentation/scheduler/sched-bwc.rst``.
"""

import os
from collections.abc import Iterator
from math import ceil
from pathlib import Path

import psutil

_GROUPS = Path("/sys/fs/cgroup")
_OWN = Path("/proc/self/cgroup")
"""Names the groups that a process is in, a line each: number, controllers, path."""


def usable_cores() -> int:
    """Return how many cores this process may use; a part of a core counts as one."""
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    return max(1, min([cores, *(ceil(quota) for quota in _quotas())]))


def total_memory() -> int:
    """Return the memory that this process may use, in bytes, whoever uses it now."""
    return min([psutil.virtual_memory().total, *(limit for limit, _ in _memory_limits())])


def available_memory() -> int:
    """Return how much of it is free, in bytes; files that the system keeps in memory count as free."""
    rooms = (max(0, limit - used) for limit, used in _memory_limits())
    return min([psutil.virtual_memory().available, *rooms])


def _quotas() -> Iterator[float]:
    """Yield the cores that each group may use in the mean, where that is limited."""
    for folder in _groups_of("cpu"):
        one_file, two = _read(folder / "cpu.max").split(), ("cpu.cfs_quota_us", "cpu.cfs_period_us")
        words = one_file or [_read(folder / name) for name in two]
        quota, period = (_number(word) for word in (*words, "", "")[:2])
        if quota and period:
            yield quota / period


def _memory_limits() -> Iterator[tuple[int, int]]:
    """Yield the bytes that each group may use, and uses without files that were not read lately."""
    for folder in _groups_of("memory"):
        for most, now, file in (
            ("memory.max", "memory.current", "inactive_file"),
            ("memory.limit_in_bytes", "memory.usage_in_bytes", "total_inactive_file"),
        ):
            if limit := _number(_read(folder / most)):
                words = _read(folder / "memory.stat").split()
                parts = dict(zip(words[::2], words[1::2], strict=False))
                yield limit, max(0, _number(_read(folder / now)) - _number(parts.get(file, "")))


def _groups_of(controller: str) -> Iterator[Path]:
    """Yield folders of the groups that limit this process, the innermost first.

    In a container the path can be one of the host, which is not there; the container's own is then the root.
    """
    for line in _read(_OWN).splitlines():
        _, controllers, path = (*line.split(":", 2), "", "")[:3]
        if controllers and controller not in controllers.split(","):
            continue
        root = _GROUPS / controller if controllers else _GROUPS  # version 1 has a tree for each
        inner = root / os.path.normpath(f"/{path}").lstrip("/")
        yield from (folder for folder in (inner, *inner.parents) if folder.is_relative_to(root))


def _read(path: Path) -> str:
    """Return the text of a file of the kernel; empty where there is none."""
    try:
        return path.read_text(encoding="ascii", errors="replace").strip()
    except OSError:
        return ""


def _number(word: str) -> int:
    """Return a number of the kernel; 0 for ``max``, -1 and whatever else sets no limit."""
    return int(word) if word.isdecimal() else 0
