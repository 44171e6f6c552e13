# SPDX-License-Identifier: Apache-2.0
"""Options of verbs, methods and the renderer: their names, their help, and near matches of misspelt ones."""

from __future__ import annotations

import dataclasses
import inspect
import shutil
import textwrap
from collections.abc import Collection, Iterable, Iterator, Sequence
from contextlib import suppress
from difflib import get_close_matches
from itertools import chain, takewhile
from pathlib import Path
from types import NoneType, UnionType
from typing import (
    Annotated,
    Any,
    Literal,
    Protocol,
    TypeVar,
    Union,
    get_args,
    get_origin,
    get_type_hints,
    runtime_checkable,
)

import tyro

from graycard._errors import GraycardError, UnknownNameError
from graycard.cli._terminal import Terminal

_NEAR = 0.6
"""Likeness from which an option counts as misspelt: the default of :func:`difflib.get_close_matches`."""
_WIDEST = 100
"""Characters of the longest line of a docstring."""
Settings = TypeVar("Settings")


def optional(metavar: str) -> Any:
    """Return what tyro is to show of an option that may be left out; its help says what then holds."""
    return tyro.conf.arg(metavar=metavar, help_behavior_hint="")


Json = Annotated[Path | None, optional("FILE")]
Timeout = Annotated[float | None, optional("SECONDS")]
Memory = Annotated[float | None, optional("GIB")]
SaltFile = Annotated[Path | None, optional("FILE")]


@runtime_checkable
class TakesSettings(Protocol):
    """A command after whose own options those of a method or of the renderer may follow."""

    @classmethod
    def settings_of(cls, subject: str) -> type[Any] | None:
        """Return the dataclass of settings that may follow.

        Args:
            subject: First argument of the verb.

        Raises:
            GraycardError: There is no such subject.
        """
        ...


def option_names(kind: type[Any], prefix: str = "--") -> list[str]:
    """Return the options that tyro makes of a dataclass, as ``--hold-out`` and ``--capture.bits``."""
    names = []
    for name, hint in get_type_hints(kind, include_extras=True).items():
        option = prefix + name.rstrip("_").replace("_", "-")  # from_ is --from
        if dataclasses.is_dataclass(hint):
            names += option_names(kind=hint, prefix=f"{option}.")  # pyright: ignore[reportArgumentType]
        elif not _is_positional(hint):
            names += [option] if hint is not bool else [option, f"{prefix}no-{option.removeprefix(prefix)}"]
    return names


def _is_positional(hint: Any) -> bool:
    return get_origin(hint) is Annotated and tyro.conf.Positional in hint.__metadata__


def given_options(args: Iterable[str]) -> list[str]:
    """Return the options among arguments, without values and with hyphens; a negative number is a value.

    What follows ``--`` is no option.
    """
    args = takewhile(lambda arg: arg != "--", args)
    options = (arg.partition("=")[0].replace("_", "-") for arg in args if arg.startswith("-"))
    return [option for option in options if not _is_number(option)]


def _is_number(text: str) -> bool:
    with suppress(ValueError):
        float(text)
        return True
    return False


def near_option(option: str, known: Iterable[str]) -> str | None:
    """Return the known option that an unknown one is most like, if any is."""
    return next(iter(get_close_matches(option.replace("_", "-"), known, n=1, cutoff=_NEAR)), None)


def check_values(kind: type[Any], args: Sequence[str]) -> None:
    """Refuse a value that is none of those that an option knows, text where a number is asked for, and a list
    without values.

    Args:
        kind: Dataclass of the options.
        args: Arguments after the verb.

    Raises:
        UnknownNameError: There is a value that is not known; it names the one that it is most like.
        GraycardError: There is text in place of a number, or nothing.
    """
    hints = get_type_hints(kind, include_extras=True)
    options = {"--" + name.rstrip("_").replace("_", "-"): hint for name, hint in hints.items()}
    for option, found in _valued(args):
        hint = options.get(option)
        known = _choices(hint)
        if known and found not in known:
            raise UnknownNameError(f"value of {option}", found, known)
        is_absent = not found or found.startswith("--")
        if is_absent and get_origin(_parts(hint)[0]) is tuple:
            raise GraycardError(f"expected one or more values after {option}, got none")
        if not is_absent and (wanted := _number_asked_for(hint, found)):
            raise GraycardError(f"expected {wanted} after {option}, got {found!r}")
    first = next((name for name, hint in hints.items() if _is_positional(hint)), "")
    known = _choices(hints[first]) if first else ()
    if args and known and not args[0].startswith("-") and args[0] not in known:
        raise UnknownNameError(first, args[0], known)


