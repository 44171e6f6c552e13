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

    def report(done: float, what: str, /) -> None:
        progress((number + done) / of, what.after(doing) if isinstance(what, Ended) else f"{doing} {what}")

    return report


def named(progress: Progress, words: str) -> Progress:
    """Return progress in words that begin with what is worked on."""

    def report(done: float, doing: str, /) -> None:
        progress(done, doing.after(f"{words}:") if isinstance(doing, Ended) else f"{words}: {doing}")

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
