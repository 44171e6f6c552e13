# SPDX-License-Identifier: Apache-2.0
"""Kill a bench at random times, again and again, and hold its end against one that nobody disturbed.

``python tests/helpers/kill_bench.py --kills 100``. A bench on a tiny suite is killed some times in a row,
then runs to its end. Its scenes, predictions, scores and comparison have to be those of the undisturbed run
to the bit, and no other file, temporary folder or process may be left. After SIGTERM and SIGINT nothing may
be left at once. Linux alone: processes are found in ``/proc`` by a mark in their environment.
"""

import argparse
import hashlib
import json
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

MARK = "GRAYCARD_KILLED_BENCH"
TINY = """[render]
width = 64
height = 64
train_views = 6
test_views = 2
samples = 16
[[scenes]]
track = "tabletop"
family = "glossy-table"
seed = 1000
"""
"""Part of a suite: one scene, as small as can be."""
SUITE = f"""
name = "killed"
version = 1
title = "As small as can be, with fits that go on from stages"
{TINY}[[methods]]
name = "gray"
[[methods]]
name = "do-nothing"
settings = {{ iterations = 40, surfels = 200 }}
[[methods]]
name = "removal"
settings = {{ iterations = 40, surfels = 200 }}
priors = {{ source = "oracle", severity = 2 }}
"""
STOPPED = {"SIGTERM": signal.SIGTERM, "SIGINT": signal.SIGINT}
KINDS = ("all", "bench", "worker", *STOPPED)
"""The bench with its workers, the bench alone, one worker alone; what a user or a cluster sends."""
PATIENCE_S = 1800.0
"""Time after which a bench hangs: on a busy machine a whole one takes minutes."""
_LEAST_SHARE = 0.25
"""Share of the undisturbed time within which any bench is killed: one that goes on has to begin too."""
_TIMES = {"wall_s", "started", "cost", "environment", "machine"}
"""Keys of records that differ from run to run, and from machine to machine."""


@dataclass
class Trial:
    """Folder of the benches, time that one takes, and faults that were found."""

    root: Path
    rng: random.Random
    jobs: int
    suite: str = SUITE
    options: tuple[str, ...] = ()
    """Further options of the bench."""
    undisturbed_s: float = 0.0
    reference: dict[str, str] = field(default_factory=dict)
    kills: Counter[str] = field(default_factory=Counter)
    compared: int = 0
    failures: list[str] = field(default_factory=list)

    @property
    def temporary(self) -> Path:
        """Folder of all temporary files of the benches."""
        return self.root / "tmp"

    @property
    def run(self) -> Path:
        """The run folder."""
        return self.root / "run"

    def start(self) -> subprocess.Popen[str]:
        """Start a bench."""
        suite = self.root / "killed.toml"
        suite.write_text(self.suite)
        command = [sys.executable, "-m", "graycard", "bench", str(suite), "--out", str(self.run)]
        return subprocess.Popen(
            [*command, "--jobs", str(self.jobs), *self.options],
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            env=self.environment(),
        )

    def environment(self) -> dict[str, str]:
        """Return the environment of processes that are found again by their mark."""
        self.temporary.mkdir(exist_ok=True)
        mark = {MARK: str(self.root), "TMPDIR": str(self.temporary), "OMP_WAIT_POLICY": "passive"}
        return {**os.environ, **mark}

    def to_the_end(self) -> str:
        """Let a bench end by itself; return what it printed."""
        with self.start() as bench:
            printed = _printed(bench)
        if bench.returncode != 0:
            self.failures.append(
                f"exit code {bench.returncode} of a bench that nobody killed: {printed[-800:]}"
            )
        return printed

    def begin(self) -> None:
        """Run undisturbed, twice: the first run may compile kernels."""
        self.to_the_end()
        shutil.rmtree(self.run)
        clock = time.monotonic()
        self.to_the_end()
        self.undisturbed_s = time.monotonic() - clock
        self.reference = fingerprint(self.run)
        self.failures += [f"undisturbed: {left}" for left in self.left()]
        shutil.rmtree(self.run)

    def kill_once(self, most_s: float) -> float | None:
        """Start a bench and kill it, unless it ends before its time comes.

        Args:
            most_s: Time after which it is killed at the latest.

        Returns:
            The time after which it was killed; None for one that ended by itself.
        """
        kind, time_s, killed = self.rng.choice(KINDS), self.rng.uniform(0, most_s), False
        before = self.files_left()  # of one that was killed without warning
        with self.start() as bench:
            try:
                bench.wait(time_s)
            except subprocess.TimeoutExpired:
                killed = _killed(bench, kind, self)
            printed = _printed(bench)
        self.kills[kind] += killed
        if kind in STOPPED and bench.returncode == 128 + STOPPED[kind]:  # else it had not begun, or ended
            if "Traceback" in printed:
                self.failures.append(f"{kind}: {printed[-800:]}")
            left = [what for what in self.left() if what not in before]
            self.failures += [f"{kind} after {time_s:.2f} s, process {bench.pid}: {what}" for what in left]
        return time_s if killed else None

    def left(self) -> list[str]:
        """Return what a bench has left behind, once nothing of it ends any more."""
        until = time.monotonic() + 5
        while processes(self) and time.monotonic() < until:
            time.sleep(0.05)
        return [*(f"process {name}" for name in processes(self).values()), *self.files_left()]

    def files_left(self) -> list[str]:
        """Return the temporary files, locks and half-written files that are there."""
        names = (p for p in self.run.rglob(".*") if p.suffix == ".lock" or _is_partial_file(p))
        temporary = [f"temporary {path.name}" for path in self.temporary.iterdir()]
        return temporary + [str(path.relative_to(self.run)) for path in names]

    def compare(self) -> None:
        """Let the bench end, and hold it against the undisturbed one."""
        self.to_the_end()
        self.failures += [f"left at the end: {left}" for left in self.left()]
        self.failures += self.differences()
        self.compared += 1
        shutil.rmtree(self.run)

    def differences(self) -> list[str]:
        """Return the files of the run that are not as in the undisturbed one."""
        found = fingerprint(self.run)
        names = sorted(found.keys() | self.reference.keys())
        return [
            f"{'lacks' if name not in found else 'other' if name in self.reference else 'has also'}: {name}"
            for name in names
            if found.get(name) != self.reference.get(name)
        ]


