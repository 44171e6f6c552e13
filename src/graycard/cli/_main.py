# SPDX-License-Identifier: Apache-2.0
"""The command line: ``graycard VERB ...``, or ``python -m graycard VERB ...``."""

import io
import os
import signal
import sys
import threading
import traceback
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from importlib.metadata import version

from graycard._errors import GraycardError, MethodError
from graycard.cli._overview import overview
from graycard.cli._table import HELP, find_verb
from graycard.cli._terminal import OK, Terminal
from graycard.io import keep_freed_memory

ERROR = 2
CUT_OFF = 141
"""Exit code where nobody reads the output to its end: that of a shell, 128 + SIGPIPE."""
SPINS = "3000"
"""Turns that an idle thread of GNU OpenMP waits for work before it sleeps: a fraction of a millisecond. Left
alone it waits for milliseconds, and on a machine that is busy it takes them from the threads that work."""


def main(args: Sequence[str] | None = None) -> int:
    """Run one verb.

    Args:
        args: Arguments after ``graycard``; ``sys.argv`` by default.

    Returns:
        The exit code: ``graycard --help`` lists them.

    Raises:
        SystemExit: An argument is missing or of the wrong type, exit code 2; tyro has said which.
    """
    _set_up_process()
    terminal = Terminal()
    try:
        with _ended_tidily():
            return _run(list(sys.argv[1:] if args is None else args), terminal)
    except GraycardError as error:
        if error.__cause__ is not None and isinstance(error, MethodError):
            terminal.err.print("".join(traceback.format_exception(error.__cause__)))  # for whoever writes it
        terminal.err.print(f"graycard: {error}")
        return ERROR
    except BrokenPipeError:  # whoever reads has seen enough
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return CUT_OFF
    except KeyboardInterrupt as stopped:
        terminal.err.print("graycard: stopped; the same command goes on where it stopped")
        return 128 + (signal.SIGTERM if isinstance(stopped, _Ended) else signal.SIGINT)


def _set_up_process() -> None:
    """Set what must stand before PyTorch and Numba load OpenMP, and before anything is written."""
    if "OMP_WAIT_POLICY" not in os.environ:
        os.environ.setdefault("GOMP_SPINCOUNT", SPINS)
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")  # a terminal without Unicode shows "?" instead of failing
    keep_freed_memory()


def _run(args: list[str], terminal: Terminal) -> int:
    """Run one verb, or show help; return the exit code."""
    if not args:
        terminal.err.print(overview())
        return ERROR
    first, *rest = args
    if first in HELP:
        terminal.out.print(overview())
        return OK
    if first == "--version":
        terminal.out.print(f"graycard {version('graycard')}")
        return OK
    return _run_verb(first, rest, terminal)


def _run_verb(name: str, args: list[str], terminal: Terminal) -> int:
    # tyro and the modules of verbs are imported here, so that `graycard --help` need not wait for them
    from graycard.cli._options import refuse
    from graycard.cli._parse import parse_verb, show_verb_help, write_completion

    if name.startswith("--tyro-"):
        write_completion([name, *args])
    if name.startswith("-"):
        refuse([name], "graycard", ["--help", "--version"])
    verb = find_verb(name)
    if HELP & {*args}:
        show_verb_help(verb, args, terminal)
        return OK
    command, rest = parse_verb(verb, args)
    return command.run(terminal, rest)


class _Ended(KeyboardInterrupt):
    """An end by SIGTERM; no method may take it for its own error."""


@contextmanager
def _ended_tidily() -> Iterator[None]:
    """Clear away what was begun, as after an error, when the process is told to end (SIGTERM)."""

    def end(*_: object) -> None:
        raise _Ended

    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGTERM, end)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)
