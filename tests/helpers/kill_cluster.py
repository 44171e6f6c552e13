# SPDX-License-Identifier: Apache-2.0
"""Kill Dask workers and the scheduler at random times while a bench runs on them.

``python tests/helpers/kill_cluster.py --workers 30 --schedulers 5``. A bench of 45 jobs, of which five fit
surfels, runs on four Dask workers. Workers and scheduler are killed and started anew, as a service does.
Predictions, scores and comparison have to be those of worker processes on this machine to the bit. No job
may be done again once its ``job.json`` or ``scores.json`` is there. Linux alone.
"""

import argparse
import os
import random
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

from kill_bench import TINY, Trial, fingerprint, say

SUITE = f"""
name = "killed"
version = 1
title = "Small jobs, and five fits"
seeds = [0, 1, 2, 3, 4]
{TINY}[[scenes]]
track = "dark"
family = "corridor"
seed = 1000
[[methods]]
name = "gray"
[[methods]]
name = "input"
[[methods]]
name = "retinex"
[[methods]]
name = "gray"
label = "gray-dark"
settings = {{ reflectance = 0.09 }}
[[methods]]
name = "do-nothing"
tracks = ["tabletop"]
settings = {{ iterations = 40, surfels = 200 }}
"""
_LAST = ("job.json", "scores.json")
"""Files that end a fit and a scoring: each is written once."""
_LOOK_S = 0.2
_MOST_WAIT_S = 6.0
"""Longest time between two kills."""


@dataclass
class Cluster:
    """A scheduler and workers, as processes that are started anew when they end."""

    trial: Trial
    size: int
    port: int = field(default_factory=lambda: _free_port())
    before: Sequence[Sequence[str]] = ((),)
    """Commands that the workers are started by, in turn: those of simulated machines."""
    resources: str = ""
    scheduler: "subprocess.Popen[bytes] | None" = None
    workers: "dict[int, subprocess.Popen[bytes]]" = field(default_factory=dict)
    held: threading.RLock = field(default_factory=threading.RLock)
    ended: threading.Event = field(default_factory=threading.Event)

    @property
    def address(self) -> str:
        """Return the scheduler's address."""
        return f"tcp://127.0.0.1:{self.port}"

    def keep(self) -> None:
        """Start what is not there, again and again."""
        while not self.ended.wait(_LOOK_S):
            with self.held:
                self._start_missing()

    def _start_missing(self) -> None:
        if self.scheduler is None or self.scheduler.poll() is not None:
            self.scheduler = self._dask("scheduler", "--host", "127.0.0.1", "--port", str(self.port))
        for number in range(self.size):
            if number in self.workers and self.workers[number].poll() is None:
                continue
            command = ("worker", self.address, "--nthreads", "1", "--no-nanny", "--memory-limit", "0")
            offered = ("--resources", self.resources) if self.resources else ()
            before = self.before[number % len(self.before)]
            self.workers[number] = self._dask(*command, *offered, before=before)

    def _dask(self, verb: str, *args: str, before: Sequence[str] = ()) -> "subprocess.Popen[bytes]":
        module = f"distributed.cli.dask_{verb}"
        with (self.trial.root / f"{verb}.log").open("ab") as log:
            return subprocess.Popen(
                [*before, sys.executable, "-m", module, *args, "--no-dashboard"],
                stdout=log,
                stderr=log,
                cwd=self.trial.temporary,
                env={**self.trial.environment(), "DASK_DISTRIBUTED__WORKER__PROFILE__ENABLED": "False"},
                start_new_session=True,
            )

    def kill(self, kind: str) -> bool:
        """Kill the scheduler or one worker; tell whether there was one."""
        with self.held:
            running = [p for p in self.workers.values() if p.poll() is None]
            victim = self.scheduler if kind == "scheduler" else self.trial.rng.choice(running or [None])
            if victim is None or victim.poll() is not None:
                return False
            os.kill(victim.pid, signal.SIGKILL)
            victim.wait()
            return True

    def end(self) -> None:
        """End all of it."""
        self.ended.set()
        with self.held:
            for process in (*self.workers.values(), self.scheduler):
                if process is not None:
                    process.kill()
                    process.wait()


def _free_port() -> int:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        return taken.getsockname()[1]


