# SPDX-License-Identifier: Apache-2.0
"""The command line: ``graycard VERB ...``, or ``python -m graycard VERB ...``."""

import errno
import io
import os
import shlex
import signal
import sys
import threading
import traceback
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from importlib.metadata import version

from graycard._errors import GraycardError, MethodError
from graycard._missing import missing_package
from graycard.cli._overview import overview
from graycard.cli._table import HELP, VERBS, find_verb
from graycard.cli._terminal import OK, Terminal
from graycard.io import is_text, keep_freed_memory, printable

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
        if isinstance(error, MethodError) and not _is_of_machine(error.__cause__):
            terminal.err.print("".join(traceback.format_exception(error.__cause__)))  # for whoever writes it
        terminal.err.print(f"graycard: {error}")
        return ERROR
    except ModuleNotFoundError as error:
        if (missing := missing_package(error)) is None:
            raise
        terminal.err.print(f"graycard: {missing}")
        return ERROR
    except BrokenPipeError:  # whoever reads has seen enough
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return CUT_OFF
    except OSError as error:
        if not _is_of_machine(error):
            raise
        where = f" at {error.filename}" if error.filename else ""
        advice = _ADVICE.get(error.errno or 0, "Mend that, and run the same command again")
        terminal.err.print(
            f"graycard: expected a machine that can go on, got {error.strerror}{where}. {advice}"
        )
        return ERROR
    except KeyboardInterrupt as stopped:
        terminal.err.print(f"graycard: stopped; {_way_on(sys.argv[1:] if args is None else args)}")
        return 128 + (signal.SIGTERM if isinstance(stopped, _Ended) else signal.SIGINT)


def _way_on(args: Sequence[str]) -> str:
    """Return how to go on with a command that was stopped."""
    verb = next((verb for verb in VERBS if args and verb.name == args[0]), None)
    command = printable(shlex.join(["graycard", *args]))
    if verb is not None and verb.resumes:
        return f"the same command goes on where it stopped:\n  {command}"
    return f"to begin again:\n  {command}"


_TOO_MANY = "Allow more open files, as by `ulimit -n 1024`"
_ROOM = "Free some space; the same command then goes on where it stopped"
_ADVICE = {errno.EMFILE: _TOO_MANY, errno.ENFILE: _TOO_MANY, errno.ENOSPC: _ROOM, errno.EDQUOT: _ROOM}
_OF_MACHINE = {
    *_ADVICE, errno.EAGAIN, errno.ENOMEM, errno.EIO, errno.EROFS, errno.EACCES, errno.EPERM, errno.ESTALE,
}  # fmt: skip
"""Errors of the system itself: no error of graycard's, nor of a method."""


def _is_of_machine(error: BaseException | None) -> bool:
    """Tell whether an error is the system's, or whether there is none."""
    return error is None or (isinstance(error, OSError) and error.errno in _OF_MACHINE)


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
    if strange := [arg for arg in args if not is_text(arg)]:
        terminal.err.print(
            f"graycard: expected names in UTF-8, got {strange[0]!a}. Rename that file or folder"
        )
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
    from graycard.cli._terminal import verb as running

    if name.startswith("--tyro-"):
        write_completion([name, *args])
    if name.startswith("-"):
        refuse([name], "graycard", ["--help", "--version"])
    verb = find_verb(name)
    if HELP & {*args}:
        show_verb_help(verb, args, terminal)
        return OK
    command, rest = parse_verb(verb, args)
    running.set(verb.name)
    return command.run(terminal, rest)


RESEND_AFTER = 0.1
"""Seconds until a signal that was lost is sent anew."""


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
    before, hook = signal.signal(signal.SIGTERM, end), sys.unraisablehook
    sys.unraisablehook = _resend_when_lost(hook)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)
        sys.unraisablehook = hook


def _resend_when_lost(
    hook: "Callable[[sys.UnraisableHookArgs], object]",
) -> "Callable[[sys.UnraisableHookArgs], None]":
    """Return a hook that sends a signal anew whose exception was raised where Python has to drop it.

    Compilers call Python back from C: an exception there is printed and forgotten, and the process goes on.
    """

    def resend(lost: "sys.UnraisableHookArgs") -> None:
        if not isinstance(lost.exc_value, KeyboardInterrupt):
            hook(lost)
            return
        number = signal.SIGTERM if isinstance(lost.exc_value, _Ended) else signal.SIGINT
        again = threading.Timer(RESEND_AFTER, os.kill, (os.getpid(), number))
        again.daemon = True
        again.start()

    return resend
