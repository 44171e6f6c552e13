# SPDX-License-Identifier: Apache-2.0
"""Start a Python process that is to run code of others, and close to it all that it is not handed."""

import contextlib
import json
import os
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field
from importlib import import_module
from itertools import count

from graycard.io import peak_memory_mib, printable
from graycard.processes._channel import Channel, Message
from graycard.processes._family import MARK, end_family, marked
from graycard.processes._inside import await_confinement
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
_LOOK_S = 0.005
_DESCRIPTORS = 2**16
"""Descriptors from this number on are not looked for."""
_NOTES = 2**20
"""Bytes of notes that are read at most."""


@dataclass(eq=False)
class Confined:
    """A process that may only reach what it is handed."""

    process: "subprocess.Popen[bytes] | Forked"
    channel: Channel
    mark: str
    notes: int
    """Descriptor from which refusals are read."""
    guard: str = ""
    """Way in which data are closed to it, for the record; empty until they are."""
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
        own = {name: value for name, value in os.environ.items() if _is_text(name + value)}
        told = {"places": asdict(places), "code": code, "environment": {**own, **variables}}
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
        if self.mark == os.environ.get(MARK):  # what is left of it ends with this worker
            with contextlib.suppress(ProcessLookupError, PermissionError):
                os.killpg(self.process.pid, signal.SIGKILL)
        else:
            end_family(self.process.pid, self.mark)
        self.process.wait()
        with contextlib.suppress(OSError):
            os.close(self.notes)
        return code


class Forked:
    """A process that this one has forked, with what :class:`subprocess.Popen` tells of one."""

    def __init__(self, pid: int) -> None:
        self.pid = pid
        self._code: int | None = None

    def poll(self) -> int | None:
        """Return its exit code, below 0 for a signal; None while it runs."""
        if self._code is None:
            with contextlib.suppress(ChildProcessError):
                pid, status = os.waitpid(self.pid, os.WNOHANG)
                self._code = os.waitstatus_to_exitcode(status) if pid else None
        return self._code

    def wait(self, timeout: float | None = None) -> int:
        """Wait for its end, and return its exit code.

        Raises:
            subprocess.TimeoutExpired: It has not ended in so many seconds.
        """
        end = None if timeout is None else time.monotonic() + timeout
        while (code := self.poll()) is None:
            if end is not None and time.monotonic() >= end:
                raise subprocess.TimeoutExpired("a fork", timeout or 0.0)
            time.sleep(_LOOK_S)
        return code


def _is_text(value: str) -> bool:
    """Tell whether a message can hold a text: environment variables may be of any bytes."""
    return value.isascii() or value.encode(errors="replace").decode() == value


_ahead: list[Confined] = []
"""The process that waits for the next fit of this one."""


def start_ahead(serve: str) -> None:
    """Start a process for :func:`started` before it is needed.

    A process that has just begun, and knows of no job yet, forks: what both import is imported once.

    Args:
        serve: ``module:function`` that it is to run.
    """
    _ahead.append(_connected(serve, _forked if _has_just_begun() else _executed))


def started(serve: str) -> Confined:
    """Return a process that waits to be confined, and then runs a function with its channel.

    Args:
        serve: ``module:function``, called with the :class:`Channel`.
    """
    return _ahead.pop() if _ahead else _connected(serve, _executed)


def _has_just_begun() -> bool:
    """Tell whether nothing is loaded that a fork should not have: the stages, and threads."""
    stages = tuple(f"graycard.{name}" for name in ("synth", "benchmarks", "eval", "reports"))
    loaded = any(name.startswith(stages) for name in sys.modules)
    return sys.platform == "linux" and not loaded and threading.active_count() == 1


def _executed(serve: str, connection: int, notes: int) -> subprocess.Popen[bytes]:
    """Start a fresh interpreter."""
    command = [sys.executable, "-c", _BOOT, json.dumps(sys.path), serve, str(connection), str(notes)]
    given = (connection, notes)
    return subprocess.Popen(command, stdin=subprocess.DEVNULL, pass_fds=given, start_new_session=True)


def _forked(serve: str, connection: int, notes: int) -> Forked:
    """Fork this process; of its open files the fork keeps those that it is given, and its output."""
    module, _, _ = serve.partition(":")
    import_module(module)
    if child := os.fork():
        return Forked(child)
    try:
        nothing = os.open(os.devnull, os.O_RDONLY)
        os.dup2(nothing, 0)
        low, high = sorted((connection, notes))
        for first, last in ((3, low), (low + 1, high), (high + 1, _DESCRIPTORS)):
            os.closerange(first, last)
        await_confinement(serve, str(connection), str(notes))
    finally:
        os._exit(1)  # none of what this process does at its end is the fork's to do


def _connected(serve: str, start: Callable[[str, int, int], subprocess.Popen[bytes] | Forked]) -> Confined:
    ours, theirs = socket.socketpair()
    notes, written = os.pipe()
    os.set_blocking(notes, False)
    os.set_blocking(written, False)  # who does not read does not hold it up
    with contextlib.ExitStack() as marking, theirs:
        mark = os.environ.get(MARK) or marking.enter_context(marked(next(_NUMBERS)))
        process = start(serve, theirs.fileno(), written)
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
