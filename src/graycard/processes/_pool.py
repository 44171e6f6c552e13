# SPDX-License-Identifier: Apache-2.0
"""Jobs in worker processes, one after another or several at a time."""

import contextlib
import multiprocessing
import os
import shutil
import sys
import tempfile
import threading
import time
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from multiprocessing import resource_tracker
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from pathlib import Path
from typing import Any, TypeVar

from graycard import MethodError, OutputError, Progress
from graycard.io import output_error, printable
from graycard.processes._confined import words_of_end
from graycard.processes._family import end_family, end_orphans, marked, temporary_folder
from graycard.processes._interrupts import uninterrupted
from graycard.processes._outcome import Ended, Outcome
from graycard.processes._worker import Step, serve

J = TypeVar("J")
DAY_S = 24 * 3600.0
_GRACE_S = 5.0
"""Time in which a process that has no more jobs is to end by itself."""
_LOOK_S = 0.2
"""Time between two looks for dead workers: their children may keep their pipes open."""
_PRINTED = 2**16
"""Bytes of a worker's output that are taken at a time."""


@dataclass(frozen=True, slots=True)
class Limits:
    """Limits of one job: enough for any by default, and an end for all."""

    time_s: float | None = DAY_S
    """A job that takes longer has failed; None for no limit."""
    memory_mib: int | None = None
    """Memory that its process may write to; None: that of the machine."""


_STARTING = threading.Lock()
"""Held while a worker starts: the mark that it inherits is in the environment of the whole process."""
USUAL = Limits()
"""Limits of a job where nobody asks for others."""


def _machine_mib() -> int:
    """Return the memory of this machine."""
    return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") // 2**20


@dataclass(eq=False)
class _Worker:
    """A process with the job that it is at."""

    process: BaseProcess
    pipe: Connection
    output: Connection
    mark: str
    folder: Path
    """Its temporary files."""
    tasks: int = 0
    """Jobs that it was given."""
    job: int | None = None
    """Number of the job that it is at."""
    deadline: float | None = None
    started: float = 0.0
    """Time at which it was given its job."""
    done: float = 0.0
    """Share of its job that is done, as the job says."""
    silent: bool = False
    """True once its output has ended."""

    @property
    def open_pipes(self) -> tuple[Connection, ...]:
        """Return the pipes that it may still write to."""
        return (self.pipe,) if self.silent else (self.pipe, self.output)

    def give(self, number: int, job: Any, timeout_s: float | None) -> None:
        """Give it a job."""
        self.job, self.tasks = number, self.tasks + 1
        self.started, self.done = time.monotonic(), 0.0
        self.deadline = None if timeout_s is None else self.started + timeout_s
        with contextlib.suppress(BrokenPipeError, ConnectionResetError):  # its death is met below
            self.pipe.send((job,))

    def heard(self) -> Outcome | Step | None:
        """Return its next message; None where it will send no more."""
        try:
            return self.pipe.recv() if self.pipe.poll() else None
        except (EOFError, ConnectionResetError):
            return None
        except Exception as cause:
            return Outcome(reason=f"expected an outcome that can be sent, got {type(cause).__name__}")

    def show_output(self) -> None:
        """Print what it has printed, control characters as escapes."""
        try:
            text = os.read(self.output.fileno(), _PRINTED)
        except OSError:
            text = b""
        self.silent = not text
        sys.stderr.write(printable(text.decode(errors="replace")))
        sys.stderr.flush()

    def end(self, *, idle: bool) -> None:
        """End it with all that it has started; one that is idle has time to end by itself."""
        if idle:
            with contextlib.suppress(OSError):
                self.pipe.send(None)
            _await_end(self.process)
        assert self.process.pid is not None, "it was started"
        end_family(self.process.pid, self.mark)
        self.process.join()
        patience = time.monotonic() + _GRACE_S  # what was not found may go on printing
        while not self.silent and self.output.poll() and time.monotonic() < patience:
            self.show_output()
        for pipe in (self.pipe, self.output):
            pipe.close()
        shutil.rmtree(self.folder, ignore_errors=True)


