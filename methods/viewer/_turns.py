# SPDX-License-Identifier: Apache-2.0
"""Take drawing in turns: one picture at a time, and of those that wait only the newest."""

import threading
from collections.abc import Callable, Hashable


class Turns:
    """Runs jobs one after the other, and skips one if a newer one has come for the same reader.

    A page calls from many threads, each time that a camera moves. Kernels must not be called from two at
    once: where Numba has neither OpenMP nor TBB, its own threads then end the process.
    """

    def __init__(self) -> None:
        self._busy, self._guard = threading.RLock(), threading.Lock()
        self._newest: dict[Hashable, object] = {}

    def run(self, reader: Hashable, job: Callable[[], None]) -> None:
        """Run a job when those before it are done, unless the same reader has asked anew by then.

        A job may ask itself: viser calls back at once when a job sets a choice.
        """
        ticket = object()
        with self._guard:
            self._newest[reader] = ticket
        with self._busy:
            if self._newest[reader] is ticket:
                job()
