# SPDX-License-Identifier: Apache-2.0
"""How a job ended."""

from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True, slots=True)
class Outcome:
    """How a job ended."""

    reason: str = ""
    """Why it failed; empty if it did not."""
    fatal: bool = False
    """Whether the run cannot go on: there is no room for results."""
    reused: bool = False
    """Whether all was there already."""
    value: Any = None
