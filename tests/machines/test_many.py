# SPDX-License-Identifier: Apache-2.0
"""Benches on Dask workers: the same bits as of worker processes, whatever dies meanwhile."""

import os
import random
import shutil
import socket
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import cast

import pytest

from kill_bench import TINY, Trial
from kill_cluster import Cluster, forget, kept, kill_while_running, reference_of
from slurm_nodes import NODES, lacking, slurm

pytest.importorskip("distributed", reason="needs distributed (`pip install 'graycard[cluster]'`)")
pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(sys.platform != "linux", reason="finds processes in /proc"),
]

KILLS = int(os.environ.get("GRAYCARD_KILLS", "6"))
SUITE = f"""
name = "tiny"
version = 1
title = "As small as can be"
seeds = [0, 1]
{TINY}[[methods]]
name = "gray"
[[methods]]
name = "do-nothing"
settings = {{ iterations = 40, surfels = 200 }}
"""


@pytest.fixture(scope="module")
def trial() -> Iterator[Trial]:
    """A tiny suite with what worker processes make of it; a short path, as sockets are in it."""
    with tempfile.TemporaryDirectory(prefix="many-") as root:
        made = Trial(Path(root).resolve(), random.Random(0), 2, suite=SUITE)
        made.reference = reference_of(made)
        assert made.failures == []
        yield made


def check_same(trial: Trial, *options: str) -> str:
    """Run the bench with some options; it has to end as worker processes do, and leave nothing.

    Returns:
        What it printed.
    """
    trial.options = options
    try:
        printed = trial.to_the_end()
        assert trial.failures == []
        assert "dashboard: http" in printed
        assert trial.differences() == []
        return printed
    finally:
        forget(trial)


def test_workers_of_this_machine_give_the_same_bits(trial: Trial) -> None:
    check_same(trial, "--scheduler", "local")
    assert trial.left() == []


def test_a_scene_that_workers_render_in_parts_has_the_same_bits(trial: Trial) -> None:
    shutil.rmtree(trial.run / "dataset")
    printed = check_same(trial, "--scheduler", "local")
    assert "rendering parts: " in printed


OTHER = (
    """hostname other-machine && mount -t proc proc /proc && mount -t tmpfs tmpfs /dev/shm && exec "$@" """
)
UNSHARE = ("unshare", "--pid", "--uts", "--mount", "--fork", "--kill-child", "sh", "-c", OTHER, "sh")


def can_unshare() -> bool:
    try:
        return subprocess.run([*UNSHARE, "true"], capture_output=True, check=False).returncode == 0
    except OSError:
        return False


@pytest.mark.skipif(not can_unshare(), reason="needs the right to make namespaces")
def test_four_workers_on_two_machines_give_the_same_bits(
    trial: Trial, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The second machine has another name, other process ids and other mounts. Locks are files."""
    from distributed import Client

    monkeypatch.setenv("GRAYCARD_LOCKS", "files")
    with kept(Cluster(trial, size=4, before=((), UNSHARE))) as cluster:
        with Client(cluster.address, timeout=60, set_as_default=False) as client:
            client.wait_for_workers(4, timeout=120)
            hosts = cast("dict[str, str]", client.run(socket.gethostname))
        assert sorted(hosts.values()) == sorted([socket.gethostname(), "other-machine"] * 2)
        check_same(trial, "--scheduler", cluster.address)


def test_workers_and_schedulers_that_are_killed_lose_nothing(tmp_path: Path) -> None:
    """`GRAYCARD_KILLS=30` for that many kills of workers; one of a scheduler for each six."""
    found = kill_while_running(tmp_path, KILLS, max(1, KILLS // 6), seed=KILLS)
    assert found.failures == []
    assert found.kills == {"worker": KILLS, "scheduler": max(1, KILLS // 6)}


PAGE = Path(__file__).parents[2] / "docs" / "how-to" / "many-machines.md"


def block(begin: str) -> str:
    """Return the block of the page that begins so."""
    _, found, rest = PAGE.read_text(encoding="utf-8").partition(begin)
    assert found
    return begin + rest.partition("```")[0]


@pytest.mark.skipif(bool(lacking()), reason=lacking() or "Slurm is there")
def test_batch_jobs_of_slurm_give_the_same_bits(trial: Trial, monkeypatch: pytest.MonkeyPatch) -> None:
    """Two nodes, a worker each, by the file of the page."""
    pytest.importorskip("dask_jobqueue", reason="needs dask-jobqueue (`pip install 'graycard[cluster]'`)")
    root = trial.root / "slurm"
    root.mkdir()
    monkeypatch.chdir(root)
    (root / "machines.toml").write_text(block('kind = "slurm"'))
    with slurm(root) as environment:
        for name in ("SLURM_CONF", "PATH"):
            monkeypatch.setenv(name, environment[name])
        check_same(trial, "--scheduler", str(root / "machines.toml"))
        told = (root / "slurmctld.log").read_text()
    assert {node for node in NODES if f"NodeList={node}" in told} == {*NODES}


@pytest.mark.skipif(bool(lacking()), reason=lacking() or "Slurm is there")
def test_a_job_array_of_slurm_gives_the_same_bits(trial: Trial) -> None:
    """Three parts by the script of the page, and a last call that gathers."""
    root = trial.root / "array"
    root.mkdir()
    shown = "graycard bench mine.toml --out runs/mine"
    ours = f"bench {trial.root}/killed.toml --out {trial.run}"
    script = block("#!/bin/sh")
    assert shown in script
    (root / "array.sh").write_text(script.replace(shown, f"{sys.executable} -m graycard {ours}"))
    with slurm(root) as environment:
        told = {**trial.environment(), **environment}
        subprocess.run(["sbatch", "--wait", "array.sh"], env=told, cwd=root, check=True)
    parts = [(root / f"part-{number}.txt").read_text() for number in (1, 2, 3)]
    assert all(", 0 failures" in told for told in parts), parts
    before = {path: path.stat().st_mtime_ns for path in trial.run.glob("jobs/*/*/*/*.json")}
    trial.options = ()
    trial.to_the_end()
    assert trial.failures == []
    assert {path: path.stat().st_mtime_ns for path in trial.run.glob("jobs/*/*/*/*.json")} == before
    assert trial.differences() == []
    forget(trial)
