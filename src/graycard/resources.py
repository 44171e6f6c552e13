# SPDX-License-Identifier: Apache-2.0
"""Cores and memory that this process may use: those of the machine, or less in a container or a batch job.

Docker, Kubernetes, systemd and Slurm, where it is set up so, limit processes by control groups of Linux, of
version 1 or 2. Neither :func:`os.cpu_count` nor psutil knows of them. The tightest limit counts, of the group
that this process is in and of those around it. Limits of ``ulimit`` do not count. Files mean what the
kernel's ``admin-guide/cgroup-v2.rst``, ``admin-guide/cgroup-v1/memory.rst`` and ``scheduler/sched-bwc.rst``
say.
"""

import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from math import ceil
from pathlib import Path, PurePosixPath

import psutil

_OWN = Path("/proc/self/cgroup")
"""Groups that this process is in, a line each: number, controllers (none: version 2), path."""
_MOUNTS = Path("/proc/self/mountinfo")
"""Mounts, those of groups among them; see ``proc_pid_mountinfo(5)``."""


def usable_cores() -> int:
    """Return how many cores this process may use; a part of a core counts as one."""
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    return max(1, min([cores, *(ceil(quota) for quota in _quotas())]))


def usable_memory() -> int:
    """Return the memory that this process may use, in bytes, if no other used any."""
    return min([psutil.virtual_memory().total, *(limit for limit, _ in _memory_limits())])


def free_memory() -> int:
    """Return the memory that this process may still use, in bytes.

    What the system gives back when it is short of memory counts as free, such as files that it keeps.
    """
    rooms = (max(0, limit - used) for limit, used in _memory_limits())
    return min([psutil.virtual_memory().available, *rooms])


def _quotas() -> Iterator[float]:
    """Yield the cores that each group may use in the mean, where that is limited."""
    for group in _groups_of("cpu"):
        if group.version == 2:
            quota, _, period = _read(group.folder / "cpu.max").partition(" ")
        else:
            quota, period = (_read(group.folder / f"cpu.cfs_{name}_us") for name in ("quota", "period"))
        if _number(quota) and _number(period):
            yield _number(quota) / _number(period)


@dataclass(frozen=True, slots=True)
class _Names:
    """Files of a group, and lines of its ``memory.stat`` with what the kernel can give back."""

    limit: str
    used: str
    reclaimable: tuple[str, ...]


_MEMORY = {
    1: _Names("memory.limit_in_bytes", "memory.usage_in_bytes", ("total_inactive_file", "total_active_file")),
    2: _Names("memory.max", "memory.current", ("inactive_file", "active_file", "slab_reclaimable")),
}


def _memory_limits() -> Iterator[tuple[int, int]]:
    """Yield the bytes that each group may use, and those that it uses and cannot give back."""
    for group in _groups_of("memory"):
        names = _MEMORY[group.version]
        if limit := _number(_read(group.folder / names.limit)):
            parts = _pairs(_read(group.folder / "memory.stat"))
            reclaimable = sum(_number(parts.get(name, "")) for name in names.reclaimable)
            yield limit, max(0, _number(_read(group.folder / names.used)) - reclaimable)


@dataclass(frozen=True, slots=True)
class _Group:
    """A control group that limits this process."""

    version: int
    folder: Path


def _groups_of(controller: str) -> Iterator[_Group]:
    """Yield the groups that limit this process, the innermost first."""
    for version, root, mount in _trees_of(controller):
        for line in _read(_OWN).splitlines():
            _, controllers, path = (*line.split(":", 2), "", "")[:3]
            named = controllers.split(",") if controllers else []
            if (version == 2 and not named) or (version == 1 and controller in named):
                inner = _within(path, root)
                yield from (_Group(version, mount / part) for part in (inner, *inner.parents))


def _within(path: str, root: str) -> PurePosixPath:
    """Return the path of a group from the one that is mounted; that itself where the path leads out of it."""
    group = PurePosixPath(path)
    is_inside = ".." not in group.parts and group.is_relative_to(root)
    return group.relative_to(root) if is_inside else PurePosixPath()


def _trees_of(controller: str) -> Iterator[tuple[int, str, Path]]:
    """Yield trees of groups: the version, the group at the top of what is mounted, and where that is."""
    for line in _read(_MOUNTS).splitlines():
        before, _, after = line.partition(" - ")
        places, (kind, _, options) = before.split()[3:5], (*after.split(), "", "", "")[:3]
        is_ours = kind == "cgroup2" or (kind == "cgroup" and controller in options.split(","))
        if is_ours and len(places) == 2:
            yield (2 if kind == "cgroup2" else 1), places[0], Path(places[1])


def _pairs(text: str) -> Mapping[str, str]:
    """Return names and values of lines such as ``anon 4096``."""
    return {name: value for name, _, value in (line.partition(" ") for line in text.splitlines())}


def _read(path: Path) -> str:
    """Return the text of a file of the kernel; empty where there is none."""
    try:
        return path.read_text(encoding="utf-8", errors="replace").strip()
    except OSError:
        return ""


def _number(word: str) -> int:
    """Return a number of the kernel; 0 for ``max``, -1 and whatever else sets no limit."""
    return int(word) if word.strip().isdecimal() else 0
