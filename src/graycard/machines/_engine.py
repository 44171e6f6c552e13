# SPDX-License-Identifier: Apache-2.0
"""Hand jobs to Dask workers, and go on when workers or the scheduler are lost."""

import contextlib
import time
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar, cast
from uuid import uuid4

from graycard import Progress
from graycard.machines._hand import Errand, Placed, do_errand
from graycard.machines._origin import origin
from graycard.machines._spec import ClusterSpec, MachineError
from graycard.processes import USUAL, Ended, Limits, Outcome

if TYPE_CHECKING:
    from distributed import Client, Future

J = TypeVar("J")
A = TypeVar("A")
_LOOK_S = 0.05
"""Time between two looks at what is done."""
_COUNT_S = 1.0
"""Time between two counts of workers."""
_QUIET_S = 30.0
"""Time without an end of a job after which the user is told what is waited for, if it is no job."""
_PATIENCE_S = 600.0
"""Time that a scheduler has to come back."""
_MOST_LOSSES = 5
"""Times that Dask may give a job up before it has failed; it does so when four workers died with it."""


@dataclass(eq=False)
class Machines:
    """A Dask cluster that does jobs as :func:`graycard.processes.run_all` does."""

    spec: ClusterSpec
    new_client: "Callable[[], Client]"
    say: Callable[[str], None]
    patience_s: float = _PATIENCE_S
    _client: "Client | None" = None

    @property
    def threads(self) -> int:
        """Return the threads of each job."""
        return self.spec.threads

    @property
    def where(self) -> str:
        """Return the address of the scheduler, or the cluster that was started for it, in words."""
        return self.spec.address or f"the {self.spec.kind} cluster"

    @property
    def dashboard(self) -> str:
        """Return the link of the dashboard; empty where there is none."""
        return str(self.client.dashboard_link or "")

    @property
    def client(self) -> "Client":
        """Return the connection."""
        assert self._client is not None, "connect() comes first"
        return self._client

    def connect(self) -> None:
        """Connect to the scheduler.

        Raises:
            MachineError: It does not answer.
        """
        try:
            self._client = self.new_client()
        except (OSError, ValueError) as cause:
            raise MachineError(
                f"expected a scheduler at {self.where}, got no answer. Start one with `dask scheduler`, or "
                "mend --scheduler"
            ) from cause

    def is_connected(self) -> bool:
        """Tell whether the scheduler is there."""
        return self.client.status == "running"

    def threads_of_workers(self) -> dict[str, int]:
        """Return the threads of each worker, by its address."""
        return cast("dict[str, int]", self.client.nthreads())  # a coroutine for asynchronous clients alone

    def room(self) -> dict[bool, int]:
        """Return the threads of those workers that offer what a job asks for, one with a GPU and one without.

        Raises:
            OSError: The scheduler is lost.
        """
        if self.client.scheduler is None:
            raise OSError("the scheduler is gone")
        # what `scheduler_info` returns is a copy that a callback of the client may have emptied meanwhile
        told = cast("dict[str, Any]", self.client.sync(self.client.scheduler.identity, n_workers=-1))
        workers = [(one["nthreads"], one.get("resources", {})) for one in told["workers"].values()]
        asked = {gpu: self.spec.asked(gpu=gpu) for gpu in (True, False)}
        return {gpu: sum(n for n, has in workers if _offers(has, asked[gpu])) for gpu in asked}

    def jobs_at_a_time(self) -> int:
        """Return how many jobs are done at a time, workers that a cluster has yet to start included."""
        asked = 0 if self.spec.kind == "address" else self.spec.workers
        with contextlib.suppress(OSError, TimeoutError):  # a scheduler that was just lost
            return max(1, asked, sum(self.threads_of_workers().values()))
        return max(1, asked)

    def ask(self, question: Callable[[], A]) -> list[A]:
        """Return what each worker answers that is there; none where the scheduler cannot be asked.

        Args:
            question: Importable there.
        """
        if self.client.scheduler is None:
            return []
        with contextlib.suppress(OSError, TimeoutError):
            answers = cast("dict[str, A]", self.client.run(question, on_error="ignore"))
            return [*answers.values()]
        return []

    def reconnect(self) -> None:
        """Wait for a scheduler that was lost.

        Raises:
            MachineError: It does not come back.
        """
        until = time.monotonic() + self.patience_s
        self.say(f"the scheduler at {self.where} is gone; waiting for it to come back")
        self.close()
        while True:
            try:
                self.connect()
                return
            except MachineError as cause:
                if time.monotonic() > until:
                    raise MachineError(
                        f"the scheduler at {self.where} has not answered for {self.patience_s:.0f} s. "
                        "Start it again; the same command then goes on"
                    ) from cause
                time.sleep(1.0)

    def close(self) -> None:
        """Close the connection; jobs that run go on to their end, and leave their results."""
        if self._client is not None:
            with contextlib.suppress(Exception):  # a scheduler that is gone cannot be told
                self._client.close(timeout=5)

    def run_all(
        self,
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
        """Do jobs on the machines; outcomes in the order of the jobs.

        Args:
            work: As in :func:`graycard.processes.run_all`, as all others.
            jobs: As there.
            at_a_time: Without meaning: each thread of a Dask worker does one at a time.
            progress: Called after each job.
            find_cached: As there; asked again before a job is given to a second machine.
            limits: Of each job; memory is that of the spec where none is given.
            tasks_each: As there.
            confines: As there. Such work runs methods, which alone may use GPUs: a job asks for those of the
                spec unless its ``may_use_gpu`` says no.

        Raises:
            MachineError: A job could not write its result, a machine cannot run graycard or has other code of
                it, or the scheduler is lost.
        """
        limits = replace(limits, memory_mib=limits.memory_mib or self.spec.memory_mib)
        errand = Errand(Placed(work, Path.cwd()), limits, tasks_each, confines)
        course = _Course(self, errand, jobs, find_cached, progress)
        course.skip_done(range(len(jobs)))
        course.to_the_end()
        return [course.outcomes[number] for number in range(len(jobs))]


@dataclass(eq=False)
class _Course:
    """Jobs of one stage: those that wait, those that are out, and outcomes."""

    machines: Machines
    errand: Errand
    jobs: Sequence[Any]
    find_cached: Callable[[Any], Outcome | None]
    progress: Progress
    todo: list[int] = field(default_factory=list)
    out: "dict[int, Future]" = field(default_factory=dict)
    outcomes: dict[int, Outcome] = field(default_factory=dict)
    losses: Counter[int] = field(default_factory=Counter)
    room: dict[bool, int] = field(default_factory=lambda: {True: 0, False: 0})
    """Threads of the workers that a job with a GPU can be given to, and one without."""
    counted: float = float("-inf")
    heard: float = field(default_factory=time.monotonic)

    def skip_done(self, numbers: Iterable[int]) -> None:
        """Let those jobs wait that are not done yet."""
        for number in numbers:
            found = self.find_cached(self.jobs[number])
            if found is None:
                self.todo.append(number)
            else:
                self.outcomes[number] = found

    def to_the_end(self) -> None:
        """Do all jobs."""
        try:
            while self.todo or self.out:
                if not self.machines.is_connected():
                    self._begin_again()
                self._hand_out()
                time.sleep(_LOOK_S)
                self._take_in()
        finally:
            for future in self.out.values():
                with contextlib.suppress(Exception):  # the connection may be gone
                    future.cancel()

    def _begin_again(self) -> None:
        """Wait for a lost scheduler, and hand out anew what was not done meanwhile."""
        lost = sorted(self.out)
        self.out.clear()
        self.machines.reconnect()
        self.skip_done(lost)
        self.counted = float("-inf")

    def _hand_out(self) -> None:
        """Give Dask as many jobs as workers have threads: so each that is free takes the next."""
        self._count()
        for gpu in (True, False):
            waiting = (number for number in self.todo if self._on_gpu(number) == gpu)
            for number in [*islice(waiting, max(0, self._free(gpu=gpu)))]:
                self.todo.remove(number)
                self._give(number)

    def _free(self, *, gpu: bool) -> int:
        """Return how many jobs with a GPU, or without, may be handed out; one of each kind may wait."""
        out = Counter(map(self._on_gpu, self.out))
        # those with a GPU take threads from the others; without a worker for them they wait, and take none
        return max(1, self.room[gpu]) - out[gpu] - (0 if gpu else min(out[True], self.room[True]))

    def _give(self, number: int) -> None:
        """Give Dask a job."""
        name = f"{self.errand.work.work.__name__}-{uuid4().hex}"
        given = self.errand, self.jobs[number], origin()
        asked = self.machines.spec.asked(gpu=self._on_gpu(number)) or None
        self.out[number] = self.machines.client.submit(
            do_errand, *given, key=name, resources=asked, pure=False
        )
        if hasattr(self.jobs[number], "words"):
            self.progress(len(self.outcomes) / len(self.jobs), self._at(number))

    def _on_gpu(self, number: int) -> bool:
        """Tell whether a job asks for a GPU: it runs a method that may use one, and the spec has some."""
        runs_method = bool(self.errand.confines) and getattr(self.jobs[number], "may_use_gpu", True)
        return self.machines.spec.gpus > 0 and runs_method

    def _count(self) -> None:
        """Count the threads of workers, now and then; tell the user if nothing can be done."""
        if time.monotonic() < self.counted + _COUNT_S:
            return
        self.counted = time.monotonic()
        with contextlib.suppress(OSError, TimeoutError):  # a scheduler that was just lost
            self.room = self.machines.room()
            if self.counted > self.heard + _QUIET_S:
                self.heard = self.counted
                if words := _awaited(self.machines, map(self._on_gpu, self.out)):
                    self.machines.say(words)

    def _take_in(self) -> None:
        """Take note of what has ended."""
        for number, future in [*self.out.items()]:
            if future.status == "pending":
                continue
            del self.out[number]
            self.heard = time.monotonic()
            if future.status == "finished":
                self._note(number, future)
            elif future.status == "error":
                self._note_error(number, future)
            else:  # cancelled as the scheduler was lost, or forgotten by one that is new
                self.skip_done([number])

    def _note(self, number: int, future: "Future") -> None:
        try:
            outcome = future.result(timeout=60)
        except Exception:  # lost with the worker or the scheduler after its end: what it left is found
            self.skip_done([number])
            return
        if outcome.fatal:
            raise MachineError(outcome.reason)
        self.outcomes[number] = outcome
        words = self._at(number) + " failed" * bool(outcome.reason)
        self.progress(len(self.outcomes) / len(self.jobs), Ended(words))

    def _at(self, number: int) -> str:
        """Return how many jobs have ended, and the name of one."""
        done = f"{len(self.outcomes)} of {len(self.jobs)}"
        return ": ".join(filter(None, (done, getattr(self.jobs[number], "words", ""))))

    def _note_error(self, number: int, future: "Future") -> None:
        from distributed import KilledWorker

        error = cast("BaseException", future.exception())  # a coroutine for asynchronous clients alone
        if not isinstance(error, KilledWorker):
            raise MachineError(
                f"a worker could not run graycard: {type(error).__name__}: {error}. Install graycard there "
                "as it is here"
            ) from error
        self.losses[number] += 1
        if self.losses[number] < _MOST_LOSSES:
            self.skip_done([number])
            return
        times = 4 * _MOST_LOSSES
        reason = f"Its workers died {times} times (out of memory, or machines that end). Ask for more memory"
        self.outcomes[number] = Outcome(reason=reason)


def _awaited(machines: Machines, on_gpu: Iterable[bool]) -> str:
    """Say what jobs wait for that no worker has; empty if for nothing.

    Args:
        machines: The cluster.
        on_gpu: Whether each job that is handed out asks for a GPU.
    """
    if not machines.threads_of_workers():
        return "no worker is there yet; jobs begin with the first"
    room = machines.room()
    lacking = [gpu for gpu in sorted(set(on_gpu)) if not room[gpu]]
    if not lacking:
        return ""
    words = " ".join(f"{name}={count:.0f}" for name, count in machines.spec.asked(gpu=lacking[0]).items())
    return f'no worker offers what a job asks for; start one with `dask worker … --resources "{words}"`'


def _offers(offered: dict[str, float], asked: dict[str, float]) -> bool:
    return all(offered.get(name, 0) >= count for name, count in asked.items())
