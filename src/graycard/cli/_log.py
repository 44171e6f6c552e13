# SPDX-License-Identifier: Apache-2.0
"""Progress where there is no terminal: a line for each job that ends, and one now and then between."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

from rich.console import Console

from graycard.io import Progress, printable
from graycard.processes import Ended

FIRST_S = 1.0
"""Time after which work is worth a first line: what is quicker says nothing."""
EACH_S = 30.0
"""Longest time without a line."""
AT_ONCE_S = 1.0
"""Time in which no work does so much that its pace matters."""
EARLY = 0.1
"""A first share beyond this with which a job ends was done since the start; any other was found done."""
FALL = 0.1
"""A share that falls by more begins another stage; one of many jobs that does so moves the whole by less."""
RISE = 0.1
"""A share that rises by more at once was found done; most steps of work are smaller."""


@dataclass(eq=False)
class _Log:
    """The lines of one piece of work."""

    console: Console
    doing: str
    each_s: float
    started: float = field(default_factory=time.monotonic)
    due: float = 0.0
    done: float = 0.0
    told: float = field(default_factory=time.monotonic)
    """Time of the last report."""
    base: tuple[float, float] | None = None
    """Time and share from which the pace counts: after compilation, and after what was found done."""
    ended: threading.Event = field(default_factory=threading.Event)
    lock: threading.Lock = field(default_factory=threading.Lock)

    def report(self, done: float, doing: str, /) -> None:
        """Note how far the work is; say it if something has ended, or if nothing was said for long."""
        with self.lock:
            ended, now = isinstance(doing, Ended), time.monotonic()
            if done < self.done - FALL:  # another stage of the work, with a pace of its own
                self.base = now, done
            elif self.base is None and done > 0:
                whole = ended and done > EARLY
                self.base = (self.started, 0.0) if whole else (now, done)
            elif self.base is not None and not ended and self.leaps(done, now):
                self.base = now, done
            self.done, self.doing, self.told = done, doing, now
            if ended or now >= self.due:
                self.say()

    def leaps(self, done: float, now: float) -> bool:
        """Tell whether the share rises as by no work: far, and at once or at twice the pace so far."""
        since, share = self.base or (self.started, 0.0)
        rise, before = done - self.done, self.done - share
        usual = (self.told - since) * rise / before if before > 0 else 0.0
        return rise > RISE and now - self.told < max(AT_ONCE_S, usual / 2)

    def say(self) -> None:
        """Write a line."""
        now = time.monotonic()
        self.due = now + self.each_s
        times = _clock(now - self.started)
        since, share = self.base or (self.started, 0.0)
        if self.done - share >= 0.02 and self.done < 1:
            times += f", about {_clock((now - since) * (1 - self.done) / (self.done - share))} left"
        percent = f"{min(max(self.done, 0.0), 1.0):.0%}" if math.isfinite(self.done) else "?"
        self.console.print(f"[{percent}, {times}] {printable(self.doing)}")

    def watch(self) -> None:
        """Write a line whenever the work has said nothing for long."""
        while not self.ended.wait(max(0.05, self.due - time.monotonic())):
            with self.lock:
                if time.monotonic() >= self.due and not self.ended.is_set():
                    self.say()


@contextmanager
def logged(
    console: Console, doing: str, first_s: float = FIRST_S, each_s: float = EACH_S
) -> Iterator[Progress]:
    """Write lines on how work goes for the length of a block.

    Args:
        console: Where to.
        doing: What is done on what, until the work says more.
        first_s: Time after which work is worth a line.
        each_s: Longest time without a line.
    """
    log = _Log(console, doing, each_s)
    log.due = log.started + first_s
    watch = threading.Thread(target=log.watch, daemon=True)
    watch.start()
    try:
        yield log.report
    finally:
        log.ended.set()
        watch.join()


def _clock(seconds: float) -> str:
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02}:{rest:02}" if hours else f"{minutes}:{rest:02}"
