# SPDX-License-Identifier: Apache-2.0
"""The command line: ``graycard VERB ...``, or ``python -m graycard VERB ...``."""

import io
import os
import signal
import sys
import threading
import traceback
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from importlib.metadata import version
from typing import Annotated, Any, Union

import tyro

from graycard._errors import GraycardError, MethodError, UnknownNameError
from graycard.cli._screen import Screen, refuse
from graycard.cli._verbs import COMMANDS, Fit, Render
from graycard.io._memory import keep_freed_memory

ERROR = 2
CUT_OFF = 141
"""Exit code where nobody reads the output to its end: that of a shell, 128 + SIGPIPE."""
SPINS = "3000"
"""Turns that an idle thread of GNU OpenMP waits for work before it sleeps: a fraction of a millisecond. Left
alone it waits for milliseconds, and on a machine that is busy it takes them from the threads that work."""


def main(args: Sequence[str] | None = None) -> int:
    """Run one verb.

    Args:
        args: What follows ``graycard``; ``sys.argv`` by default.

    Returns:
        The exit code: 0 done, 1 a job, a score or the gate failed, 2 something for the user to mend.
    """
    if "OMP_WAIT_POLICY" not in os.environ:
        os.environ.setdefault("GOMP_SPINCOUNT", SPINS)  # before PyTorch and Numba load OpenMP
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")  # a terminal without Unicode shows "?" instead of failing
    keep_freed_memory()
    screen = Screen()
    given = list(sys.argv[1:] if args is None else args)
    if given == ["--version"]:
        screen.out.print(f"graycard {version('graycard')}")
        return 0
    try:
        with _ended_tidily():
            command, rest = _parse(given)
            return command.run(screen, rest)
    except GraycardError as error:
        if error.__cause__ is not None and isinstance(error, MethodError):
            screen.err.print("".join(traceback.format_exception(error.__cause__)))  # for whoever writes it
        screen.err.print(f"graycard: {error}")
        return ERROR
    except BrokenPipeError:  # whoever reads has seen enough
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return CUT_OFF
    except KeyboardInterrupt as stopped:
        screen.err.print("graycard: stopped; the same command goes on where it stopped")
        return 128 + (signal.SIGTERM if isinstance(stopped, _Ended) else signal.SIGINT)


class _Ended(KeyboardInterrupt):
    """By SIGTERM; no method may take it for its own error."""


@contextmanager
def _ended_tidily() -> Iterator[None]:
    """When it is told to end (SIGTERM), what was begun is cleared away, as after an error."""

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


def _parse(args: list[str]) -> tuple[Any, list[str]]:
    """The verb with its options, and what is left for the settings of a method or a renderer.

    Raises:
        GraycardError: The verb does not exist, or does not take some option.
    """
    if args and not args[0].startswith("-") and args[0] not in COMMANDS:
        raise UnknownNameError("verb", args[0], COMMANDS)
    if args[:1] == ["fit"] and {"-h", "--help"} & {*args} and len(args) > 1 and not args[1].startswith("-"):
        with suppress(SystemExit):
            tyro.cli(_union(), args=["fit", "--help"], prog="graycard", description=_DESCRIPTION)
        return COMMANDS["methods"](args[1]), []  # whose settings may follow
    command, rest = tyro.cli(
        _union(), args=args, prog="graycard", description=_DESCRIPTION, return_unknown_args=True
    )
    if not isinstance(command, Fit | Render):
        refuse(rest, args[0])
    return command, rest


_DESCRIPTION = "Inverse rendering, judged by scenes whose light, albedo and normals are known exactly."


def _union() -> Any:
    """The type that tyro turns into one sub-command a verb."""
    members = tuple(
        Annotated[cls, tyro.conf.subcommand(name, prefix_name=False)] for name, cls in COMMANDS.items()
    )
    return Union[members]  # pyright: ignore[reportInvalidTypeArguments]  # noqa: UP007 -- built at run time
