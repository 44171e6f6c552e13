# SPDX-License-Identifier: Apache-2.0
"""The verbs that run methods, and hold runs against baselines."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import tyro

from graycard._errors import GraycardError
from graycard.cli._checks import salt_in
from graycard.cli._options import Json, Memory, SaltFile, Timeout, optional, parse_settings, show_help
from graycard.cli._terminal import FAILED, OK, Terminal, new_table, write_optional_json
from graycard.cli._warnings import run_lines
from graycard.cli.adoption._captures import refuse_scenes
from graycard.io import Progress
from graycard.records import Looks, RunRecord

if TYPE_CHECKING:
    from graycard.benchmarks import Limits, Salt
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

    @classmethod
    def settings_of(cls, subject: str) -> type[Any]:
        """Return the settings of a method."""
        from graycard.methods import load_method

        return load_method(subject).settings_type

    def run(self, terminal: Terminal, rest: list[str]) -> int:
        """Fit, then render every view."""
        from graycard.benchmarks import FitSpec, fit_apart
        from graycard.dataset import check_scene
        from graycard.io import remove_leftovers
        from graycard.methods.priors import PriorSpec, parse_priors, unanswered

        if not 0 <= self.seed < 2**32:
            raise GraycardError(f"expected a seed from 0 to {2**32 - 1}, got {self.seed}. Mend --seed")
        for folder in (self.scene, self.donor):
            if folder is not None:
                check_scene(folder)
        limits = limits_of(self.timeout, self.memory)
        settings, asks = self._told(rest, limits)
        priors = parse_priors(self.priors)
        spec = FitSpec(
            self.method, settings, self.seed, self.scene, priors=priors, donor=self.donor, allowed=self.allow
        )
        remove_leftovers(self.out)
        try:
            with terminal.progress() as progress:
                cost = fit_apart(spec, self.out, progress, self.save, limits).cost
        finally:  # a fit that fails is killed
            remove_leftovers(self.out)
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


@dataclass(frozen=True)
class BenchCommand:
    """Run a suite from scene to report; what is there already is reused."""

    suite: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="SUITE")]
    """A suite, or a path to one of your own that ends in .toml."""
    tracks: Annotated[tuple[str, ...], optional("TRACK ...")] = ()
    """Run these tracks only."""
    methods: Annotated[tuple[str, ...], optional("METHOD ...")] = ()
    """Run these rows, or all rows of these methods; others than the suite's by name or module:attribute."""
    predictions: Annotated[tuple[str, ...], optional("NAME=FOLDER ...")] = ()
    """Add rows of these names, with predictions by other code at FOLDER/<track>/<scene>/."""
    jobs: Annotated[int | None, optional("INT")] = None
    """Fits at a time; as many as there are cores by default."""
    timeout: Timeout = None
    """Seconds after which a fit has failed, stages that it found done left out; a day by default."""
    memory: Memory = None
    """Memory that a fit may take, GiB; that of the machine by default."""
    out: Annotated[Path | None, optional("RUN")] = None
    """The run folder; runs/<suite> by default."""
    dataset: Annotated[Path | None, optional("DATASET")] = None
    """The folder with the scenes; scenes that it lacks are rendered into it. RUN/dataset by default."""
    until_decided: bool = False
    """Add scenes of the suite's reserve until every claim that can be tested is decided."""
    max_scenes: Annotated[int | None, optional("N")] = None
    """With --until-decided: end at so many scenes. The level of each verdict follows from N: keep it."""
    claims: Annotated[tuple[str, ...], optional("NAME ...")] = ()
    """With --until-decided: decide these claims only. Those made for the suite by default."""
    sealed: bool = False
    """Run the sealed scenes in place of the suite's; only at a git tag, or in an installed release."""
    allow: Annotated[tuple[Path, ...], optional("PATH ...")] = ()
    """Let methods read and change these files and folders, such as their weights; they are recorded."""
    salt: SaltFile = None
    """Also run the suite's secret scenes, which follow from the salt in this file (`graycard salt`). Without,
    the public ones are run."""
    budget: float = 1.0
    """Multiply the iterations of all fits, as by 0.5 or 2, for `graycard claims --half --twice`."""

    def run(self, terminal: Terminal, rest: list[str]) -> int:
        """Run the suite; a job or a score that failed makes the exit code 1."""
        from graycard.benchmarks import usable_cores
        from graycard.reports import write_report
        from graycard.synth import find_llvm

        refuse_scenes(self.suite)
        self._check()
        salt = None if self.salt is None else salt_in(self.salt, terminal)
        jobs = usable_cores() if self.jobs is None else self.jobs
        terminal.advise(find_llvm().advice)
        with terminal.progress() as progress:
            run, record = (
                self._pursue(jobs, progress) if self.until_decided else self._bench(jobs, progress, salt)
            )
        report = write_report(run)
        for first, *more in run_lines(record):
            terminal.say(f"warning: {first}", *more)
        failures = _failures(record)
        for line in failures:
            terminal.err.print(f"failed: {line}")
        lost = _show_looks(record.looks, len(record.scenes), terminal) if record.looks else False
        terminal.out.print(
            f"bench: {len(record.results)} jobs, {len(failures)} failures, {record.wall_s:.1f} s; "
            f"report: {report.resolve()}"
        )
        terminal.advise(_left_out(self.suite, record))
        if record.looks and failures:
            terminal.advise("run the same command again: what failed is tried again, the rest is reused")
        return FAILED if failures or lost else OK

    def _check(self) -> None:
        """Refuse options that go with --until-decided alone, or not with it.

        Raises:
            GraycardError: Some do not go together, or one that goes with another stands alone.
        """
        self._check_pairs()
        others = {
            "--tracks": self.tracks, "--methods": self.methods, "--predictions": self.predictions,
            "--sealed": self.sealed, "--budget": self.budget != 1, "--salt": self.salt is not None,
        }  # fmt: skip
        given = [name for name, value in others.items() if value]
        if self.until_decided and given:
            raise GraycardError(
                f"expected --until-decided without {', '.join(given)}, got both. It runs the whole suite as "
                "it is"
            )

    def _check_pairs(self) -> None:
        """Refuse an option without the one that it goes with, or with one that it does not go with.

        Raises:
            GraycardError: There is one.
        """
        if self.until_decided and self.max_scenes is None:
            raise GraycardError(
                "expected --max-scenes N with --until-decided, got none. Give the number of scenes at which "
                "the run ends: the level of each verdict follows from it"
            )
        if self.sealed and self.salt is not None:
            raise GraycardError(
                "expected --sealed or --salt, got both. Leave out one: sealed scenes take the place of others"
            )
        given = {"--max-scenes": self.max_scenes is not None, "--claims": bool(self.claims)}
        alone = " and ".join(name for name, value in given.items() if value)
        if alone and not self.until_decided:
            raise GraycardError(
                f"expected --until-decided with {alone}, got none. Add it, or leave out {alone}"
            )

    def _bench(self, jobs: int, progress: Progress, salt: Salt | None) -> tuple[Path, RunRecord]:
        """Run the suite, or a part of it, on its own, its secret or its sealed scenes."""
        from graycard.benchmarks import (
            Terms,
            find_edition,
            load_suite,
            narrow,
            opened,
            run_bench,
            with_secret,
        )
        from graycard.benchmarks import with_predictions as with_rows

        whole = load_suite(self.suite)
        scenes = opened(whole) if self.sealed else whole if salt is None else with_secret(whole, salt)
        rows = with_rows(scenes, self.predictions)
        given = [method.row for method in rows.methods[len(whole.methods) :]]
        suite = narrow(rows, self.tracks, [*self.methods, *given] if self.methods else ())
        terms = Terms(self.budget, find_edition(self.suite) if self.sealed else None, self.allow)
        kind = f"{'-sealed' * self.sealed}{f'-budget-{self.budget:g}' if self.budget != 1 else ''}"
        run = self.out or Path("runs") / f"{suite.name}{kind}"
        part_of = whole if self.tracks or self.methods or self.predictions or self.sealed else None
        return run, run_bench(
            suite,
            run,
            jobs,
            progress,
            self.dataset,
            limits=limits_of(self.timeout, self.memory),
            whole=part_of,
            terms=terms,
        )

    def _pursue(self, jobs: int, progress: Progress) -> tuple[Path, RunRecord]:
        """Run the suite, and add scenes until its claims are decided."""
        from graycard.benchmarks import Plan, load_suite, run_until_decided

        suite, plan = load_suite(self.suite), Plan(self.max_scenes or 0, self.claims)
        run = self.out or Path("runs") / f"{suite.name}-until-decided"
        limits = limits_of(self.timeout, self.memory)
        return run, run_until_decided(
            suite, run, jobs, progress, plan, self.dataset, limits=limits, allowed=self.allow
        )


