# SPDX-License-Identifier: Apache-2.0
"""Start a Python process that is to run code of others, and close to it all that it is not handed."""

import contextlib
import json
import os
import socket
import subprocess
import sys
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from itertools import count

from graycard.io import peak_memory_mib, printable
from graycard.processes._channel import Channel, Message
from graycard.processes._family import MARK, end_family, marked
from graycard.processes._places import Places

AUDIT_HOOK = "audit-hook-2"
"""Name and version of the way in which Python code is watched."""
_BOOT = (
    "import json,sys;sys.path[:]=json.loads(sys.argv[1]);"
    "from graycard.processes import await_confinement;await_confinement(*sys.argv[2:])"
)
_NUMBERS = count()
_GRACE_S = 5.0
"""Time in which a process that is told to end may do so by itself."""
_NOTES = 2**20
"""Bytes of notes that are read at most."""


@dataclass(eq=False)
class Confined:
    """A process that may only reach what it is handed."""

    process: subprocess.Popen[bytes]
    channel: Channel
    mark: str
    notes: int
    """Descriptor from which refusals are read."""
    guard: str = ""
    """How data are closed to it, for the record; empty until they are."""
    pid: int = 0
    """Of the process that runs code of others."""
    refused: dict[str, None] = field(default_factory=dict)

    def confine(self, places: Places, code: str = "", variables: Mapping[str, str] = {}) -> None:
        """Close to it all but some places, for good.

        Args:
            places: What is open and what is closed.
            code: Name of a module whose package it may read.
            variables: Environment variables that it has besides those of this process.

        Raises:
            ChannelError: It ended.
        """
        told = {"places": asdict(places), "code": code, "environment": {**os.environ, **variables}}
        answer = self.channel.ask(Message("confine", told))
        version = int(answer.data["landlock"])
        self.pid = int(answer.data["pid"])
        self.guard = f"landlock-{version}+{AUDIT_HOOK}" if version else AUDIT_HOOK

    def refusals(self) -> tuple[str, ...]:
        """Return what the audit hook has refused so far, in order, each once."""
        with contextlib.suppress(BlockingIOError):
            for line in os.read(self.notes, _NOTES).splitlines():
                with contextlib.suppress(ValueError):
                    self.refused[printable(str(json.loads(line)))] = None
        return tuple(self.refused)

    def peak_mib(self) -> float:
        """Return the most memory that it has held, MiB."""
        return peak_memory_mib(self.pid)

    def end(self) -> int | None:
        """End it with all that it has started.

        Returns:
            Its exit code; None if it did not end by itself.
        """
        self.channel.close()
        try:
            code = self.process.wait(_GRACE_S)
        except subprocess.TimeoutExpired:
            code = None
        end_family(self.process.pid, self.mark)
        self.process.wait()
        with contextlib.suppress(OSError):
            os.close(self.notes)
        return code


_ahead: list[Confined] = []
"""The process that waits for the next fit of this one."""


def start_ahead(serve: str) -> None:
    """Start a process for :func:`started` before it is needed: it imports its modules meanwhile.

    Args:
        serve: ``module:function`` that it is to run.
    """
    _ahead.append(_start(serve))


def started(serve: str) -> Confined:
    """Return a process that waits to be confined, and then runs a function with its channel.

    Args:
        serve: ``module:function``, called with the :class:`Channel`.
    """
    return _ahead.pop() if _ahead else _start(serve)


def _start(serve: str) -> Confined:
    ours, theirs = socket.socketpair()
    notes, written = os.pipe()
    os.set_blocking(notes, False)
    os.set_blocking(written, False)  # who does not read does not hold it up
    command = [sys.executable, "-c", _BOOT, json.dumps(sys.path), serve, str(theirs.fileno()), str(written)]
    with contextlib.ExitStack() as marking, theirs:
        mark = os.environ.get(MARK) or marking.enter_context(marked(next(_NUMBERS)))
        given = (theirs.fileno(), written)
        process = subprocess.Popen(command, stdin=subprocess.DEVNULL, pass_fds=given, start_new_session=True)
    os.close(written)
    return Confined(process, Channel(ours, lambda: process.poll() is None), mark, notes)


def words_of_end(code: int | None) -> str:
    """Say how a process ended that gave no outcome.

    Args:
        code: Its exit code, below 0 for a signal; None where it had to be killed.
    """
    if code is None:
        return "The process closed its files and gave no outcome. Mend the method"
    if code < 0:
        return (
            f"The process was killed or crashed, exit code {code} (out of memory, or native code). "
            "Try fewer --jobs"
        )
    return f"The process was ended by its own code, exit code {code}. Mend the method"
