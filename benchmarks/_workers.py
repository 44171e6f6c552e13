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
    at_hand: Callable[[J], Outcome | None] = lambda job: None,
    timeout_s: float | None = None,
) -> list[Outcome]:
    """Do jobs in worker processes, each in a process of its own; outcomes in the order of the jobs.

    A worker that dies (out of memory, a crash in native code) fails its own job only.

    Args:
        work: Does a job; must be importable by a fresh process.
        jobs: What to do.
        at_a_time: Number of workers.
        progress: Called after each job.
        at_hand: Gives the outcome of a job that need not be done again.
        timeout_s: A job that takes longer has failed; None for no limit.

    Raises:
        OutputError: A job could not write its result.
    """
    outcomes = {number: found for number, job in enumerate(jobs) if (found := at_hand(job)) is not None}
    context = multiprocessing.get_context("spawn")
    with ProcessPool(
        max_workers=at_a_time, max_tasks=1, initializer=keep_freed_memory, context=context
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
