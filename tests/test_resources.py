# SPDX-License-Identifier: Apache-2.0
"""Cores and memory in containers and batch jobs, by made-up files of the kernel."""

import os
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import pytest

from graycard import resources

GIB = 2**30
Tree = Callable[[list[str], str, dict[str, str]], None]


@pytest.fixture
def tree(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Tree:
    """Write what the kernel says of a machine with 8 cores and 32 GiB, of which 20 are free."""
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: set(range(8)), raising=False)
    machine = SimpleNamespace(total=32 * GIB, available=20 * GIB)
    monkeypatch.setattr("psutil.virtual_memory", lambda: machine)
    monkeypatch.setattr(resources, "_OWN", tmp_path / "own")
    monkeypatch.setattr(resources, "_MOUNTS", tmp_path / "mounts")

    def write(mounts: list[str], own: str, files: dict[str, str]) -> None:
        at = tmp_path / "cgroup"
        lines = ["23 1 8:1 / / rw - ext4 /dev/a rw", *(line.replace("AT", str(at)) for line in mounts)]
        (tmp_path / "mounts").write_text("\n".join(lines))
        (tmp_path / "own").write_text(own)
        for name, text in files.items():
            path = at / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text)

    return write


def v2(root: str = "/") -> list[str]:
    """Return the mount of the groups of version 2."""
    return [f"24 1 0:22 {root} AT rw,nosuid shared:4 - cgroup2 cgroup2 rw,nsdelegate"]


def v1(root: str = "/") -> list[str]:
    """Return mounts of version 1, and the empty one of version 2 beside them."""
    named = {"cpu,cpuacct": "cpu,cpuacct", "memory": "memory", "systemd": "name=systemd"}
    kept = [f"30 1 0:30 {root} AT/{at} rw - cgroup cgroup rw,{what}" for at, what in named.items()]
    return [*kept, "40 1 0:40 / AT/unified rw - cgroup2 cgroup2 rw"]


def found() -> tuple[int, float, float]:
    return resources.usable_cores(), resources.usable_memory() / GIB, resources.free_memory() / GIB


NONE = (8, 32.0, 20.0)
DOCKER = "6:memory:/docker/12ab\n4:cpuacct,cpu:/docker/12ab\n1:name=systemd:/docker/12ab\n0::/\n"
CASES: dict[str, tuple[list[str], str, dict[str, str], tuple[int, float, float]]] = {
    "no groups": ([], "", {}, NONE),
    "no limits": (
        v2(),
        "0::/a\n",
        {"a/cpu.max": "max 100000", "a/memory.max": "max", "a/memory.current": "99"},
        NONE,
    ),
    "a container of version 2": (
        v2(),
        "0::/\n",
        {"cpu.max": "200000 100000\n", "memory.max": f"{4 * GIB}\n", "memory.current": f"{GIB}\n"},
        (2, 4.0, 3.0),
    ),
    "a container that sees the host's path": (
        v2("/pod/12ab"),
        "0::/pod/12ab/inner\n",
        {"cpu.max": "200000 100000", "inner/memory.max": str(4 * GIB), "inner/memory.current": "0"},
        (2, 4.0, 4.0),
    ),
    "a part of a core more": (v2(), "0::/\n", {"cpu.max": "150000 100000"}, (2, 32.0, 20.0)),
    "less than a core": (v2(), "0::/\n", {"cpu.max": "20000 100000"}, (1, 32.0, 20.0)),
    "more than the machine": (
        v2(),
        "0::/\n",
        {"cpu.max": "6400000 100000", "memory.max": str(900 * GIB), "memory.current": "0"},
        NONE,
    ),
    "files in memory are free": (
        v2(),
        "0::/\n",
        {
            "memory.max": str(8 * GIB),
            "memory.current": str(7 * GIB),
            "memory.stat": f"anon {GIB}\nfile {5 * GIB}\nshmem {GIB // 2}\ninactive_file {GIB}\n"
            f"active_file {3 * GIB}\nslab_reclaimable {GIB}\n",
        },
        (8, 8.0, 6.0),
    ),
    "a job within a user's limit": (
        v2(),
        "0::/slurm/user/job\n",
        {
            "slurm/user/memory.max": str(6 * GIB),
            "slurm/user/memory.current": str(5 * GIB),
            "slurm/user/job/memory.max": str(8 * GIB),
            "slurm/user/job/memory.current": str(GIB),
            "slurm/user/job/cpu.max": "400000 100000",
            "slurm/cpu.max": "300000 100000",
        },
        (3, 6.0, 1.0),
    ),
    "over its limit": (
        v2(),
        "0::/\n",
        {"memory.max": str(GIB), "memory.current": str(2 * GIB)},
        (8, 1.0, 0.0),
    ),
    "a container of version 1": (
        v1("/docker/12ab"),
        DOCKER,
        {
            "cpu,cpuacct/cpu.cfs_quota_us": "300000\n",
            "cpu,cpuacct/cpu.cfs_period_us": "100000\n",
            "memory/memory.limit_in_bytes": str(4 * GIB),
            "memory/memory.usage_in_bytes": str(3 * GIB),
            "memory/memory.stat": f"inactive_file 7\ntotal_inactive_file {GIB}\ntotal_active_file {GIB}\n",
        },
        (3, 4.0, 3.0),
    ),
    "version 1 without limits": (
        v1(),
        DOCKER,
        {
            "cpu,cpuacct/docker/12ab/cpu.cfs_quota_us": "-1\n",
            "cpu,cpuacct/docker/12ab/cpu.cfs_period_us": "100000\n",
            "memory/docker/12ab/memory.limit_in_bytes": "9223372036854771712\n",
            "memory/docker/12ab/memory.usage_in_bytes": str(3 * GIB),
        },
        NONE,
    ),
    "limits of others": (
        v1(),
        DOCKER,
        {"memory/docker/34/memory.limit_in_bytes": str(GIB), "systemd/cpu.max": "1 1"},
        NONE,
    ),
    "a path out of the tree": (
        v2(),
        "0::/../../x\n",
        {"memory.max": str(2 * GIB), "memory.current": "0", "x/memory.max": "1", "../memory.max": "1"},
        (8, 2.0, 2.0),
    ),
    "odd lines": (
        [*v2(), "", "nonsense", " - ", "a - cgroup2"],
        "nonsense\n\n0::\n",
        {"cpu.max": "", "memory.max": "many", "memory.stat": "a b c"},
        NONE,
    ),
}


@pytest.mark.parametrize("case", CASES)
def test_the_tightest_limit_counts(tree: Tree, case: str):
    mounts, own, files, wanted = CASES[case]
    tree(mounts, own, files)
    assert found() == wanted


@pytest.mark.parametrize(("cores", "quota", "usable"), [(6, "max", 6), (6, "300000", 3), (None, "max", 1)])
def test_where_affinity_is_not_known_the_cores_of_the_machine_count(
    tree: Tree, monkeypatch: pytest.MonkeyPatch, cores: int | None, quota: str, usable: int
):
    tree(v2(), "0::/\n", {"cpu.max": f"{quota} 100000"})
    monkeypatch.delattr(os, "sched_getaffinity")
    monkeypatch.setattr(os, "cpu_count", lambda: cores)
    assert resources.usable_cores() == usable


def test_on_this_machine_it_is_not_more_than_there_is():
    cores, usable, free = found()
    assert 1 <= cores <= (os.cpu_count() or 1)
    assert 0 <= free <= usable
