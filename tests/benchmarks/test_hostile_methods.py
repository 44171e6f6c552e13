# SPDX-License-Identifier: Apache-2.0
"""However a method ends, its own job fails at once, nothing of it goes on, and the job can run again."""

import os
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from graycard.benchmarks._jobs import FitJob, run_fit
from graycard.io import silent
from graycard.methods.confined import SERVE
from graycard.processes import Ended, Limits, landlock_version, run_all
from graycard.records import Job
from hostile_methods import ENDS

WORDS = {
    "exit": "exit code 0",
    "code": "exit code 7",
    "abort": "exit code -6",
    "segmentation": "exit code -11",
    "fork_and_die": "exit code -6",
    "hang": "expected an end within",
    "descriptors": "expected an end within|closed its",
    "memory": "MemoryError|exit code",
    "garbage": "expected a message",
    "half": "exit code 0",
    "done": "cannot be read",
    "infinity": "expected a finite number",
    "talk": "RuntimeError: bbb",
    "endless": "expected a finite number",
    "disk": "full",
    "system_exit": "SystemExit",
    "interrupt": "KeyboardInterrupt",
    "words": "it cannot say what",
    "parent": "exit code",
}
LIMIT_S = 12.0
SOON_S = 6.0
"""Limit of what does nothing but wait, and ends by it on a busy machine too."""
END_S = 30.0
LIKE_OTHERS = ("code", "abort", "infinity")
"""Ends that differ from others in a number alone: CI has no time for them."""


def job_of(method: str, scene: Path, run: Path) -> FitJob:
    job = Job("dark", scene.name, method, 0, {}, f"hostile_methods:{method}")
    return FitJob(job, "hash", scene, run / "jobs" / method, 1, run / "jobs")


def living_children(tmp_path: Path) -> set[str]:
    """Processes that were started with the environment of this test: others run beside it."""
    found, mark = set(), b"HOSTILE_TEST=" + os.fsencode(tmp_path) + b"\0"
    for path in Path("/proc").glob("[0-9]*/environ"):
        try:
            ours = b"resource_tracker" in b" ".join(_command(path.parent))  # of Python, of this process
            named = mark in path.read_bytes() or os.fsencode(tmp_path) in _command(path.parent)[-1:]
            if named and not ours and path.parent.name != str(os.getpid()):
                found.add(path.parent.name)
        except OSError:
            continue
    return found


def _command(process: Path) -> list[bytes]:
    return (process / "cmdline").read_bytes().rstrip(b"\0").split(b"\0")


@pytest.fixture
def scene(make_scene: Callable[..., Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    (tmp_path / "temporary").mkdir()
    monkeypatch.setenv("HOSTILE_TEST", str(tmp_path))
    monkeypatch.setenv("GRAYCARD_PASS", "HOSTILE_TEST")
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "temporary"))
    return make_scene()


@pytest.mark.parametrize(
    "how", [pytest.param(how, marks=pytest.mark.slow) if how in LIKE_OTHERS else how for how in ENDS]
)
def test_each_end_fails_its_own_job(scene: Path, tmp_path: Path, how: str):
    job, start = job_of(how, scene, tmp_path / "run"), time.monotonic()
    told = []
    limits = Limits(SOON_S if how == "hang" else LIMIT_S, 4096)
    (outcome,) = run_all(
        run_fit, [job], 1, lambda _, words: told.append(words), limits=limits, confines=SERVE
    )
    assert max(map(len, [*told, outcome.reason])) < 30_000
    assert time.monotonic() - start < LIMIT_S + END_S
    assert any(word in outcome.reason for word in WORDS[how].split("|")), outcome.reason
    assert not outcome.fatal
    assert not (job.folder / "job.json").exists()
    assert living_children(tmp_path) == set()
    assert [*(tmp_path / "temporary").iterdir()] == []


def test_who_leaves_children_is_done_and_they_end(scene: Path, tmp_path: Path):
    jobs = [job_of("Leaves", scene, tmp_path / "run")]
    start = time.monotonic()
    (outcome,) = run_all(run_fit, jobs, 1, silent, limits=Limits(60.0, 4096), confines=SERVE)
    assert outcome.reason == ""
    assert time.monotonic() - start < END_S
    assert living_children(tmp_path) == set()
    (again,) = run_all(run_fit, jobs, 1, silent, confines=SERVE)
    assert again.reused


def test_nothing_goes_on_from_one_job_to_the_next_of_a_worker(scene: Path, tmp_path: Path):
    first, second = (
        replace(job_of("Leaves", scene, tmp_path / "run"), folder=tmp_path / "run" / "jobs" / name)
        for name in ("first", "second")
    )
    beside = []

    def look(done: float, doing: str, /) -> None:
        if isinstance(doing, Ended) and doing.startswith("1 of 2:"):
            beside.append(living_children(tmp_path))

    outcomes = run_all(run_fit, [first, second], 1, look, tasks_each=2, confines=SERVE)
    assert [outcome.reason for outcome in outcomes] == ["", ""]
    assert [len(found) for found in beside] == [2], "the worker, and the process that starts confined ones"
    assert living_children(tmp_path) == set()


@pytest.mark.parametrize("how", ["parent", pytest.param("exit", marks=pytest.mark.slow), "words"])
def test_who_ends_badly_does_no_harm_to_the_jobs_after_it(scene: Path, tmp_path: Path, how: str):
    jobs = [job_of(name, scene, tmp_path / "run") for name in (how, "Leaves")]
    bad, good = run_all(run_fit, jobs, 1, silent, tasks_each=5, confines=SERVE)
    assert bad.reason
    assert good.reason == ""


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux lets a process adopt orphans")
def test_a_process_without_session_and_mark_ends_with_its_job(scene: Path, tmp_path: Path):
    jobs = [job_of("Escapes", scene, tmp_path / "run")]
    (outcome,) = run_all(run_fit, jobs, 1, silent, confines=SERVE)
    assert outcome.reason == ""
    assert living_children(tmp_path) == set()


@pytest.mark.skipif(not landlock_version(), reason="this kernel has no Landlock")
def test_a_method_cannot_put_links_where_its_capture_is_copied_to(scene: Path, tmp_path: Path):
    """Else the process that reads the truth would write where they lead."""
    jobs = [job_of("Exchanges", scene, tmp_path / "run")]
    (outcome,) = run_all(run_fit, jobs, 1, silent, confines=SERVE)
    assert outcome.reason == ""
