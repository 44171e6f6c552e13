# SPDX-License-Identifier: Apache-2.0
"""Workers: their number of jobs, the cost of their death, and nothing left behind."""

import os
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import pytest

from graycard.benchmarks import run_all
from graycard.io import process_space, silent
from graycard.processes import Limits, Outcome, _family, _pool, worker_progress
from graycard.processes._family import MARK, end_family, end_orphans, marked, temporary_folder
from graycard.processes._interrupts import uninterrupted
from worker_jobs import (
    die_at_one,
    end,
    fork_with_lock,
    leave_with,
    report,
    speak,
    tell_process,
    wait_for,
)


def test_a_process_does_one_job_or_as_many_as_are_said() -> None:
    alone = [outcome.value for outcome in run_all(tell_process, range(2), 1, silent)]
    assert len(set(alone)) == 2
    shared = [outcome.value for outcome in run_all(tell_process, range(3), 1, silent, tasks_each=2)]
    assert shared[0] == shared[1] != shared[2]


def test_a_death_fails_one_job_also_where_a_process_does_several() -> None:
    first, second, third = run_all(die_at_one, range(3), 1, silent, tasks_each=20)
    assert (first.value, third.value) == (0, 2)
    assert "exit code 9" in second.reason


def test_what_is_found_needs_no_process() -> None:
    heard: list[str] = []
    found = run_all(
        tell_process,
        range(3),
        1,
        lambda done, what: heard.append(what),
        lambda n: Outcome(reused=True, value=n),
    )
    assert [outcome.value for outcome in found] == [0, 1, 2]
    assert heard == []


ENDS = {
    "exit 0": "exit code 0",
    "exit 7": "exit code 7",
    "abort": "exit code -6",
    "killed": "exit code -9",
    "descriptors": "closed its files",
    "memory": "exit code 1",
    "hang": "expected an end within 5 s",
    "system exit": "exit code 3",
    "unpicklable": "exit code 1",
}


def test_each_way_to_end_fails_its_own_job_at_once() -> None:
    jobs = [*ENDS, "well"]
    start = time.monotonic()
    outcomes = run_all(end, jobs, 2, silent, limits=Limits(5, 4096))
    found = dict(zip(jobs, outcomes, strict=True))
    assert found["well"] == Outcome(value="well")
    assert {how: words in found[how].reason for how, words in ENDS.items()} == dict.fromkeys(ENDS, True)
    assert time.monotonic() - start < 30


@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="needs /proc")
@pytest.mark.parametrize("how", ["return", "abort"])
def test_children_end_with_their_worker(tmp_path: Path, how: str) -> None:
    (outcome,) = run_all(leave_with, [(how, str(tmp_path))], 1, silent)
    assert outcome.value == ("return" if how == "return" else None)
    ids = (tmp_path / "ids").read_text().split()
    assert len(ids) == 4
    alive = [pid for pid in ids if _state(pid) not in ("", "Z", "X")]
    assert not alive


def test_a_child_does_not_hold_the_lock_of_a_dead_worker(tmp_path: Path) -> None:
    (died,) = run_all(fork_with_lock, [str(tmp_path)], 1, silent)
    assert "exit code -6" in died.reason
    start = time.monotonic()
    (done,) = run_all(wait_for, [(str(tmp_path), 0.0)], 1, silent)
    assert done.value == []
    assert time.monotonic() - start < 20


def test_who_waits_says_for_whom(tmp_path: Path) -> None:
    first, second = run_all(wait_for, [(str(tmp_path), 60.0)] * 2, 2, silent)
    (words,) = first.value or second.value
    assert words.startswith("process ")


def test_what_a_worker_prints_is_shown_without_control_characters(capfd: pytest.CaptureFixture[str]) -> None:
    run_all(speak, ["a\x1b]0;owned\x07b"], 1, silent)
    shown = capfd.readouterr().err
    assert "out a\\x1b]0;owned\\x07b" in shown
    assert "err a\\x1b]0;owned\\x07b" in shown
    assert "raw \\x1b[2J" in shown
    assert "\x1b" not in shown


def test_a_job_may_tell_its_progress() -> None:
    heard: list[tuple[float, str]] = []
    outcomes = run_all(report, range(2), 1, lambda done, what: heard.append((done, what)))
    assert [outcome.value for outcome in outcomes] == [False, False]
    assert heard == [
        (0.0, "0 of 2"),
        (0.25, "0 of 2: half of 0"),
        (0.5, "1 of 2"),
        (0.75, "1 of 2: half of 1"),
        (1.0, "2 of 2"),
    ]
    assert worker_progress() is silent


def interrupted_end(leader: int, mark: str) -> None:
    """End a worker, and be told to end meanwhile."""
    signal.raise_signal(signal.SIGINT)
    end_family(leader, mark)


