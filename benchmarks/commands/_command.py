# SPDX-License-Identifier: Apache-2.0
"""A command of a suite: what is run, by which interpreter, on what, and how its outputs are read."""

import math
import re
import shlex
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, fields
from typing import Any, Literal

from graycard.adoption import find_layout, parse_map

PLACES = ("capture", "out", "seed")
"""Placeholders that ``run`` may have besides the names of settings."""
RECORDED = "command"
"""Key under which settings of a job say what was run."""
_PLACE = re.compile(r"\{([A-Za-z_][A-Za-z0-9_]*)\}")
_VARIABLE = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")
_OURS = ("GRAYCARD_", "LD_", "DYLD_")
"""Begins of names of variables that a suite may not set."""
Input = Literal["graycard", "arrays", "nerfstudio", "colmap", "colmap-binary", "blender"]


@dataclass(frozen=True, kw_only=True)
class Command:
    """A command, as a row of a suite has it; without ``run`` there is none."""

    run: str = ""
    """Command, as ``python infer.py {capture} {out}``: no shell reads it. ``{capture}`` is a folder with
    the capture, ``{out}`` an empty one for predictions, ``{seed}`` the seed, ``{name}`` a setting."""
    python: str = ""
    """Interpreter that stands for ``python``, as ``/envs/theirs/bin/python``; graycard's own if empty."""
    setup: str = ""
    """Command that runs before the clock does, without ``{capture}`` and ``{out}``: to build code, say."""
    timeout: float | None = None
    """Seconds after which the command has failed; None: those of the bench."""
    environment: Mapping[str, str] = field(default_factory=dict)
    """Environment variables besides."""
    folder: str = ""
    """Folder of its code, relative to where graycard runs; there if empty."""
    code: tuple[str, ...] = ()
    """Files and folders of its code in ``folder``, besides those that ``run`` names. A copy of them is run,
    and they are hashed."""
    reads: tuple[str, ...] = ()
    """Files and folders elsewhere that it may read, as weights; they are hashed."""
    versions: Mapping[str, str] = field(default_factory=dict)
    """Versions for the record, as a commit."""
    input: Input = "graycard"
    """Format of ``{capture}``: graycard's own, its photographs as NPY, or that of another program."""
    layout: str = ""
    """Layout of published code that ``{out}`` has, as of ``graycard adopt``; empty: see ``maps``."""
    maps: tuple[str, ...] = ()
    """Places and conventions of layers in ``{out}``, as of ``graycard adopt --map``. Without either the
    command writes graycard's predictions."""

    def check(self, name: str, settings: Mapping[str, Any]) -> None:
        """Refuse what cannot be run.

        Args:
            name: Of the row.
            settings: Of the row, which are placeholders.

        Raises:
            ValueError: A placeholder or variable is none, a time is not above 0, or there is no ``run``.
            UnknownNameError: There is no such layout or word.
        """
        if not self.run:
            self._check_alone(name)
            return
        if self.timeout is not None and not 0 < self.timeout < math.inf:
            raise ValueError(f"expected a timeout above 0 s for {name}, got {self.timeout}")
        for text, known in ((self.run, {*PLACES, *settings}), (self.setup, {*settings})):
            self._check_words(name, text, known)
        if taken := sorted({*PLACES, RECORDED} & {*settings}):
            raise ValueError(f"expected settings of {name} other than {taken[0]}, which is taken. Rename it")
        for variable in self.environment:
            if not _VARIABLE.fullmatch(variable) or variable.startswith(_OURS):
                raise ValueError(f"expected environment variables for {name}, got {variable!r}. Leave it out")
        if self.layout:
            find_layout(self.layout)
        for text in self.maps:
            parse_map(text)

    def _check_alone(self, name: str) -> None:
        others = [f.name for f in fields(Command) if f.name != "run" and getattr(self, f.name) != _default(f)]
        if others:
            raise ValueError(f"expected `run` for {name}, which has {others[0]}, got none. Say what is run")

    def _check_words(self, name: str, text: str, known: set[str]) -> None:
        try:
            words = shlex.split(text)
        except ValueError as cause:
            raise ValueError(
                f"expected a command for {name}, got {text!r}: {cause}. Mend its quotes"
            ) from None
        if text and not words:
            raise ValueError(f"expected a command for {name}, got {text!r}, which is blank. Leave it out")
        unknown = [place for word in words for place in _PLACE.findall(word) if place not in known]
        if unknown:
            raise ValueError(
                f"expected placeholders of {name} among {', '.join(sorted(known)) or 'none'}, got "
                f"{{{unknown[0]}}} in {text!r}. Give it a setting of that name, or mend the command"
            )
        if text == self.run and not any("{out}" in word for word in words):
            raise ValueError(
                f"expected {{out}} in the command of {name}, got {text!r}: it is told nowhere to write to"
            )


def words_of(text: str, values: Mapping[str, Any] = {}) -> list[str]:
    """Return the words of a command with values in the place of placeholders; others stay."""
    return [_PLACE.sub(lambda place: str(values.get(place[1], place[0])), word) for word in shlex.split(text)]


def is_fixed(word: str) -> bool:
    """Tell whether a word of a command has no placeholder."""
    return not _PLACE.search(word)


def told_of(command: Command) -> Iterator[tuple[str, Any]]:
    """Yield what a command says besides its defaults, for the record."""
    for part in fields(Command):
        if (value := getattr(command, part.name)) != _default(part):
            yield part.name, value


def _default(part: Any) -> Any:
    """Return the default of a field of a dataclass."""
    return part.default_factory() if callable(part.default_factory) else part.default