def _left_out(name: str, record: RunRecord) -> str:
    """Return advice where a suite has secret scenes that a run has not; empty else."""
    from graycard.benchmarks import load_suite

    secret = load_suite(name).secret
    if secret is None or record.commitment or record.edition:
        return ""
    scenes = f"{secret.count} secret scene{'s' * (secret.count != 1)} of the suite"
    holder = f"whoever holds the salt of {secret.commitment[:12]}… adds them by --salt FILE"
    return f"{scenes} were left out: {holder}"


def _show_looks(looks: Looks, scenes: int, terminal: Terminal) -> bool:
    """Say how a run that adds scenes ended; return true if it lost a claim on the way."""
    for name, why in looks.untestable.items():
        told = "can no longer be tested" if name in looks.lost else "cannot be tested"
        terminal.err.print(f"{told}: {name}: {why}")
    left = ", ".join(looks.made[-1].undecided) or "none"
    terminal.out.print(
        f"looks: {len(looks.made)} at {100 * looks.level:.2f} % each, {scenes} of at most {looks.most} "
        f"scenes; {looks.stopped}; undecided: {left}"
    )
    return bool(looks.lost)


def _failures(record: RunRecord) -> list[str]:
    """Return a line for each job that failed, and for each score that failed."""
    lines = []
    for result in record.results:
        where = f"{result.job.track}/{result.job.scene} {result.job.method}"
        if result.status == "failed":
            lines.append(f"{where}: {result.reason}")
        for score in result.sheet.scores if result.sheet else ():
            if score.status == "failed":
                lines.append(f"{where} {score.metric}: {score.reason}")
    return lines
