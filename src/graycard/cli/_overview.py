# SPDX-License-Identifier: Apache-2.0
"""The text of ``graycard --help``."""

from collections.abc import Iterator
from typing import get_args

from graycard.cli._table import VERBS, Group

EXIT_CODES = {
    0: "done",
    1: "a job, a score, a check or the gate failed",
    2: "something for you to mend, and the message says what;\n"
    "gate: scores are missing; check-result: evidence is missing",
    130: "stopped by Ctrl-C; the last line says how to go on",
    141: "nobody read the output to its end, as with `| head`",
    143: "told to end (SIGTERM); what was begun is cleared away",
}
"""Exit codes of all verbs, each with its meaning."""
_DESCRIPTION = """\
Inverse rendering, judged by scenes whose light, albedo and normals are known
exactly."""
_OPTIONS = {
    "--help": "show this text; of a verb: an example and its options",
    "--version": "show the version",
}
_WIDTH = 12
"""Characters of the longest verb."""


def overview() -> str:
    """Return the verbs by group, the options and the exit codes, at most 80 characters a line."""
    return "\n".join(_lines())


def _lines() -> Iterator[str]:
    yield from ("usage: graycard VERB [OPTIONS]", "", _DESCRIPTION)
    for group in get_args(Group):
        yield from ("", group)
        yield from (_row(verb.name, verb.help) for verb in VERBS if verb.group == group)
    yield from ("", "options")
    yield from (_row(name, meaning) for name, meaning in _OPTIONS.items())
    yield from ("", "exit codes")
    yield from (_row(str(code), meaning) for code, meaning in EXIT_CODES.items())


def _row(name: str, text: str) -> str:
    return f"  {name:{_WIDTH}}  " + text.replace("\n", "\n" + " " * (_WIDTH + 4))
