# SPDX-License-Identifier: Apache-2.0
"""Do cases of all kinds in turn in a child process that is watched, and keep the inputs of faults."""

import json
import os
import select
import shutil
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import count
from pathlib import Path

import psutil

from fuzzer.child import MOST_S, Room, attack, steps_of
from fuzzer.kinds import KINDS
from fuzzer.outcome import Outcome, Report

MOST_WALL_S = 4 * MOST_S
"""Seconds by the clock after which a case hangs: the machine may do other things, too."""
KEPT = 3
"""Inputs that are kept of each fault."""


@dataclass(frozen=True)
class Budget:
    """Number of cases and time of a run."""

    cases: int | None = None
    seconds: float | None = None
    seed: int = 1
    kinds: tuple[str, ...] = tuple(KINDS)

    @staticmethod
    def from_environment(cases: int, kinds: Sequence[str]) -> "Budget":
        """Read ``FUZZ_CASES``, ``FUZZ_SECONDS``, ``FUZZ_SEED`` and ``FUZZ_KINDS`` (parts of names).

        Args:
            cases: How many where the environment says neither cases nor seconds.
            kinds: Which, where it does not.
        """
        says = os.environ.get
        told, seconds, wanted = says("FUZZ_CASES"), says("FUZZ_SECONDS"), says("FUZZ_KINDS")
        if not (told or seconds):
            return Budget(cases, kinds=tuple(kinds))
        chosen = [name for name in KINDS if not wanted or any(part in name for part in wanted.split(","))]
        limit = None if seconds is None else float(seconds)
        return Budget(int(told) if told else None, limit, int(says("FUZZ_SEED", "1")), tuple(chosen))

    def plan(self) -> Iterator[tuple[str, int]]:
        """Yield kinds and numbers in rounds, without end where only the time is bounded."""
        done = 0
        for number in count():
            for name in self.kinds:
                weight = KINDS[name].weight if number else 1
                for n in range(weight):
                    if self.cases is not None and done == self.cases:
                        return
                    done += 1
                    yield name, 0 if number == 0 else 1 + (number - 1) * weight + n


def fuzz(budget: Budget, root: Path, keep: Path) -> Report:
    """Do cases until the budget is spent.

    Args:
        budget: How much is tried.
        root: Folder with the corpus; what cases write goes beside it.
        keep: Folder that inputs of faults are copied to.
    """
    report, end = Report(budget.seed), time.monotonic() + (budget.seconds or float("inf"))
    with _Child(root, budget.seed) as child:
        for name, number in budget.plan():
            if time.monotonic() > end:
                break
            outcome = child.do(name, number)
            if outcome.fault:
                outcome = _keep(outcome, report, root, keep)
            elif number == 0 and outcome.refused:
                outcome = replace(outcome, fault=f"the unchanged input is refused: {outcome.detail}")
            report.add(outcome)
    return report


def _keep(outcome: Outcome, report: Report, root: Path, keep: Path) -> Outcome:
    """Copy the input of a fault that was not seen often yet."""
    if sum(known.fault == outcome.fault for known in report.faults) >= KEPT:
        return outcome
    folder = keep / f"{outcome.kind.replace(' ', '-').replace(':', '')}-{outcome.number}"
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    source = Room(root).input
    with suppress(shutil.Error):  # a pipe cannot be copied
        shutil.copytree(source, folder / "in", symlinks=True, dirs_exist_ok=True)
    told = [outcome.fault, *outcome.steps, "", outcome.detail]
    (folder / "fault.txt").write_text("\n".join(told), encoding="utf-8", errors="replace")
    return replace(outcome, kept=str(folder))


class _Child:
    """The process that does cases; a new one comes where one has crashed or hangs."""

    def __init__(self, root: Path, seed: int) -> None:
        self._root, self._seed = root, seed
        self._process: subprocess.Popen[str] | None = None
        self._answers = -1

    def __enter__(self) -> "_Child":
        return self

    def __exit__(self, *_: object) -> None:
        self._end()

    def do(self, name: str, number: int) -> Outcome:
        """Do one case, and say what came of it."""
        process = self._started()
        assert process.stdin is not None
        process.stdin.write(json.dumps([name, number]) + "\n")
        process.stdin.flush()
        fault, line = self._wait(process)
        if not fault:
            found = json.loads(line)
            return Outcome(**{**found, "steps": tuple(found["steps"])})
        self._end()
        room, seeds = Room(self._root), steps_of(self._seed, KINDS[name], number)
        room.lay(KINDS[name])
        said = attack(KINDS[name], room, seeds)
        return Outcome(
            name, number, fault, steps=said, detail=(self._root / "stderr.txt").read_text()[-4000:]
        )

    def _started(self) -> "subprocess.Popen[str]":
        if self._process is None:
            reading, writing = os.pipe()
            paths = [str(Path(__file__).parents[1]), *filter(None, sys.path)]
            threads = dict.fromkeys(("OMP_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"), "1")
            with (
                open(self._root / "stdout.txt", "a") as out,
                open(self._root / "stderr.txt", "w") as err,
            ):
                self._process = subprocess.Popen(
                    [sys.executable, "-m", "fuzzer.child", str(writing), str(self._root), str(self._seed)],
                    stdin=subprocess.PIPE,
                    stdout=out,
                    stderr=err,
                    text=True,
                    pass_fds=[writing],
                    env=os.environ
                    | threads
                    | {"PYTHONPATH": os.pathsep.join(paths), "PYTHONDONTWRITEBYTECODE": "1"},
                )
            os.close(writing)
            self._answers = reading
        return self._process

    def _wait(self, process: "subprocess.Popen[str]") -> tuple[str, str]:
        """Return a fault, or the line of the answer."""
        start, spent, line = time.monotonic(), _cpu_s(process.pid), b""
        while not line.endswith(b"\n"):
            ready, _, _ = select.select([self._answers], [], [], 0.5)
            if ready:
                part = os.read(self._answers, 65536)
                if not part:
                    return f"the process ended ({process.wait()})", ""
                line += part
            elif _cpu_s(process.pid) - spent > 2 * MOST_S or time.monotonic() - start > MOST_WALL_S:
                return "it hangs", ""
        return "", line.decode()

    def _end(self) -> None:
        if self._process is not None:
            with suppress(psutil.NoSuchProcess):
                for one in psutil.Process(self._process.pid).children(recursive=True):
                    one.kill()
            self._process.kill()
            self._process.wait()
            if self._process.stdin is not None:
                self._process.stdin.close()
            os.close(self._answers)
            self._process = None


def _cpu_s(number: int) -> float:
    try:
        times = psutil.Process(number).cpu_times()
    except psutil.Error:
        return 0.0
    return times.user + times.system
