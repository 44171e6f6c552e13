# SPDX-License-Identifier: Apache-2.0
"""Start processes from one that has imported what they need, and follow them to their end."""

import errno
import json
import os
import signal
import socket
import subprocess
import sys
import threading
from contextlib import ExitStack, suppress
from importlib import import_module
from itertools import count
from multiprocessing.connection import wait

from graycard.processes._family import MARK, end_family, marked
from graycard.processes._inside import NUMBER, serve_starts

_BOOT = (
    "import json,sys;sys.path[:]=json.loads(sys.argv[1]);"
    "from graycard.processes import serve_starts;serve_starts(*sys.argv[2:])"
)
_NUMBERS = count()
_DESCRIPTORS = 2**16
"""Descriptors from this number on are not looked for."""
_REAPED_S = 1.0
"""Time in which the starter tells of the end of a process that was killed."""


class Starter:
    """A process that forks others, one at a time; each runs the same function.

    It runs no code of others itself: what they do to their own process, the next one does not meet.
    """

    def __init__(self, serve: str, *, forked: bool = False) -> None:
        """Start it.

        Args:
            serve: ``module:function`` that the others run, called with a :class:`Channel`.
            forked: Fork this process instead of starting a fresh interpreter.

        Raises:
            OSError: There is no room for it.
        """
        self._socket, theirs = socket.socketpair()
        with ExitStack() as marking, theirs:
            self._mark = os.environ.get(MARK) or marking.enter_context(marked(next(_NUMBERS)))
            self._process = (_Forked if forked else _executed)(serve, theirs.fileno())
        self.pid = 0
        """Of the process that was started last."""
        self._code: int | None = 0

    def start(self, connection: int, notes: int) -> None:
        """Start a process.

        Args:
            connection: Descriptor of the socket of its channel.
            notes: Descriptor to which it writes refusals.

        Raises:
            OSError: There is no room for it, the starter is gone, or the one before is still there.
        """
        if self._code is None:
            raise OSError(errno.EBUSY, os.strerror(errno.EBUSY))
        socket.send_fds(self._socket, [b"."], [connection, notes])
        pid = self._number()
        if pid is None or pid < 0:
            number = errno.EPIPE if pid is None else -pid
            raise OSError(number, os.strerror(number))
        self.pid, self._code = pid, None

    def code(self, patience_s: float = 0.0) -> int | None:
        """Return the exit code of the process that was started last, below 0 for a signal.

        Args:
            patience_s: Time that its end is waited for.

        Returns:
            None while it runs.
        """
        if self._code is None and wait([self._socket], patience_s):
            number = self._number()
            self._code = -signal.SIGKILL if number is None else number  # it dies with the starter
        return self._code

    def clean(self) -> None:
        """Kill what is left of the process that was started last, with all that it started."""
        end_family(self.pid, self._mark, spared=self._process.pid)
        self.code(_REAPED_S)

    def end(self) -> None:
        """End the starter itself."""
        self._socket.close()
        self._process.kill()
        self._process.wait()

    def _number(self) -> int | None:
        """Return the next number that it tells; None where it is gone."""
        try:
            data = self._socket.recv(NUMBER.size, socket.MSG_WAITALL)
        except OSError:
            return None
        return NUMBER.unpack(data)[0] if len(data) == NUMBER.size else None


def has_just_begun() -> bool:
    """Tell whether nothing is loaded that a fork should not have: the stages, and threads."""
    stages = tuple(f"graycard.{name}" for name in ("synth", "benchmarks", "eval", "reports"))
    loaded = any(name.startswith(stages) for name in sys.modules)
    return sys.platform == "linux" and not loaded and threading.active_count() == 1


def _executed(serve: str, control: int) -> subprocess.Popen[bytes]:
    """Start a starter as a fresh interpreter."""
    command = [sys.executable, "-c", _BOOT, json.dumps(sys.path), serve, str(control)]
    return subprocess.Popen(command, stdin=subprocess.DEVNULL, pass_fds=(control,), start_new_session=True)


class _Forked:
    """A starter that is a fork of this process; it keeps its output, and of open files its control."""

    def __init__(self, serve: str, control: int) -> None:
        module, _, _ = serve.partition(":")
        import_module(module)
        self.pid = os.fork()
        if self.pid:
            return
        try:
            os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
            os.closerange(3, control)
            os.closerange(control + 1, _DESCRIPTORS)
            serve_starts(serve, str(control))
        finally:
            os._exit(1)  # none of what this process does at its end is the fork's to do

    def kill(self) -> None:
        """Kill it."""
        with suppress(ProcessLookupError):
            os.kill(self.pid, signal.SIGKILL)

    def wait(self) -> None:
        """Wait for its end."""
        with suppress(ChildProcessError):
            os.waitpid(self.pid, 0)
