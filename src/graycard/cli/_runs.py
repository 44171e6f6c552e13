# SPDX-License-Identifier: Apache-2.0
"""The verbs that list methods and fit one."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import tyro

from graycard._errors import GraycardError
from graycard.cli._options import Json, Memory, Timeout, optional, parse_settings, show_help
from graycard.cli._terminal import OK, Terminal, new_table, write_optional_json

if TYPE_CHECKING:
    from graycard.benchmarks import Limits
    from graycard.methods import Ask


@dataclass(frozen=True)
class MethodsCommand:
    """List the methods, or show one with its settings."""

    name: Annotated[str | None, tyro.conf.Positional, optional("[NAME]")] = None
    """Show this method: a name or module:attribute."""
    json: Json = None
    """Also write the list to this file."""

    def run(self, terminal: Terminal, rest: list[str]) -> int:
        """List the methods; one that cannot be loaded says why and hurts no other."""
        if self.name is not None:
            return self._show(terminal, self.name)
        from graycard.methods import listings

        found = listings()
        table = new_table("method", "from", "what it does")
        for row in found:
            table.add_row(row.name, row.origin, row.summary or f"cannot be loaded: {row.reason}")
        terminal.out.print(table)
        write_optional_json(self.json, found)
        for mend in dict.fromkeys(row.mend for row in found if row.mend):
            terminal.advise(f"run {mend}")
        broken = sum(row.summary is None for row in found)
        terminal.out.print(f"methods: {len(found) - broken} work, {broken} cannot be loaded")
        return OK

    def _show(self, terminal: Terminal, name: str) -> int:
        from graycard.methods import asks_of, load_method

        method = load_method(name)
        terminal.out.print(f"{name}: {method.summary}")
        asked = [f"{ask.kind} of {', '.join(ask.of)}" for ask in asks_of(method)]
        terminal.out.print(f"is handed beyond the capture: {', '.join(method.needs) or 'nothing'}")
        terminal.out.print(f"asks a prior for: {'; '.join(asked) or 'nothing'}\n")
        show_help(method.settings_type, f"graycard fit {name} SCENE --out PREDICTIONS", terminal)
        settings = method.settings_type()
        write_optional_json(
            self.json, {"name": name, "summary": method.summary, "needs": method.needs, "settings": settings}
        )
        terminal.out.print(f"methods: {name} with {settings}")
        return OK


def limits_of(timeout: float | None, memory: float | None) -> Limits:
    """Return the limits of fits that options ask for.

    Args:
        timeout: Seconds; None for a day.
        memory: GiB; None for all that the machine has.

    Raises:
        GraycardError: A number is not above 0.
    """
    from graycard.benchmarks import USUAL, Limits

    for option, value in (("--timeout", timeout), ("--memory", memory)):
        if value is not None and not 0 < value < math.inf:
            raise GraycardError(f"expected a number above 0, got {value}. Mend {option}")
    return Limits(timeout or USUAL.time_s, None if memory is None else max(1, round(memory * 1024)))


@dataclass(frozen=True)
class FitCommand:
    """Fit a method on a scene; its own settings may follow as options."""

    method: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="METHOD")]
    """A name or module:attribute; `graycard fit NAME --help` shows its settings."""
    scene: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="SCENE")]
    """DATASET/<track>/<scene>."""
    out: Annotated[Path, tyro.conf.arg(metavar="PREDICTIONS")]
    """Write the predictions to this folder; predictions that it holds are replaced."""
    seed: int = 0
    """Equal seeds give equal predictions."""
    save: Annotated[Path | None, optional("FOLDER")] = None
    """Also save the decomposition itself here."""
    priors: str = "none"
    """Source of priors: none, oracle:SEVERITY, classical, pretrained:own, pretrained:FOLDER, or a path that
    ends in .toml. SEVERITY is 0, the truth itself, to 5. TorchScript files (.pt) in FOLDER are programs,
    run in the fit's sandbox: take them from whom you trust. Weights in safetensors are numbers alone."""
    donor: Annotated[Path | None, optional("SCENE")] = None
    """Also fit this scene, and insert its object as the truth does."""
    timeout: Timeout = None
    """Seconds after which the fit has failed; a day by default."""
    memory: Memory = None
    """Memory that the fit may take, GiB; that of the machine by default."""
    allow: Annotated[tuple[Path, ...], optional("PATH ...")] = ()
    """Let the method read and change these files and folders, such as its weights; they are recorded."""
    json: Json = None
    """Also write the cost and the settings to this file."""

    @classmethod
    def settings_of(cls, subject: str) -> type[Any]:
        """Return the settings of a method."""
        from graycard.methods import load_method

        return load_method(subject).settings_type

    def run(self, terminal: Terminal, rest: list[str]) -> int:
        """Fit, then render every view."""
        from graycard.benchmarks import FitSpec, fit_apart, fit_words
        from graycard.dataset import check_scene
        from graycard.io import remove_leftovers
        from graycard.methods.priors import PriorSpec, parse_priors, unanswered

        if not 0 <= self.seed < 2**32:
            raise GraycardError(f"expected a seed from 0 to {2**32 - 1}, got {self.seed}. Mend --seed")
        for folder in (self.scene, self.donor):
            if folder is not None:
                check_scene(folder)
        limits = limits_of(self.timeout, self.memory)
        with terminal.progress(f"{self.method}: asking for its settings"):
            settings, asks = self._told(rest, limits)
        priors = parse_priors(self.priors)
        spec = FitSpec(
            self.method, settings, self.seed, self.scene, priors=priors, donor=self.donor, allowed=self.allow
        )
        remove_leftovers(self.out)
        try:
            with terminal.progress(fit_words(spec)) as progress:
                cost = fit_apart(spec, self.out, progress, self.save, limits).cost
        finally:  # a fit that fails is killed
            remove_leftovers(self.out)
        write_optional_json(self.json, {"predictions": self.out, "settings": settings, "cost": cost})
        terminal.out.print(f"fit: {self.out} in {cost.wall_s:.1f} s, {cost.peak_memory_mib:.0f} MiB")
        if priors != PriorSpec() and (lacking := unanswered(priors, asks)):
            terminal.advise(
                f"{self.priors} answers nothing of {', '.join(lacking)}, which {self.method} can ask for"
            )
        return OK

    def _told(self, rest: list[str], limits: Limits) -> tuple[dict[str, Any], tuple[Ask, ...]]:
        """Return the settings of the fit, and what the method asks a prior for.

        Code of others is not imported here.

        Raises:
            GraycardError: The method does not load, or an argument is no setting of it.
            SystemExit: A value is not allowed; tyro has said why.
        """
        from graycard.benchmarks import ask_apart
        from graycard.io import from_builtins
        from graycard.methods import BUILT_IN, Ask

        if self.method in BUILT_IN:
            told = told_settings(self.method, rest)
        else:
            asked = {"method": self.method, "args": rest}
            function = f"{__name__}:told_settings"
            told = ask_apart(self.method, self.scene, function, limits, told=asked, allowed=self.allow)
        if told["exit"] is not None:
            raise SystemExit(told["exit"])
        return told["settings"], tuple(from_builtins(Ask, ask) for ask in told["asks"])


def told_settings(method: str, args: list[str]) -> dict[str, Any]:
    """Import a method, and return its settings by the arguments that ``graycard fit`` left over.

    Returns:
        JSON data: ``settings``, ``asks``, and ``exit``, an exit code where a value is not allowed, else None.

    Raises:
        GraycardError: It does not load, or an argument is no setting of it.
    """
    from graycard.io import to_builtins
    from graycard.methods import asks_of, load_method

    loaded = load_method(method)
    try:
        settings = parse_settings(loaded.settings_type, args, f"graycard fit {method}", FitCommand)
    except SystemExit as end:
        return {"settings": {}, "asks": [], "exit": end.code}
    return {"settings": to_builtins(settings), "asks": to_builtins(list(asks_of(loaded))), "exit": None}
