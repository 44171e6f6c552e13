# SPDX-License-Identifier: Apache-2.0
"""The verbs for who writes a method."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import tyro

from graycard._errors import GraycardError
from graycard.cli._options import Json, Timeout, optional
from graycard.cli._runs import limits_of
from graycard.cli._terminal import FAILED, OK, Terminal, write_optional_json
from graycard.processes import named

if TYPE_CHECKING:
    from graycard.benchmarks import Command
    from graycard.benchmarks.kit import Fault, Findings


@dataclass(frozen=True)
class NewMethodCommand:
    """Write the skeleton of a method: a package with tests, CI and a card, or one file."""

    name: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="NAME")]
    """Lower-case words joined by _ or -, as my_method."""
    one_file: bool = False
    """Write NAME.py alone, with its test in it."""
    out: Annotated[Path, tyro.conf.arg(metavar="FOLDER")] = Path()
    """Write it in this folder."""

    def run(self, terminal: Terminal, rest: list[str]) -> int:
        """Write it, and say what comes next."""
        from graycard.benchmarks.kit import class_of, new_method

        made = new_method(self.name, self.out, one_file=self.one_file)
        package = self.name.replace("-", "_")
        if self.one_file:
            where = "" if self.out == Path() else f"cd {shlex.quote(str(self.out))} && "
            terminal.say(f"next: {where}graycard test-method {package}:{class_of(self.name)}")
        else:
            folder = shlex.quote(str(made))
            terminal.say(f"next: cd {folder} && pip install -e '.[test]' && graycard test-method {package}")
        terminal.out.print(f"new-method: {made}")
        return OK


@dataclass(frozen=True)
class TestMethodCommand:
    """Check the contract of a method on a tiny scene, in seconds. Each fault comes with its mend."""

    method: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="METHOD")]
    """A name, module:attribute, or a command as "python infer.py {capture} {out}"."""
    settings: Annotated[tuple[str, ...], optional("NAME=VALUE ...")] = ()
    """Settings; `iterations` are 20 where there are any."""
    priors: Annotated[str | None, optional("SOURCE")] = None
    """Source of priors, as of `graycard fit`; for a method that has to ask the oracle."""
    allow: Annotated[tuple[Path, ...], optional("PATH ...")] = ()
    """Let the method read and change these files and folders."""
    timeout: Timeout = None
    """Seconds that each of its fits may take; 120 by default."""
    python: Annotated[str | None, optional("PATH")] = None
    """Interpreter of a command, as /envs/theirs/bin/python."""
    folder: Annotated[str | None, optional("FOLDER")] = None
    """Folder of a command's code."""
    code: Annotated[tuple[str, ...], optional("PATH ...")] = ()
    """Files and folders of its code besides those that the command names."""
    reads: Annotated[tuple[str, ...], optional("PATH ...")] = ()
    """Files and folders elsewhere that a command reads."""
    input: Annotated[
        Literal["graycard", "arrays", "nerfstudio", "colmap", "colmap-binary", "blender"],
        tyro.conf.arg(metavar="FORMAT"),
    ] = "graycard"
    """Format of a command's capture: graycard, arrays, nerfstudio, colmap, colmap-binary or blender."""
    layout: Annotated[str | None, optional("NAME")] = None
    """Layout of a command's outputs, as of `graycard adopt`."""
    map: Annotated[tuple[str, ...], optional("LAYER=PATTERN:WORD ...")] = ()
    """Places of layers in a command's outputs, as of `graycard adopt`."""
    json: Json = None
    """Also write what was found to this file."""

    def run(self, terminal: Terminal, rest: list[str]) -> int:
        """Check it, and show faults."""
        found = self._found(terminal)
        for fault in found.faults:
            _show(fault, terminal)
        write_optional_json(self.json, {"findings": found, "faults": [_told(f) for f in found.faults]})
        count = len(found.faults)
        fitted = f", fitted on {found.track}{_words_of(found.settings)}" if found.track else ""
        layers = f"; renders {', '.join(found.provides)}" if found.provides else ""
        terminal.out.print(
            f"test-method: {found.method}: {count or 'no'} fault{'s' * (count != 1)} in {found.seconds:.0f} s"
            f"{fitted}{layers}"
        )
        return FAILED if found.faults else OK

    def _found(self, terminal: Terminal) -> Findings:
        from graycard.benchmarks.kit import check_command, check_method
        from graycard.methods.priors import parse_priors

        settings = _settings_in(self.settings)
        told: dict[str, Any] = {"allowed": self.allow}
        if self.timeout is not None and (limit := limits_of(self.timeout, None).time_s) is not None:
            told["timeout_s"] = limit
        if not self._is_command():
            self._refuse_parts()
            priors = None if self.priors is None else parse_priors(self.priors)
            with terminal.progress(f"{self.method}: importing it") as progress:
                return check_method(self.method, settings, priors, named(progress, self.method), **told)
        if self.priors is not None:
            raise GraycardError("expected no --priors for a command, which is told none. Leave it out")
        try:
            return check_command(self._command(), settings, **told)
        except ValueError as cause:
            raise GraycardError(f"{cause}. Mend METHOD or --settings") from cause

    def _is_command(self) -> bool:
        return any(part in self.method for part in (" ", "{out}"))

    def _command(self) -> Command:
        from graycard.benchmarks import Command

        return Command(
            run=self.method,
            python=self.python or "",
            folder=self.folder or "",
            code=self.code,
            reads=self.reads,
            input=self.input,
            layout=self.layout or "",
            maps=self.map,
        )

    def _refuse_parts(self) -> None:
        """Refuse options that a method has no use for."""
        given = {
            "--python": self.python, "--folder": self.folder, "--code": self.code, "--reads": self.reads,
            "--layout": self.layout, "--map": self.map, "--input": self.input != "graycard",
        }  # fmt: skip
        if named := [option for option, value in given.items() if value]:
            raise GraycardError(
                f"expected {named[0]} with a command, got it with {self.method!r}. A command has {{out}} in "
                'it, as "python infer.py {capture} {out}"'
            )


def _settings_in(texts: Sequence[str]) -> dict[str, Any]:
    """Return settings of ``NAME=VALUE``, each a value of TOML, or else a text.

    Raises:
        GraycardError: One is not of this form.
    """
    from graycard.io import parse_toml

    found: dict[str, Any] = {}
    for text in texts:
        name, is_there, value = text.partition("=")
        if not name.isidentifier() or not is_there:
            raise GraycardError(f"expected settings as NAME=VALUE, got {text!r}. Mend --settings")
        try:
            found[name] = parse_toml(f"value = {value}")["value"]
        except (ValueError, KeyError):
            found[name] = value
    return found


def _show(fault: Fault, terminal: Terminal) -> None:
    terminal.say(f"fault {fault.name}: {fault.title}", *_indented(fault.found), f"mend: {fault.mend}")
    for line in fault.trace.splitlines():
        terminal.out.print(f"    {line}")


def _indented(text: str) -> list[str]:
    lines = [line for line in text.splitlines() if line.strip()]
    return [f"found: {lines[0]}", *lines[1:]] if lines else []


def _told(fault: Fault) -> dict[str, str]:
    return {"name": fault.name, "title": fault.title, "mend": fault.mend}


def _words_of(settings: Any) -> str:
    told = ", ".join(f"{name} = {value}" for name, value in settings.items())
    return f" with {told}" if told else ""
