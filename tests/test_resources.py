# SPDX-License-Identifier: Apache-2.0
"""Cores and memory in containers and batch jobs, by made-up files of the kernel."""

import os
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import pytest

from graycard import resources

GIB = 2**30
Tree = Callable[[str, dict[str, str]], None]


@pytest.fixture
def tree(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Tree:
    """Write what the kernel says of a machine with 8 cores and 32 GiB, of which 20 are free."""
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: set(range(8)), raising=False)
    machine = SimpleNamespace(total=32 * GIB, available=20 * GIB)
    monkeypatch.setattr("psutil.virtual_memory", lambda: machine)
    monkeypatch.setattr(resources, "_GROUPS", tmp_path / "cgroup")
    monkeypatch.setattr(resources, "_OWN", tmp_path / "own")

    def write(own: str, files: dict[str, str]) -> None:
        (tmp_path / "own").write_text(own)
        for name, text in files.items():
            path = tmp_path / "cgroup" / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text)

    return write


def found() -> tuple[int, float, float]:
    return resources.usable_cores(), resources.total_memory() / GIB, resources.available_memory() / GIB


NONE = (8, 32.0, 20.0)
V1 = "6:memory:/docker/12ab\n4:cpu,cpuacct:/docker/12ab\n1:name=systemd:/docker/12ab\n0::/\n"
CASES: dict[str, tuple[str, dict[str, str], tuple[int, float, float]]] = {
    "no groups": ("", {}, NONE),
    "no limits": (
        "0::/a\n",
        {"a/cpu.max": "max 100000", "a/memory.max": "max", "a/memory.current": "99"},
        NONE,
    ),
    "a container of version 2": (
        "0::/\n",
        {"cpu.max": "200000 100000\n", "memory.max": f"{4 * GIB}\n", "memory.current": f"{GIB}\n"},
        (2, 4.0, 3.0),
    ),
    "a part of a core more": ("0::/\n", {"cpu.max": "150000 100000"}, (2, 32.0, 20.0)),
    "less than a core": ("0::/\n", {"cpu.max": "20000 100000"}, (1, 32.0, 20.0)),
    "more than the machine": (
        "0::/\n",
        {"cpu.max": "6400000 100000", "memory.max": str(900 * GIB), "memory.current": "0"},
        NONE,
    ),
    "files in memory are free": (
        "0::/\n",
        {
            "memory.max": str(8 * GIB),
            "memory.current": str(7 * GIB),
            "memory.stat": f"anon {GIB}\nfile {6 * GIB}\ninactive_file {5 * GIB}\n",
        },
        (8, 8.0, 6.0),
    ),
    "a job within a user's limit": (
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
    "over its limit": ("0::/\n", {"memory.max": str(GIB), "memory.current": str(2 * GIB)}, (8, 1.0, 0.0)),
    "version 1, whose path is the host's": (
        V1,
        {
            "cpu/cpu.cfs_quota_us": "300000\n",
            "cpu/cpu.cfs_period_us": "100000\n",
            "memory/memory.limit_in_bytes": str(4 * GIB),
            "memory/memory.usage_in_bytes": str(3 * GIB),
            "memory/memory.stat": f"cache 5\ninactive_file 7\ntotal_inactive_file {GIB}\n",
        },
        (3, 4.0, 2.0),
    ),
    "version 1 without limits": (
        V1,
        {
            "cpu/docker/12ab/cpu.cfs_quota_us": "-1\n",
            "cpu/docker/12ab/cpu.cfs_period_us": "100000\n",
            "memory/docker/12ab/memory.limit_in_bytes": "9223372036854771712\n",
            "memory/docker/12ab/memory.usage_in_bytes": str(3 * GIB),
        },
        NONE,
    ),
    "another tree's limits": (V1, {"cpu.max": "max", "memory/other/memory.limit_in_bytes": str(GIB)}, NONE),
    "a path out of the tree": (
        "0::/../../x\n",
        {"memory.max": str(GIB), "../memory.max": "1"},
        (8, 1.0, 1.0),
    ),
    "odd lines": ("nonsense\n\n0::\n", {"cpu.max": "", "memory.max": "many", "memory.stat": "a b c"}, NONE),
}


@pytest.mark.parametrize("case", CASES)
def test_the_tightest_limit_counts(tree: Tree, case: str):
    own, files, wanted = CASES[case]
    tree(own, files)
    assert found() == wanted


def test_where_affinity_is_not_known_the_cores_of_the_machine_count(
    tree: Tree, monkeypatch: pytest.MonkeyPatch
):
    tree("", {})
    monkeypatch.delattr(os, "sched_getaffinity")
    monkeypatch.setattr(os, "cpu_count", lambda: None)
    assert resources.usable_cores() == 1


def test_on_this_machine_it_is_not_more_than_there_is():
    cores, total, available = found()
    assert 1 <= cores <= (os.cpu_count() or 1)
    assert 0 < available <= total
