# SPDX-License-Identifier: Apache-2.0
"""Progress of work, reported through a callback."""

from typing import Protocol, runtime_checkable


@runtime_checkable
class Progress(Protocol):
    """Called with the share that is done and what is being done."""

    def __call__(self, done: float, doing: str, /) -> None:
        """Report.

        Args:
            done: 0 to 1.
            doing: A few words.
        """
        ...


def silent(done: float, doing: str) -> None:
    """Report progress to nobody."""
