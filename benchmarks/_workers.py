# SPDX-License-Identifier: Apache-2.0
"""Jobs in worker processes, one after another or several at a time."""

import multiprocessing
from collections.abc import Callable, Sequence
from concurrent.futures import Future, as_completed
from typing import TypeVar

from pebble import ProcessExpired, ProcessPool

from graycard import OutputError, Progress
from graycard.benchmarks._jobs import Outcome
from graycard.io import keep_freed_memory

J = TypeVar("J")


def run_all(
    work: Callable[[J], Outcome],
    jobs: Sequence[J],
    at_a_time: int,
    progress: Progress,
    find_cached: Callable[[J], Outcome | None] = lambda job: None,
    timeout_s: float | None = None,
    *,
    tasks_each: int = 1,
) -> list[Outcome]:
    """Do jobs in worker processes; outcomes in the order of the jobs.

    A worker that dies (out of memory, a crash in native code) fails its own job only; a fresh one goes on.

    Args:
        work: Does a job; must be importable by a fresh process.
        jobs: What to do.
        at_a_time: Number of workers.
        progress: Called after each job.
        find_cached: Returns the outcome of a job that need not be done again, else None.
        timeout_s: A job that takes longer has failed; None for no limit.
        tasks_each: Number of jobs that a process does before a fresh one takes over. More than 1 only for
            work that leaves nothing behind: the memory of a fit is measured over its whole process.

    Raises:
        OutputError: A job could not write its result.
    """
    outcomes = {number: found for number, job in enumerate(jobs) if (found := find_cached(job)) is not None}
    context = multiprocessing.get_context("spawn")
    with ProcessPool(
        max_workers=at_a_time, max_tasks=tasks_each, initializer=keep_freed_memory, context=context
    ) as pool:
        try:
            todo = [number for number in range(len(jobs)) if number not in outcomes]
            waiting: dict[Future[Outcome], int] = {
                pool.schedule(work, [jobs[n]], timeout=timeout_s): n for n in todo
            }
            for future in as_completed(waiting):
                outcomes[waiting[future]] = _outcome_of(future, timeout_s)
                progress(len(outcomes) / len(jobs), f"{len(outcomes)} of {len(jobs)}")
        except BaseException:
            pool.stop()  # otherwise leaving the block waits for all the rest
            raise
    return [outcomes[number] for number in range(len(jobs))]


def _outcome_of(future: Future[Outcome], timeout_s: float | None) -> Outcome:
    try:
        outcome = future.result()
    except TimeoutError:
        return Outcome(reason=f"expected an end within {timeout_s:g} s, got none. Give it a longer --timeout")
    except ProcessExpired as death:
        return Outcome(
            reason=f"expected the worker to come back, got its death (exit code {death.exitcode}): "
            "out of memory, or a crash in native code. Try fewer --jobs"
        )
    if outcome.fatal:
        raise OutputError(outcome.reason)
    return outcome
