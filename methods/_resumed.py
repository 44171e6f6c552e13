# SPDX-License-Identifier: Apache-2.0
"""Time and memory of a fit that were spent before: what was found on disk counts as what was done now."""

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass


@dataclass(slots=True)
class Resumed:
    """Stages that fits found on disk."""

    seconds: float = 0.0
    """Wall time that it took when it was done."""
    peak_mib: float = 0.0
    """The most memory that a process held which did it."""


_FOUND: ContextVar[Resumed | None] = ContextVar("resumed", default=None)


@contextmanager
def resumed_time() -> Iterator[Resumed]:
    """Add up the cost of what fits within the block find on disk instead of doing it again."""
    found = Resumed()
    token = _FOUND.set(found)
    try:
        yield found
    finally:
        _FOUND.reset(token)


def add_resumed(seconds: float, peak_mib: float = 0.0) -> None:
    """Say that what was found on disk took so long, and so much memory; nobody may be listening."""
    found = _FOUND.get()
    if found is not None:
        found.seconds += seconds
        found.peak_mib = max(found.peak_mib, peak_mib)
