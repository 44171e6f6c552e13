# SPDX-License-Identifier: Apache-2.0
"""How many jobs a process does, and what its death costs."""

from graycard.benchmarks import run_all
from graycard.benchmarks._jobs import Outcome
from graycard.io import silent
from worker_jobs import die_at_one, tell_process


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
