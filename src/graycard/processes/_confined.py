# SPDX-License-Identifier: Apache-2.0
"""Start a Python process that is to run code of others, and close to it all that it is not handed."""

import contextlib
import os
import socket
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path

from graycard.io import parse_json, peak_memory_mib, printable
from graycard.processes._channel import Channel, Message
from graycard.processes._places import Places
from graycard.processes._starter import Starter
from graycard.processes._variables import passed_variables

AUDIT_HOOK = "audit-hook-2"
"""Name and version of the way in which Python code is watched."""
SECCOMP = "seccomp-1"
"""Name and version of the filter of system calls."""
_GRACE_S = 5.0
"""Time in which a process that is told to end may do so by itself."""
_NOTES = 2**20
"""Bytes of notes that are read at most."""


@dataclass(eq=False)
class Confined:
    """A process that may only reach what it is handed."""

    starter: Starter
    channel: Channel
    notes: int
    """Descriptor from which refusals are read."""
    guard: str = ""
    """Way in which data are closed to it, for the record; empty until they are."""
    refused: dict[str, None] = field(default_factory=dict)
    ended: bool = False
    exit_code: int | None = None

    def confine(self, places: Places, code: str = "", variables: Mapping[str, str] = {}) -> None:
        """Close to it all but some places, for good.

        Args:
            places: What is open and what is closed.
            code: Name of a module whose package it may read.
            variables: Environment variables that it has besides those that are passed on.

        Raises:
            ChannelError: It ended.
        """
        environment = {**passed_variables(), **variables}
        told = {"places": asdict(places), "code": code, "environment": environment}
        held = self.channel.ask(Message("confine", told)).data
        landlock = [f"landlock-{held['landlock']}"] if held["landlock"] else []
        self.guard = "+".join([*landlock, *([SECCOMP] if held["seccomp"] else []), AUDIT_HOOK])

    def refusals(self) -> tuple[str, ...]:
        """Return what the audit hook has refused so far, in order, each once."""
        with contextlib.suppress(BlockingIOError):
            for line in os.read(self.notes, _NOTES).splitlines():
                with contextlib.suppress(ValueError):
                    self.refused[printable(str(parse_json(line.decode())))] = None
        return tuple(self.refused)

    def peak_mib(self) -> float:
        """Return the most memory that it has held, MiB."""
        return peak_memory_mib(self.starter.pid)

    def cpu_s(self) -> float | None:
        """Return the CPU time that it and what it started have taken, seconds; None where none is told."""
        with contextlib.suppress(OSError, ValueError, IndexError):  # there is no /proc, or it has ended
            told = Path(f"/proc/{self.starter.pid}/stat").read_text().rpartition(")")[2].split()
            return sum(map(int, told[11:15])) / os.sysconf("SC_CLK_TCK")  # proc(5): utime to cstime
        return None

    def end(self) -> int | None:
        """End it with all that it has started.

        Returns:
            Its exit code; None if it did not end by itself.
        """
        if not self.ended:
            self.ended = True
            self.channel.close()
            os.close(self.notes)
            self.exit_code = self.starter.code(_GRACE_S)
            self.starter.clean()
            if self.starter is not _standing:
                self.starter.end()
        return self.exit_code


_standing: Starter | None = None
"""The starter of a worker, for all of its jobs."""


def start_ahead(serve: str) -> None:
    """Make this process one that uses :func:`started` again and again, and let it wait for less.

    Args:
        serve: ``module:function`` that each of the processes is to run.

    Raises:
        OSError: There is no room for a process.
    """
    global _standing
    _standing = Starter(serve)


def started(serve: str) -> Confined:
    """Return a process that waits to be confined, and then runs a function with its channel.

    Args:
        serve: ``module:function``, called with the :class:`Channel`; the same for all of a worker.

    Raises:
        OSError: There is no room for a process.
    """
    global _standing
    if _standing is None:
        return _connected(Starter(serve))
    try:
        return _connected(_standing)
    except OSError:  # a job has killed the starter, or there is no room
        _standing.end()
        _standing = Starter(serve)
        return _connected(_standing)


def _connected(starter: Starter) -> Confined:
    """Let a starter start a process, and return that with the channel to it."""
    ours, theirs = socket.socketpair()
    notes, written = os.pipe()
    os.set_blocking(notes, False)
    os.set_blocking(written, False)  # who does not read does not hold it up
    try:
        with theirs:
            starter.start(theirs.fileno(), written)
    except OSError:
        ours.close()
        os.close(notes)
        raise
    finally:
        os.close(written)
    return Confined(starter, Channel(ours, lambda: starter.code() is None), notes)


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
