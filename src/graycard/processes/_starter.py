# SPDX-License-Identifier: Apache-2.0
"""Start processes from one that has imported what they need, and follow them to their end."""

import errno
import json
import os
import signal
import socket
import subprocess
import sys
from contextlib import ExitStack
from multiprocessing.connection import wait

from graycard.processes._family import MARK, end_family, marked
from graycard.processes._inside import NUMBER
from graycard.processes._variables import passed_variables

_BOOT = (
    "import json,sys;sys.path[:]=json.loads(sys.argv[1]);"
    "from graycard.processes import serve_starts;serve_starts(*sys.argv[2:])"
)
_REAPED_S = 1.0
"""Time in which the starter tells of the end of a process that was killed."""


class Starter:
    """A process that forks others, one at a time; each runs the same function.

    It runs no code of others itself: what they do to their own process, the next one does not meet.
    """

    def __init__(self, serve: str) -> None:
        """Start it as a fresh interpreter: a fork would have names of scenes in its memory.

        Args:
            serve: ``module:function`` that the others run, called with a :class:`Channel`.

        Raises:
            OSError: There is no room for it.
        """
        self._socket, theirs = socket.socketpair()
        with ExitStack() as marking, theirs:
            self._mark = os.environ.get(MARK) or marking.enter_context(marked())
            number = theirs.fileno()
            self._process = subprocess.Popen(
                [sys.executable, "-c", _BOOT, json.dumps(sys.path), serve, str(number)],
                stdin=subprocess.DEVNULL,
                env={**passed_variables(), MARK: self._mark},
                pass_fds=(number,),
                start_new_session=True,
            )
        self.pid = 0
        """Id of the process that was started last."""
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
