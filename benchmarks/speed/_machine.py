# SPDX-License-Identifier: Apache-2.0
"""State of the machine: its speed and its other work; without both no millisecond means anything."""

import ctypes
import gc
import os
import statistics
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
import psutil

from graycard.resources import usable_cores

QUIET = 0.15
"""Cores that all other processes together may use while a repetition counts."""
SAMPLE_S = 0.002
"""Seconds between two looks at the memory."""


@dataclass(frozen=True, slots=True)
class Patience:
    """Time limits of a measurement."""

    repetitions: int = 5
    """Groups of calls that must count; their median is the figure."""
    seconds: float = 0.25
    """Length of a group: the kernel counts its time in hundredths of a second."""
    budget_s: float = 8.0
    """After this the search for quiet moments ends."""


QUICK = Patience(1, 0.0, 0.0)
"""One call: for tests of everything but the time."""


@dataclass(frozen=True, slots=True)
class Timing:
    """Wall time of a call."""

    ms: float
    """Median over the groups that count (over all, if none does) of the median within each."""
    best_ms: float
    """The shortest call of all."""
    counted: int
    """Groups in which other processes used less than ``QUIET``."""
    rejected: int
    """Groups in which they used more."""
    others: float | None
    """Cores that other processes used, median of the groups behind ``ms``; None where nobody knows."""

    @property
    def disturbed(self) -> bool:
        """Return whether no group was quiet."""
        return self.counted == 0


@dataclass(frozen=True, slots=True)
class _Group:
    ms: float
    best_ms: float
    others: float | None

    @property
    def quiet(self) -> bool:
        return self.others is None or self.others < QUIET


def time_calls(call: Callable[[], object], patience: Patience) -> Timing:
    """Time a call that has been warmed up: groups of calls, of which only quiet ones count.

    Args:
        call: What is timed; it runs once before.
        patience: How often, and how long to wait for quiet.
    """
    call()
    calls = _calls_a_group(call, patience.seconds)
    groups: list[_Group] = []
    end = time.perf_counter() + patience.budget_s
    while sum(group.quiet for group in groups) < patience.repetitions:
        if groups and time.perf_counter() > end:
            break
        groups.append(_time_group(call, calls))
    quiet = [group for group in groups if group.quiet]
    used = quiet or groups
    others = [group.others for group in used if group.others is not None]
    return Timing(
        statistics.median(group.ms for group in used),
        min(group.best_ms for group in groups),
        len(quiet),
        len(groups) - len(quiet),
        statistics.median(others) if others else None,
    )


def _calls_a_group(call: Callable[[], object], seconds: float) -> int:
    start = time.perf_counter()
    call()
    return max(1, round(seconds / max(time.perf_counter() - start, 1e-6)))


def _time_group(call: Callable[[], object], calls: int) -> _Group:
    busy, own, start = busy_s(), time.process_time(), time.perf_counter()
    times = []
    for _ in range(calls):
        before = time.perf_counter()
        call()
        times.append(1e3 * (time.perf_counter() - before))
    own, wall, after = time.process_time() - own, time.perf_counter() - start, busy_s()
    others = None if busy is None or after is None else max(0.0, (after - busy - own) / wall)
    return _Group(statistics.median(times), min(times), others)


def busy_s(stat: Path = Path("/proc/stat")) -> float | None:
    """Processor seconds since the start of the machine in which any core was not idle; None if not told."""
    try:
        ticks = [int(word) for word in stat.read_text().splitlines()[0].split()[1:9]]
        per_second = os.sysconf("SC_CLK_TCK")
    except (OSError, ValueError, IndexError, AttributeError):
        return None
    return (sum(ticks) - ticks[3] - ticks[4]) / per_second if len(ticks) > 4 else None


def peak_memory_mib(call: Callable[[], object]) -> float:
    """By how much one call makes the process grow at its peak, looked at every two milliseconds.

    What the process has freed and not given back is given back first, where the C library is glibc: else the
    call would grow into that, unseen.
    """
    give_back_memory()
    process, done = psutil.Process(), threading.Event()
    before = peak = process.memory_info().rss

    def watch() -> None:
        nonlocal peak
        while not done.wait(SAMPLE_S):
            peak = max(peak, process.memory_info().rss)

    watcher = threading.Thread(target=watch)
    watcher.start()
    try:
        call()
    finally:
        done.set()
        watcher.join()
    return (max(peak, process.memory_info().rss) - before) / 2**20


def give_back_memory() -> bool:
    """Return freed memory to the system; whether this C library can."""
    gc.collect()
    try:
        trim = ctypes.CDLL(None).malloc_trim
    except (AttributeError, OSError, TypeError):
        return False
    trim(0)
    return True


def most_threads() -> int:
    """Threads that Numba and this process may use."""
    from numba.core import config

    return min(usable_cores(), int(config.NUMBA_NUM_THREADS))  # pyright: ignore[reportAttributeAccessIssue]


@contextmanager
def threads(count: int) -> Iterator[None]:
    """Let Numba and torch use so many threads for the length of a block."""
    import numba
    import torch

    before = numba.get_num_threads(), torch.get_num_threads()
    numba.set_num_threads(count)
    torch.set_num_threads(count)
    try:
        yield
    finally:
        numba.set_num_threads(before[0])
        torch.set_num_threads(before[1])


@dataclass(frozen=True, slots=True)
class Peak:
    """Most multiplications and additions that the vector type gets out of the machine."""

    threads: int
    gflops: float
    """Billions of operations a second; a fused multiply-add is two."""
    timing: Timing


def fma_peak(count: int, patience: Patience, rounds: int = 200_000) -> Peak:
    """Operations a second of so many threads that do nothing but independent multiply-adds in registers.

    Args:
        count: threads.
        patience: How long to measure.
        rounds: Multiply-adds in each chain.
    """
    from graycard.benchmarks.speed._fma import KERNELS, LANES

    found = []
    with threads(count):
        for kernel, chains in KERNELS:
            state = np.random.default_rng(0).random(chains * LANES * count, np.float32)
            call = partial(kernel, state, count, rounds)
            timing = time_calls(call, patience)
            flops = 2 * chains * LANES * rounds * count
            found.append(Peak(count, flops / (1e6 * timing.best_ms), timing))
    return max(found, key=lambda peak: peak.gflops)
