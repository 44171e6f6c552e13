# SPDX-License-Identifier: Apache-2.0
"""From the arguments of one verb to its command, or to its help."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Annotated, Any, Union

import tyro

from graycard.cli._options import (
    TakesSettings,
    check_values,
    given_options,
    near_option,
    option_names,
    refuse,
    show_help,
)
from graycard.cli._table import HELP, VERBS, Verb
from graycard.cli._terminal import Terminal


def parse_verb(verb: Verb, args: Sequence[str]) -> tuple[Any, list[str]]:
    """Return the command of a verb with its options, and what is left for a method or the renderer.

    Args:
        verb: The verb.
        args: Arguments after it.

    Raises:
        GraycardError: The verb does not take some argument, a value is none of those that it knows, or text
            is in place of a number.
        SystemExit: An argument is missing, or a value is of the wrong type; tyro has said which.
    """
    kind, prog = verb.load(), f"graycard {verb.name}"
    known = option_names(kind)
    given = given_options(args)
    wrong = [option for option in given if option not in {*known, *HELP, "--"}]
    if issubclass(kind, TakesSettings):  # may be a setting, unless it is like what is missing
        known = _required(kind) - {*given}
        wrong = [option for option in wrong if near_option(option, known)]
    refuse(wrong, prog, known)
    check_values(kind, args)
    command, rest = tyro.cli(kind, args=args, prog=prog, return_unknown_args=True)
    if not isinstance(command, TakesSettings):
        refuse(rest, prog, known)
    return command, rest


def _required(kind: type[Any]) -> set[str]:
    """Return the options that may not be left out."""
    fields = (field for field in dataclasses.fields(kind) if field.default is dataclasses.MISSING)
    return {*option_names(kind)} & {"--" + field.name.replace("_", "-") for field in fields}


def show_verb_help(verb: Verb, args: Sequence[str], terminal: Terminal) -> None:
    """Print an example, the purpose and the options of a verb; of its subject, the settings that may follow.

    Args:
        verb: The verb.
        args: Arguments after it: the first may be a method, or a track to render.
        terminal: Where the example goes.

    Raises:
        GraycardError: There is no such method.
    """
    kind, prog = verb.load(), f"graycard {verb.name}"
    subject = next((arg for arg in args if arg not in HELP), "")
    settings = _settings_of(kind, subject)
    terminal.out.print(f"example: {verb.example}\n")
    show_help(kind, prog, terminal)
    if settings is not None:
        terminal.out.print(f"Options of `{prog} {subject}` that may follow:\n")
        show_help(settings, f"{prog} {subject} ...", terminal)


def _settings_of(kind: type[Any], subject: str) -> type[Any] | None:
    named = issubclass(kind, TakesSettings) and subject and not subject.startswith("-")
    return kind.settings_of(subject) if named else None


def write_completion(args: Sequence[str]) -> None:
    """Let tyro answer its own options, ``--tyro-print-completion SHELL`` and the like, for all verbs.

    Raises:
        SystemExit: Always: tyro ends the program.
    """
    commands = tuple(
        Annotated[verb.load(), tyro.conf.subcommand(verb.name, prefix_name=False)] for verb in VERBS
    )
    union: Any = Union[commands]  # pyright: ignore[reportInvalidTypeArguments]  # noqa: UP007 -- built here
    tyro.cli(union, args=args, prog="graycard")