def _printed(bench: subprocess.Popen[str]) -> str:
    """Return what a bench printed, once it has ended; one that hangs is killed."""
    try:
        return bench.communicate(timeout=PATIENCE_S)[0]
    except BaseException:
        bench.kill()
        raise


def _is_partial_file(path: Path) -> bool:
    """Tell a file in the writing from the folder of a scene in the making, which a rendering goes on from."""
    return path.name.endswith(".partial") and not (path / "truth" / "stamp.json").is_file()


def _killed(bench: subprocess.Popen[str], kind: str, trial: Trial) -> bool:
    """Kill; tell whether there was anything to kill."""
    if kind in STOPPED:
        bench.send_signal(STOPPED[kind])
        return True
    workers = [pid for pid in processes(trial) if pid != bench.pid]
    if kind == "worker":
        workers = trial.rng.sample(workers, min(1, len(workers)))
    victims = [*([] if kind == "worker" else [bench.pid]), *([] if kind == "bench" else workers)]
    for pid in victims:
        try:
            os.kill(pid, signal.SIGKILL)
        except ProcessLookupError:
            continue
    return bool(victims)


def processes(trial: Trial) -> dict[int, str]:
    """Return the processes of benches that run, with their command lines."""
    mark = f"{MARK}={trial.root}".encode()
    found = {}
    for entry in Path("/proc").glob("[0-9]*"):
        try:
            if mark in (entry / "environ").read_bytes().split(b"\0"):
                found[int(entry.name)] = (entry / "cmdline").read_bytes().replace(b"\0", b" ").decode()[:200]
        except OSError:
            continue
    return {pid: command for pid, command in found.items() if command and pid != os.getpid()}


def fingerprint(run: Path) -> dict[str, str]:
    """Return the hash of each file of a run; of records without times and costs.

    Costs of scenes are left out: a run has those of the scenes that it rendered in one go.
    """
    return dict(_fingerprints(run))


def _fingerprints(run: Path) -> Iterator[tuple[str, str]]:
    timed: dict[str, Callable[[bytes], bytes]] = {"run.json": _untimed, "job.json": _untimed}
    for path in sorted(run.rglob("*")):
        name = path.relative_to(run).as_posix()
        if path.is_dir() or name.startswith("rendering/"):
            continue
        shows_times = name.startswith("report/") or path.name == "scoring.json"
        content = b"" if shows_times else path.read_bytes()
        yield name, hashlib.sha256(timed.get(path.name, bytes)(content)).hexdigest()


def _untimed(content: bytes) -> bytes:
    return json.dumps(_without_times(json.loads(content))).encode()


def _without_times(data: Any) -> Any:
    if isinstance(data, dict):
        return {key: _without_times(value) for key, value in data.items() if key not in _TIMES}
    return [_without_times(value) for value in data] if isinstance(data, list) else data


def kill_benches(root: Path, kills: int, seed: int = 0, jobs: int = 2, most_s: float = float("inf")) -> Trial:
    """Kill benches so many times, or as often as time allows.

    Args:
        root: An empty folder.
        kills: Number of kills.
        seed: Of times and kinds of kills.
        jobs: Fits at a time.
        most_s: Begin no other kill after so many seconds.
    """
    trial, clock = Trial(root.resolve(), random.Random(seed), jobs), time.monotonic()
    trial.begin()
    say(f"undisturbed: {trial.undisturbed_s:.1f} s, {len(trial.reference)} files", *trial.failures)
    while trial.kills.total() < kills and time.monotonic() - clock < most_s:
        left_s = trial.undisturbed_s  # until the bench ends, if all goes on from where it was
        for _ in range(trial.rng.randint(1, 6)):
            if trial.kills.total() == kills or time.monotonic() - clock >= most_s:
                break
            if (time_s := trial.kill_once(left_s)) is None:
                break
            left_s = max(left_s - time_s, _LEAST_SHARE * trial.undisturbed_s)
        trial.compare()
        say(f"{trial.kills.total()} kills, {trial.compared} compared", *trial.failures)
    return trial


def say(*lines: str) -> None:
    """Write lines at once."""
    sys.stdout.write("".join(f"{line}\n" for line in lines))
    sys.stdout.flush()


def main() -> int:
    """Kill as the command line asks; 1 if anything was wrong."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--kills", type=int, default=100)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--seconds", type=float, default=float("inf"), help="begin no other kill after this")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="killed-") as root:
        trial = kill_benches(Path(root), given.kills, given.seed, given.jobs, given.seconds)
    say(f"{dict(trial.kills)}, {trial.compared} compared, {len(trial.failures)} failures")
    return 1 if trial.failures else 0


if __name__ == "__main__":
    raise SystemExit(main())