@dataclass(eq=False)
class _Pool:
    """Workers, the jobs that wait for one, and the outcomes so far."""

    work: Callable[[Any], Outcome]
    jobs: Sequence[Any]
    todo: deque[int]
    outcomes: dict[int, Outcome]
    progress: Progress
    limits: Limits
    tasks_each: int
    confines: str
    workers: list[_Worker] = field(default_factory=list)

    def run(self, at_a_time: int) -> None:
        """Do all jobs, and end the workers."""
        try:
            self.do(at_a_time)
        finally:
            self.end()

    def do(self, at_a_time: int) -> None:
        """Do all jobs; workers stay."""
        while self.todo or any(worker.job is not None for worker in self.workers):
            self._hand_out(at_a_time)
            self._await()

    def end(self) -> None:
        """End the workers."""
        with uninterrupted():
            while self.workers:
                worker = self.workers.pop()
                worker.end(idle=worker.job is None)

    def _hand_out(self, at_a_time: int) -> None:
        """Give each free worker a job, and start workers as long as there are jobs and room for them."""
        while self.todo:
            free = next((worker for worker in self.workers if worker.job is None), None)
            if free is None and len(self.workers) >= at_a_time:
                return
            if free is None:
                with uninterrupted():  # else one that was just started would be nobody's
                    self.workers.append(free := _start(self.work, self.limits, self.confines))
            number = self.todo.popleft()
            free.give(number, self.jobs[number], self.limits.time_s)
            if hasattr(self.jobs[number], "words"):
                self.tell(self._at(number))

    def _await(self) -> None:
        """Wait until something happens to a worker, and take note of it."""
        deadlines = [worker.deadline for worker in self.workers if worker.deadline is not None]
        patience = min([_LOOK_S, *(max(0.0, deadline - time.monotonic()) for deadline in deadlines)])
        ready = wait([pipe for worker in self.workers for pipe in worker.open_pipes], patience)
        for worker in tuple(self.workers):
            if worker.output in ready:
                worker.show_output()
            if worker.pipe in ready or worker.process.exitcode is not None:
                self._listen(worker)
            elif worker.deadline is not None and time.monotonic() >= worker.deadline:
                limit = f"{self.limits.time_s:g} s"
                words = f"expected an end within {limit}, got none. Give it a longer --timeout"
                self._close(worker, Outcome(reason=words))

    def _listen(self, worker: _Worker) -> None:
        """Take a message of a worker, or note its death."""
        message = worker.heard()
        if isinstance(message, Step):
            worker.done = message.done
            self.tell(": ".join(filter(None, (self._at(worker.job), message.doing))))
        elif message is None:
            _await_end(worker.process)
            self._close(worker, Outcome(reason=words_of_end(worker.process.exitcode)))
        elif worker.tasks >= self.tasks_each or message.reason:
            self._close(worker, message)
        else:
            self._note(worker, message)

    def _close(self, worker: _Worker, outcome: Outcome) -> None:
        """End a worker, and note how its job ended."""
        with uninterrupted():
            self.workers.remove(worker)
            worker.end(idle=not outcome.reason)
        self._note(worker, outcome)

    def _note(self, worker: _Worker, outcome: Outcome) -> None:
        if worker.job is None:
            return
        if outcome.fatal:
            raise OutputError(outcome.reason)
        self.outcomes[worker.job] = outcome
        told = words_of_job(self.jobs[worker.job], outcome, time.monotonic() - worker.started)
        worker.job = worker.deadline = None
        if self.counted:
            self.tell(Ended(f"{self.counted}{told}"))

    @property
    def counted(self) -> str:
        """Return how many jobs have ended, as in ``3 of 12``; empty for a single one without a name."""
        if len(self.jobs) == 1 and not hasattr(self.jobs[0], "words"):
            return ""
        return f"{len(self.outcomes)} of {len(self.jobs)}"

    def _at(self, number: int | None) -> str:
        """Return how many jobs have ended, and the name of one; empty for a single one without a name."""
        words = "" if number is None else getattr(self.jobs[number], "words", "")
        return ": ".join(filter(None, (self.counted, words)))

    def tell(self, doing: str) -> None:
        """Report the share of all jobs that is done."""
        begun = sum(min(max(w.done, 0.0), 1.0) for w in self.workers if w.job is not None)
        self.progress((len(self.outcomes) + begun) / len(self.jobs), doing)


def words_of_job(job: object, outcome: Outcome, seconds: float) -> str:
    """Return how a job ended, to follow a count; the job may say what it is by ``words``."""
    named = getattr(job, "words", "")
    if outcome.reason:
        return f": {named} failed" if named else ", the last one failed"
    return f": {named}, {seconds:.1f} s" if named else ""