def _choices(hint: Any) -> tuple[str, ...]:
    """Return the texts that a hint allows; none where it allows others as well."""
    parts = [part for part in _parts(hint) if part is not NoneType]
    found = [get_args(part) if get_origin(part) is Literal else () for part in parts]
    return tuple(dict.fromkeys(map(str, chain(*found)))) if all(found) else ()


def _number_asked_for(hint: Any, found: str) -> str:
    """Return what a hint asks for, in words, where it takes numbers alone and got none; else nothing."""
    parts = {*_parts(hint)}
    kinds = parts - {NoneType}
    if not kinds or not kinds <= {int, float} or (found == "None" and NoneType in parts):
        return ""
    try:
        float(found) if float in kinds else int(found)
    except ValueError:
        return "a number" if float in kinds else "a whole number"
    return ""


def _parts(hint: Any) -> tuple[Any, ...]:
    """Return the types that a hint is a union of, or the hint itself."""
    if get_origin(hint) is Annotated:
        return _parts(get_args(hint)[0])
    if get_origin(hint) in (Union, UnionType):
        return tuple(chain(*map(_parts, get_args(hint))))
    return (hint,)


def _valued(args: Sequence[str]) -> Iterator[tuple[str, str]]:
    """Yield options that have one value each, until ``--``; options have hyphens."""
    own = [*takewhile(lambda arg: arg != "--", args)]
    for arg, after in zip(own, [*own[1:], ""], strict=False):
        if arg.startswith("--"):
            option, equals, value = arg.partition("=")
            yield option.replace("_", "-"), value if equals else after


def refuse(rest: Sequence[str], command: str, known: Collection[str]) -> None:
    """Refuse arguments that were not understood.

    Args:
        rest: What was left over; nothing is refused where it is empty.
        command: The command that was given, as ``graycard fit gray``.
        known: Options that it takes.

    Raises:
        GraycardError: There are some; it names the options that they are most like.
    """
    if not rest:
        return
    near = (near_option(option, known) for option in rest if option.startswith("-"))
    hints = " and ".join(dict.fromkeys(option for option in near if option))
    meant = f" (did you mean {hints}?)" if hints else ""
    raise GraycardError(
        f"expected options of `{command}`, got {' '.join(rest)}{meant}. See `{command} --help`"
    )


def parse_settings(kind: type[Settings], args: Sequence[str], command: str, also: type[Any]) -> Settings:
    """Return the settings of a method or the renderer from what its verb left over.

    Args:
        kind: Dataclass of the settings.
        args: Arguments that the verb did not take.
        command: The command that was given, as ``graycard fit gray``.
        also: Dataclass of the verb's own options, for near matches.

    Raises:
        GraycardError: An argument is no setting.
        SystemExit: A value is not allowed; tyro has said why.
    """
    check_values(kind, args)
    settings, rest = tyro.cli(kind, args=args, prog=command, return_unknown_args=True)
    if rest:
        refuse(rest, command, [*option_names(kind), *option_names(also)])
    return settings


def show_help(kind: type[Any], command: str, terminal: Terminal) -> None:
    """Print the docstring of a dataclass of options, then its options."""
    if purpose := _wrapped_docstring(kind):
        terminal.out.print(purpose + "\n")
    with suppress(SystemExit):  # tyro writes a help only on its way out of the program
        tyro.cli(kind, args=["--help"], prog=command, description="")


def _wrapped_docstring(kind: type[Any]) -> str:
    """Return the docstring of a dataclass, wrapped to the terminal; tyro would leave its lines long.

    What it raises is for readers of the code, and is left out.
    """
    text = inspect.cleandoc(kind.__doc__ or "").partition("\n\nRaises:\n")[0]
    if text.startswith(f"{kind.__name__}("):  # made by dataclass where there is none
        return ""
    width = min(shutil.get_terminal_size().columns, _WIDEST)
    return "\n\n".join(
        part if "\n " in part else textwrap.fill(part, width, break_on_hyphens=False)
        for part in text.split("\n\n")
    )
