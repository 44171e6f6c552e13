# SPDX-License-Identifier: Apache-2.0
"""Faults by what a method raised: the method's own lines, or the end of its process."""

import re

from graycard import GraycardError
from graycard.benchmarks.kit._faults import Fault

ENDED = "ended without an answer"
"""Words of an error where the process of a method ended."""
_PATH = re.compile(r"\[Errno \d+\] Permission denied: '([^']+)'")


def fault_of(error: GraycardError, name: str) -> Fault:
    """Return the fault that an error tells of.

    Args:
        error: As the process of the method told it.
        name: The fault where it tells of nothing more special.
    """
    words = str(error)
    if ENDED in words:
        return Fault("ends", words)
    trace = "" if error.__cause__ is None else str(error.__cause__).strip()
    if "truth is closed" in words:
        return Fault("truth", words, trace)
    if denied := _PATH.search(words):
        return Fault("writes", f"it may not open {denied[1]}", trace)
    return Fault(name, words, trace)