def test_who_is_told_to_end_while_workers_end_leaves_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    monkeypatch.setattr(_pool, "end_family", interrupted_end)
    with pytest.raises(KeyboardInterrupt):
        run_all(tell_process, range(3), 2, silent, tasks_each=2)
    assert [*tmp_path.iterdir()] == []


def test_who_is_told_to_end_while_a_worker_starts_leaves_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    start, started = _pool._start, []

    def interrupted_start(*given: Any) -> Any:
        started.append(start(*given))
        signal.raise_signal(signal.SIGINT)
        return started[-1]

    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    monkeypatch.setattr(_pool, "_start", interrupted_start)
    with pytest.raises(KeyboardInterrupt):
        run_all(tell_process, range(3), 2, silent)
    assert [worker.process.is_alive() for worker in started] == [False]
    assert [*tmp_path.iterdir()] == []


def be_interrupted(done: list[str]) -> None:
    with uninterrupted():
        with uninterrupted():
            signal.raise_signal(signal.SIGINT)
            done.append("inner")
        done.append("outer")


def test_signals_wait_for_the_end_of_a_block_and_of_those_around_it() -> None:
    done: list[str] = []
    with pytest.raises(KeyboardInterrupt):
        be_interrupted(done)
    assert done == ["inner", "outer"]
    with pytest.raises(KeyboardInterrupt):
        signal.raise_signal(signal.SIGINT)


_BENCH = """
import sys, worker_jobs
from graycard.benchmarks import run_all
from graycard.io import silent
if __name__ == "__main__":
    run_all(worker_jobs.wait_for, [(sys.argv[1], 600.0)], 1, silent)
"""


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux tells a process of the death of its parent")
def test_workers_end_with_a_bench_that_is_killed(tmp_path: Path) -> None:
    script = tmp_path / "bench.py"
    script.write_text(_BENCH)
    places = os.pathsep.join(path for path in sys.path if path)
    bench = subprocess.Popen(
        [sys.executable, str(script), str(tmp_path)], env={**os.environ, "PYTHONPATH": places}
    )
    lock = tmp_path / "lock"
    while not (lock.exists() and lock.read_text()):
        assert bench.poll() is None
        time.sleep(0.1)
    worker = lock.read_text().split()[1]
    bench.kill()
    bench.wait()
    for _ in range(100):
        if _state(worker) in ("", "Z", "X"):
            return
        time.sleep(0.1)
    pytest.fail("the worker outlives its bench")


@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="needs /proc")
def test_orphans_of_a_bench_that_is_gone_are_ended_and_no_others(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A folder for temporary files may be shared by machines whose namespaces have one number."""
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    with marked() as own:
        space, bench, start, number = own.split("-")
    marks = {
        "gone": f"{space}-{bench}-never-{number}",
        "living": own,
        "of a container": f"{space}0-{bench}-never-{number}",
        "": "",
    }
    with monkeypatch.context() as elsewhere:
        elsewhere.setattr(_family, "process_space", lambda: ("another boot", process_space()[1]))
        with marked() as other:
            _, bench, _, number = other.split("-")
            marks["of another machine"] = f"{other.split('-')[0]}-{bench}-never-{number}"
    folders = {name: temporary_folder(mark) for name, mark in marks.items() if mark}
    started = {
        name: subprocess.Popen(["sleep", "600"], env={**os.environ, MARK: mark})
        for name, mark in marks.items()
    }
    end_orphans()
    try:
        assert started["gone"].wait(10) == -9
        assert start != "never"
        assert [name for name, process in started.items() if process.poll() is None] == [
            name for name in marks if name != "gone"
        ]
        assert [name for name, folder in folders.items() if not folder.exists()] == ["gone"]
    finally:
        for process in started.values():
            process.kill()
            process.wait()


STARTER = """
import subprocess, sys, time
from graycard.processes._family import adopt_orphans
adopt_orphans()
waits = "import os, time; print(os.getpid(), flush=True); time.sleep(600)"
start = "subprocess.Popen([sys.executable, '-c', %r], env={}, start_new_session=True)" % waits
again = f"import subprocess, sys; {start}"
subprocess.run([sys.executable, "-c", again], env={}, start_new_session=True, check=True)
time.sleep(600)
"""
LEADER = "import subprocess, sys; subprocess.run([sys.executable, '-c', sys.argv[1]])"


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux lets a process adopt orphans")
def test_who_left_session_and_environment_ends_with_the_worker_above_its_starter() -> None:
    command = [sys.executable, "-c", LEADER, STARTER]
    leader = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, start_new_session=True)
    with leader:
        assert leader.stdout is not None
        detached = leader.stdout.readline().strip()
        assert _state(detached) not in ("", "Z", "X")
        end_family(leader.pid, "no mark at all")
    assert _state(detached) in ("", "Z", "X")


def _state(pid: str) -> str:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0]
    except OSError:
        return ""
