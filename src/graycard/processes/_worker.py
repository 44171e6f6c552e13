# SPDX-License-Identifier: Apache-2.0
"""The process that does jobs: what it is told and tells, and the limits that it works under."""

import contextlib
import os
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

from graycard import Progress
from graycard.io import keep_freed_memory, silent
from graycard.processes._confined import start_ahead
from graycard.processes._family import lead_family

OFTEN_S = 0.1
"""Time between two messages of progress."""


@dataclass(frozen=True, slots=True)
class Step:
    """Progress of a job."""

    done: float
    doing: str


_pipe: Connection | None = None
"""To the process that waits for this one; None where this process is no worker."""


def worker_progress() -> Progress:
    """Return progress that is shown where the jobs were started; silent in a process that is no worker."""
    pipe, told = _pipe, 0.0
    if pipe is None:
        return silent

    def report(done: float, doing: str, /) -> None:
        nonlocal told
        if time.monotonic() >= told:
            told = time.monotonic() + OFTEN_S
            pipe.send(Step(done, doing))

    return report


def serve(pipe: Connection, output: Connection, memory_mib: int, folder: Path, confines: str) -> None:
    """Do jobs until there are no more; the first message is the work.

    Args:
        pipe: Of work and jobs, and of outcomes.
        output: Takes what the process prints.
        memory_mib: Memory that the process may write to.
        folder: For temporary files, of its children too.
        confines: What the process runs that the first job confines, ``module:function``; empty for none.
    """
    global _pipe
    lead_family()
    _print_to(output)
    _limit_memory(memory_mib)
    os.environ["TMPDIR"] = tempfile.tempdir = str(folder)
    keep_freed_memory()
    if confines:
        with contextlib.suppress(OSError):  # there is no room now: the first job tries again, and says so
            start_ahead(confines)  # it imports its modules while this process imports its own
    _pipe = pipe
    work: Callable[[Any], Any] = pipe.recv()
    while (job := pipe.recv()) is not None:
        pipe.send(work(*job))


def _print_to(output: Connection) -> None:
    """Send what this process prints, and what native code in it prints, to a pipe."""
    for number in (1, 2):
        os.dup2(output.fileno(), number)
    output.close()
    text = {"mode": "w", "buffering": 1, "errors": "replace", "closefd": False}
    sys.stdout, sys.stderr = os.fdopen(1, **text), os.fdopen(2, **text)


def _limit_memory(memory_mib: int) -> None:
    """Limit the memory that may be written to: an allocation beyond it is a MemoryError."""
    try:
        import resource
    except ImportError:  # not on this system
        return
    most = memory_mib * 2**20
    _, hard = resource.getrlimit(resource.RLIMIT_DATA)
    if hard != resource.RLIM_INFINITY:
        most = min(most, hard)
    with contextlib.suppress(ValueError, OSError):
        resource.setrlimit(resource.RLIMIT_DATA, (most, hard))
