# SPDX-License-Identifier: Apache-2.0
"""The outcome of a job: a value, or the reason of its failure."""

from dataclasses import dataclass
from typing import Any


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
