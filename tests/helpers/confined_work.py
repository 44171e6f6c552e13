# SPDX-License-Identifier: Apache-2.0
"""Work of a confined process that tells of itself, and of the worker that starts it."""

import os
import re
import resource
import tempfile
from pathlib import Path

import numpy as np

from graycard.processes import Channel, Message, Outcome, Places, started

SERVE = "confined_work:tell"


def tell(channel: Channel) -> None:
    """Say which threads are restricted, what limits memory, and how often a pattern stands in memory."""
    pattern = channel.receive().data
    tasks = [path.read_text() for path in Path("/proc/self/task").glob("*/status")]
    told = {
        "threads": [re.findall(r"NoNewPrivs:\s*(\d)", task)[0] for task in tasks],
        "memory": [str(limit) for limit in resource.getrlimit(resource.RLIMIT_DATA)],
        "found": _found(pattern.encode()),
        "faults": [_faults_of_an_image() for _ in range(2)],
    }
    channel.send(Message("told", told))


def _faults_of_an_image() -> int:
    before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
    np.ones(3_000_000)
    return resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before


def ask(pattern: str) -> Outcome:
    """Ask a confined process, in a worker."""
    confined = started(SERVE)
    try:
        confined.confine(Places(tempfile.mkdtemp()), "confined_work")
        return Outcome(value=confined.channel.ask(Message("tell", pattern)).data)
    finally:
        confined.end()


def _found(pattern: bytes) -> int:
    """Count a pattern, which does not match itself, in what this process may write to."""
    with open("/proc/self/maps") as file:
        places = [line.split()[0] for line in file if line.split()[1].startswith("rw")]
    count, memory = 0, os.open("/proc/self/mem", os.O_RDONLY)
    for place in places:
        start, end = (int(number, 16) for number in place.split("-"))
        count += sum(1 for _ in re.finditer(pattern, os.pread(memory, end - start, start)))
    return count
