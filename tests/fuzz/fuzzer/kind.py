# SPDX-License-Identifier: Apache-2.0
"""Describe a kind of case, and call the library and the command line in one."""

import io
import re
from collections.abc import Callable
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import dataclass
from pathlib import Path
from random import Random

from graycard import GraycardError

Attack = Callable[[Random, Path], str]
"""Changes an input and says how."""


@dataclass(frozen=True)
class Kind:
    """One kind of input, and who reads it."""

    name: str
    inputs: tuple[str, ...]
    """Names in the corpus of what lies in the folder of a case."""
    attack: Attack
    read: Callable[[Path, Path], None]
    """Reads the input, the first folder, and may write to the second."""
    seal: Callable[[Path], None] | None = None
    """Makes hashes right again after the attack."""
    writes: tuple[str, ...] = ()
    """Further files that may be written below the input, as a report into its run."""
    weight: int = 1
    """Tries in each round."""


class WrongWordsError(Exception):
    """The command line gave an exit code without words, a traceback, or raw control characters."""


def each(*calls: Callable[[], object]) -> None:
    """Make all calls, and raise the refusal of the first that is refused."""
    refusals = []
    for call in calls:
        try:
            call()
        except GraycardError as error:
            check_words(str(error))
            refusals.append(error)
    if refusals:
        raise refusals[0]


_EXPECTED = re.compile(r"[^\n]")
_RAW = re.compile(r"[\x00-\x08\x0b-\x1f\x7f-\x9f\u202a-\u202e\u2066-\u2069]")


def check_words(words: str) -> None:
    """Refuse an error without words.

    Raises:
        WrongWordsError: It says nothing, or too much to be read.
    """
    if not _EXPECTED.search(words):
        raise WrongWordsError("an error without words")
    if len(words) > 20_000:
        raise WrongWordsError(f"an error of {len(words)} characters: {words[:60]!a}")


def cli(*args: object) -> None:
    """Run a verb in this process, and hold it to its promises.

    Raises:
        GraycardError: It refused its input: the exit code is 2.
        WrongWordsError: It ended without words, with a traceback, or printed raw control characters.
    """
    from graycard.cli import main

    out, err = io.StringIO(), io.StringIO()
    with redirect_stdout(out), redirect_stderr(err):
        try:
            code = main([str(arg) for arg in args])
        except SystemExit as ended:
            code = ended.code
    words = out.getvalue() + err.getvalue()
    if "Traceback (most recent call last)" in words:
        raise WrongWordsError(f"a traceback is shown: {words.strip().splitlines()[-1][:80]}")
    if _RAW.search(words):
        raise WrongWordsError(f"raw control characters: {_RAW.search(words)}")
    if code not in (0, 1, 2) or (code and not words.strip()):
        raise WrongWordsError(f"exit code {code} with {len(words)} characters of words")
    if code == 2:
        raise GraycardError(words)