@contextmanager
def kept(cluster: Cluster) -> Iterator[Cluster]:
    """Keep a cluster running for the length of a block."""
    keeper = threading.Thread(target=cluster.keep)
    keeper.start()
    try:
        yield cluster
    finally:
        cluster.end()
        keeper.join()


@dataclass
class Results:
    """Records that end each fit and each scoring, as they were when they were first seen."""

    run: Path
    first: dict[Path, tuple[int, int]] = field(default_factory=dict)
    again: list[str] = field(default_factory=list)
    ended: threading.Event = field(default_factory=threading.Event)

    def watch(self) -> None:
        """Look for records that are written a second time."""
        while not self.ended.wait(_LOOK_S):
            self.look()

    def look(self) -> None:
        """Look once."""
        for path in [found for name in _LAST for found in self.run.glob(f"jobs/*/*/*/{name}")]:
            try:
                found = path.stat().st_ino, path.stat().st_mtime_ns
            except FileNotFoundError:
                found = (0, 0)
            if self.first.setdefault(path, found) != found:
                self.again.append(f"done twice: {path.relative_to(self.run)}")
                self.first[path] = found


def reference_of(trial: Trial) -> dict[str, str]:
    """Run the suite on worker processes of this machine; the scenes stay."""
    trial.to_the_end()
    found = fingerprint(trial.run)
    forget(trial)
    return found


def forget(trial: Trial) -> None:
    """Remove a run, but for its scenes."""
    for path in trial.run.iterdir():
        if path.name != "dataset":
            shutil.rmtree(path) if path.is_dir() else path.unlink()


def kill_while_running(root: Path, workers: int, schedulers: int, seed: int = 0) -> Trial:
    """Kill workers and schedulers so many times during a bench, or until it ends.

    Args:
        root: An empty folder.
        workers: Kills of workers.
        schedulers: Kills of schedulers.
        seed: Of times, kinds and victims.
    """
    trial = Trial(root.resolve(), random.Random(seed), 2, suite=SUITE)
    trial.reference = reference_of(trial)
    if trial.failures:  # without any kill
        return trial
    kinds = ["worker"] * workers + ["scheduler"] * schedulers
    trial.rng.shuffle(kinds)
    with kept(Cluster(trial, size=4)) as cluster:
        trial.options = ("--scheduler", cluster.address)
        while kinds:
            before = len(kinds)
            _one_run(trial, cluster, kinds)
            say(f"{dict(trial.kills)}, {len(kinds)} to go", *trial.failures)
            if len(kinds) == before or trial.failures:
                break
    return trial


def _one_run(trial: Trial, cluster: Cluster, kinds: list[str]) -> None:
    """Run a bench to its end on workers that die, and hold it against the reference."""
    results = Results(trial.run)
    watcher = threading.Thread(target=results.watch)
    killer = threading.Thread(target=_kill_on, args=(trial, cluster, kinds, results.ended))
    watcher.start()
    killer.start()
    try:
        say(trial.to_the_end())
    finally:
        results.ended.set()
        watcher.join()
        killer.join()
    results.look()
    trial.failures += [*results.again, *trial.differences()]
    trial.compared += 1
    forget(trial)


def _kill_on(trial: Trial, cluster: Cluster, kinds: list[str], ended: threading.Event) -> None:
    """Kill at random times, from the first result on, until the bench has ended."""
    while not any(trial.run.glob("jobs/*/*/*/job.json")) and not ended.wait(_LOOK_S):
        pass
    while kinds and not ended.wait(trial.rng.uniform(0, _MOST_WAIT_S)):
        if cluster.kill(kinds[-1]):
            trial.kills[kinds.pop()] += 1


def main() -> int:
    """Kill as the command line asks; 1 if anything was wrong."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--workers", type=int, default=30)
    parser.add_argument("--schedulers", type=int, default=5)
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    clock = time.monotonic()
    with tempfile.TemporaryDirectory(prefix="killed-") as root:
        trial = kill_while_running(Path(root), given.workers, given.schedulers, given.seed)
    spent = time.monotonic() - clock
    say(f"{dict(trial.kills)}, {trial.compared} compared, {len(trial.failures)} failures, {spent:.0f} s")
    return 1 if trial.failures else 0


if __name__ == "__main__":
    raise SystemExit(main())
