# SPDX-License-Identifier: Apache-2.0
"""Run on a Dask worker: hand one job to a worker process of its own, as a bench on one machine does.

A Dask worker never does a job itself. So a crash ends its process alone, limits hold, and code of others
stays in the confined processes of that process. Each thread of a Dask worker has one such process, which
stays for further jobs of the same kind.
"""

import multiprocessing
import os
import socket
import threading
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from multiprocessing import util
from pathlib import Path
from typing import Any

from graycard import GraycardError
from graycard.machines._origin import differences
from graycard.processes import Limits, Outcome, StandingWorker


@dataclass(frozen=True, slots=True)
class Placed:
    """Work in the folder that the bench works in, so that relative paths lead to the same."""

    work: Callable[[Any], Outcome]
    folder: Path

    def __call__(self, job: Any) -> Outcome:
        """Do a job; a fatal outcome where the folder is not."""
        try:
            os.chdir(self.folder)
        except OSError as error:
            got = f"expected {self.folder}, where the bench runs, got {error.strerror}"
            return Outcome(reason=f"{got}. Let all machines share it", fatal=True)
        return self.work(job)


@dataclass(frozen=True, slots=True)
class Errand:
    """The work that all jobs of a stage have in common."""

    work: Placed
    limits: Limits
    tasks_each: int
    confines: str


_here = threading.local()
"""``errand`` and ``worker`` of this thread."""
_workers: list[StandingWorker] = []
"""Workers of all threads; they end with the process."""


def do_errand(errand: Errand, job: Any, origin: Mapping[str, str]) -> Outcome:
    """Do a job in a worker process of this Dask worker.

    Args:
        errand: The work.
        job: What is handed to it.
        origin: Code, versions and weights of the bench, which this machine has to have as well.

    Returns:
        The outcome; a fatal one where this machine cannot do jobs.
    """
    if other := differences(dict(origin)):
        got = ", ".join(other)
        return _fatal(
            f"expected code and weights of the bench, got {got}. Install the same there, and start its "
            "workers again"
        )
    try:
        return _worker_for(errand).do(job)
    except GraycardError as error:
        return _fatal(str(error))


def _fatal(words: str) -> Outcome:
    return Outcome(reason=f"machine {socket.gethostname()}: {words}", fatal=True)


def _worker_for(errand: Errand) -> StandingWorker:
    """Return the worker process of this thread; one that did other work ends first."""
    if getattr(_here, "errand", None) != errand:
        if _workers == []:
            multiprocessing.current_process().daemon = False  # Dask's nanny makes it one that may start none
            util.Finalize(None, _end_all, exitpriority=100)
        if old := getattr(_here, "worker", None):
            _workers.remove(old)
            old.end()
        more = {"tasks_each": errand.tasks_each, "confines": errand.confines}
        _here.worker, _here.errand = StandingWorker(errand.work, errand.limits, **more), errand
        _workers.append(_here.worker)
    return _here.worker


def _end_all() -> None:
    while _workers:
        _workers.pop().end()
