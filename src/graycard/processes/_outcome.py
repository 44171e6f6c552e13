# SPDX-License-Identifier: Apache-2.0
"""The outcome of a job: a value, or the reason of its failure."""

from dataclasses import dataclass
from typing import Any

from graycard import Progress


class Ended(str):
    """Words of a progress that say what has just ended: where there is no terminal, they get a line."""

    __slots__ = ()

    def after(self, words: str) -> "Ended":
        """Return the same behind other words."""
        return Ended(f"{words} {self}")


def part_of(progress: Progress, number: int, of: int, doing: str) -> Progress:
    """Return the progress of one of several equal parts, in words that begin with what it is.

    Args:
        progress: That of the whole.
        number: Of the part, from 0.
        of: Number of parts.
        doing: What the part is, as in ``fitting``.
    """
    return _worded(narrowed(progress, number / of, (number + 1) / of), doing)


def narrowed(progress: Progress, first: float, last: float) -> Progress:
    """Return the progress of a part of the whole.

    Args:
        progress: That of the whole.
        first: Share of the whole at which the part begins, 0 to 1.
        last: Share at which it ends.
    """

    def report(done: float, doing: str, /) -> None:
        share = min(max(done, 0.0), 1.0)
        progress((1 - share) * first + share * last, doing)

    return report


def named(progress: Progress, words: str) -> Progress:
    """Return progress in words that begin with what is worked on."""
    return _worded(progress, f"{words}:")


def _worded(progress: Progress, before: str) -> Progress:
    """Return progress with some words before those that it is told."""

    def report(done: float, doing: str, /) -> None:
        progress(done, doing.after(before) if isinstance(doing, Ended) else f"{before} {doing}")

    return report


@dataclass(frozen=True, slots=True)
class Outcome:
    """The outcome of a job: a value, or the reason of its failure."""

    reason: str = ""
    """Why it failed; empty if it did not."""
    fatal: bool = False
    """True if the run cannot go on, as there is no room for results."""
    reused: bool = False
    """True if all was there already."""
    value: Any = None