def run_all(
    work: Callable[[J], Outcome],
    jobs: Sequence[J],
    at_a_time: int,
    progress: Progress,
    find_cached: Callable[[J], Outcome | None] = lambda job: None,
    limits: Limits = USUAL,
    *,
    tasks_each: int = 1,
    confines: str = "",
) -> list[Outcome]:
    """Do jobs in worker processes; outcomes in the order of the jobs.

    A worker that ends without an outcome (out of memory, a crash in native code, ``os._exit``) fails its own
    job only; a fresh one goes on. Processes that a job has started end with its worker, and workers end with
    the process that started them. What they print is shown with control characters as escapes.

    Args:
        work: Does a job; must be importable by a fresh process.
        jobs: What to do.
        at_a_time: Number of workers.
        progress: Called after each job, and by jobs that use :func:`worker_progress`.
        find_cached: Returns the outcome of a job that need not be done again, else None.
        limits: Time and memory of each job.
        tasks_each: Number of jobs that a worker does before a fresh one takes over; a job that fails is the
            last. More than 1 only for work that leaves nothing behind.
        confines: What a process runs that a job confines (:func:`started`), ``module:function``: it is
            prepared with the worker, so that jobs wait less. Empty for jobs without one.

    Raises:
        OutputError: A job could not write its result.
        MethodError: No process can be started.
    """
    outcomes = {number: found for number, job in enumerate(jobs) if (found := find_cached(job)) is not None}
    todo = deque(number for number in range(len(jobs)) if number not in outcomes)
    end_orphans()
    if todo:
        pool = _Pool(work, jobs, todo, outcomes, progress, limits, tasks_each, confines)
        pool.tell(pool.counted or "starting a process")
        pool.run(at_a_time)
    return [outcomes[number] for number in range(len(jobs))]


class StandingWorker:
    """A worker process that stays from call to call, as one of :func:`run_all` does from job to job."""

    def __init__(
        self, work: Callable[[Any], Outcome], limits: Limits = USUAL, *, tasks_each: int, confines: str
    ) -> None:
        """Describe it; it starts with the first job.

        Args:
            work: Does a job; must be importable by a fresh process.
            limits: Time and memory of each job.
            tasks_each: Number of jobs after which a fresh process takes over, as in :func:`run_all`.
            confines: As in :func:`run_all`.
        """
        end_orphans()
        given = limits, tasks_each, confines
        self._pool = _Pool(work, [], deque(), {}, lambda done, doing: None, *given)

    def do(self, job: Any) -> Outcome:
        """Do a job; one thread may ask at a time.

        Raises:
            OutputError: The job could not write its result.
            MethodError: No process can be started.
        """
        pool = self._pool
        for worker in [one for one in pool.workers if one.process.exitcode is not None]:
            pool.workers.remove(worker)  # it was killed while it had nothing to do
            worker.end(idle=False)
        pool.jobs, pool.outcomes = [job], {}
        pool.todo.append(0)
        try:
            pool.do(1)
        except BaseException:
            pool.todo.clear()
            pool.end()
            raise
        return pool.outcomes[0]

    def end(self) -> None:
        """End its process, with a job that it is at."""
        self._pool.end()

    close = end
    """End, as :func:`contextlib.closing` asks for it."""


def _start(work: Callable[[Any], Outcome], limits: Limits, confines: str) -> _Worker:
    """Start a worker, and tell it what its work is.

    Raises:
        OutputError: There is no room for temporary files.
        MethodError: No process can be started.
    """
    context = multiprocessing.get_context("spawn")
    resource_tracker.ensure_running()  # within the block it would bear the mark, and end with the worker
    with _STARTING, contextlib.ExitStack() as undo, marked() as mark:
        folder = _temporary(mark)
        undo.callback(shutil.rmtree, folder, ignore_errors=True)
        try:
            pipe, far = context.Pipe()
            undo.callback(pipe.close)
            with far:
                output, printed = context.Pipe(duplex=False)
                undo.callback(output.close)
                with printed:
                    given = far, printed, limits.memory_mib or _machine_mib(), folder, confines
                    process = context.Process(target=serve, args=given)
                    process.start()
        except OSError as cause:
            raise MethodError(
                f"expected room for a worker process, got {cause.strerror}. Try fewer --jobs"
            ) from cause
        worker = _Worker(process, pipe, output, mark, folder)
        undo.pop_all()
    try:
        with contextlib.suppress(BrokenPipeError, ConnectionResetError):
            pipe.send(work)
    except BaseException:
        with uninterrupted():
            worker.end(idle=False)
        raise
    return worker


def _temporary(mark: str) -> Path:
    try:
        return temporary_folder(mark)
    except OSError as cause:
        raise output_error(Path(tempfile.gettempdir()), cause) from cause


def _await_end(process: BaseProcess) -> None:
    """Wait a while for the end of a process; ``join`` takes one that closes all its files for ended."""
    patience = time.monotonic() + _GRACE_S
    while process.exitcode is None and time.monotonic() < patience:
        time.sleep(0.01)
