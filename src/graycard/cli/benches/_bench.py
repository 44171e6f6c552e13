# SPDX-License-Identifier: Apache-2.0
"""The verb that runs a suite from scenes to report."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from graycard._errors import GraycardError
from graycard.cli._checks import salt_in
from graycard.cli._options import Json, Memory, SaltFile, Timeout, optional
from graycard.cli._runs import limits_of
from graycard.cli._terminal import FAILED, OK, Terminal, write_optional_json
from graycard.cli._warnings import run_lines
from graycard.cli.adoption._captures import refuse_scenes
from graycard.cli.benches._lines import failures as failed_lines
from graycard.cli.benches._lines import left_out, show_looks
from graycard.cli.benches._standings import show_standings
from graycard.io import Progress, lock_words
from graycard.records import RunRecord, Size

if TYPE_CHECKING:
    from graycard.benchmarks import Salt, Suite, Terms
    from graycard.machines import Machines


@dataclass(frozen=True, slots=True)
class _Course:
    """The means of a run: jobs at a time, progress, machines, and where lines for the user go."""

    jobs: int
    progress: Progress
    machines: Machines | None
    terminal: Terminal


@dataclass(frozen=True, slots=True)
class _Chosen:
    """A suite as options narrow it, with the run folder; ``whole`` is None where nothing was narrowed."""

    suite: Suite
    run: Path
    whole: Suite | None


@dataclass(frozen=True)
class BenchCommand:
    """Run a suite from scene to report; what is there already is reused."""

    suite: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="SUITE")]
    """A suite, or a path to one of your own that ends in .toml."""
    tracks: Annotated[tuple[str, ...], optional("TRACK ...")] = ()
    """Run these tracks only."""
    scenes: Annotated[tuple[str, ...], optional("SCENE ...")] = ()
    """Run these scenes only, as corridor-0003 or dark/corridor-0003. Results of others that the run folder
    has stay."""
    methods: Annotated[tuple[str, ...], optional("METHOD ...")] = ()
    """Run these rows, or all rows of these methods; others than the suite's by name or module:attribute."""
    predictions: Annotated[tuple[str, ...], optional("NAME=FOLDER ...")] = ()
    """Add rows of these names, with predictions by other code at FOLDER/<track>/<scene>/."""
    compositions: bool = True
    """Also fit the scenes that objects come from, and put them in, where rows of the suite compose."""
    jobs: Annotated[int | None, optional("INT")] = None
    """Fits at a time, and scenes where memory allows; as many as there are cores by default."""
    timeout: Timeout = None
    """Seconds after which a fit has failed, stages that it found done left out; a day by default."""
    memory: Memory = None
    """Memory that a fit may take, GiB; that of the machine by default."""
    out: Annotated[Path | None, optional("RUN")] = None
    """The run folder; by default runs/<suite>, with what is other than in the suite, as in
    runs/demo-256-pixels."""
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
    pixels: Annotated[int | None, optional("WIDTH")] = None
    """Render pictures so many pixels wide, for `graycard claims --sizes`; their height follows."""
    views: Annotated[int | None, optional("N")] = None
    """Render so many training views of each scene, for the same."""
    surfels: float = 1.0
    """Multiply the surfels of all fits, for the same."""
    scheduler: Annotated[str | None, optional("local|ADDRESS|FILE.toml")] = None
    """Let Dask hand the jobs out: to workers of this machine, to those of a scheduler at tcp://HOST:PORT, or
    to the cluster that FILE.toml describes (docs/how-to/many-machines.md). This machine's processes by
    default."""
    only: Annotated[str | None, optional("K/N")] = None
    """Do the K-th of N parts, as a task of a job array does. The same command without --only gathers all."""
    json: Json = None
    """Also write the run folder, the report if there is one, and what failed to this file."""

    def run(self, terminal: Terminal, rest: list[str]) -> int:
        """Run the suite; a job or a score that failed makes the exit code 1."""
        from graycard.benchmarks import load_suite, noisy_scenes
        from graycard.reports import write_report
        from graycard.resources import usable_cores
        from graycard.synth import find_llvm

        refuse_scenes(self.suite)
        self._check()
        self._size()
        suite, salt = load_suite(self.suite), None if self.salt is None else salt_in(self.salt, terminal)
        jobs = usable_cores() if self.jobs is None else self.jobs
        terminal.advise(find_llvm().advice)
        with self._machines(jobs, terminal) as machines, terminal.progress(f"suite {self.suite}") as progress:
            course = _Course(jobs, progress, machines, terminal)
            if self.only is not None:
                return self._part(course, salt)
            run, record = self._pursue(course) if self.until_decided else self._bench(course, salt)
        with terminal.progress(f"drawing the report of {run}"):
            report = write_report(run)
        for first, *more in run_lines(record):
            terminal.say(f"warning: {first}", *more)
        if noisy := noisy_scenes(suite, record, run):
            terminal.say("warning: scenes are noisier than their suite allows", *noisy)
        failures = failed_lines(record.results)
        for line in failures:
            terminal.err.print(f"failed: {line}")
        told = {"run": run, "report": report, "jobs": len(record.results), "failed": failures}
        write_optional_json(self.json, told | {"wall_s": record.wall_s})
        lost = show_looks(record.looks, len(record.scenes), terminal) if record.looks else False
        show_standings(run, record, terminal)
        terminal.out.print(
            f"bench: {len(record.results)} jobs, {len(failures)} failures, {record.wall_s:.1f} s; "
            f"report: {report.resolve()}"
        )
        terminal.advise(left_out(self.suite, record))
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
            "--tracks": self.tracks, "--scenes": self.scenes, "--methods": self.methods,
            "--predictions": self.predictions,
            "--sealed": self.sealed, "--budget": self.budget != 1, "--pixels": self.pixels is not None,
            "--views": self.views is not None, "--surfels": self.surfels != 1,
            "--no-compositions": not self.compositions,
            "--salt": self.salt is not None, "--only": self.only is not None,
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

    @contextmanager
    def _machines(self, jobs: int, terminal: Terminal) -> Iterator[Machines | None]:
        """Connect to other machines, if any are asked for, for the length of a block."""
        if self.scheduler is None:
            yield None
            return
        from graycard.machines import connected, read_scheduler
        from graycard.resources import usable_cores

        spec = read_scheduler(self.scheduler, max(1, jobs), usable_cores())
        if self.memory is not None and spec.memory_gib is not None and self.memory > spec.memory_gib:
            raise GraycardError(
                f"expected --memory of at most {spec.memory_gib:g} GiB, which memory_gib asks for, got "
                f"{self.memory:g}. Mend one of them"
            )
        with connected(spec, terminal.err.print) as machines:
            yield machines

    def _chosen(self, salt: Salt | None) -> _Chosen:
        """Return the suite or a part of it, on its own, its secret or its sealed scenes, and its folder."""
        from graycard.benchmarks import load_suite, narrow, opened, with_secret, without_compositions
        from graycard.benchmarks import with_predictions as with_rows

        whole = load_suite(self.suite)
        scenes = opened(whole) if self.sealed else whole if salt is None else with_secret(whole, salt)
        rows = with_rows(scenes, self.predictions)
        given = [method.row for method in rows.methods[len(whole.methods) :]]
        chosen = [*self.methods, *given] if self.methods else ()
        suite = narrow(rows, self.tracks, chosen, self.scenes)
        suite = suite if self.compositions else without_compositions(suite)
        run = self.out or Path("runs") / f"{suite.name}{self._kind()}"
        is_part = self.sealed or suite != scenes
        return _Chosen(suite, run, (whole if self.sealed else scenes) if is_part else None)

    def _kind(self) -> str:
        """Return the end of the run folder's name: what is other than in the suite."""
        told = (
            "-sealed" if self.sealed else "",
            "-no-compositions" if not self.compositions else "",
            f"-budget-{self.budget:g}" if self.budget != 1 else "",
            f"-{self.pixels}-pixels" if self.pixels is not None else "",
            f"-{self.views}-views" if self.views is not None else "",
            f"-surfels-{self.surfels:g}" if self.surfels != 1 else "",
        )
        return "".join(told)

    def _terms(self, machines: Machines | None) -> Terms:
        from graycard.benchmarks import Terms, find_edition

        edition = find_edition(self.suite) if self.sealed else None
        return Terms(self.budget, self._size(), edition, self.allow, machines)

    def _size(self) -> Size:
        """Return the size that is asked for.

        Raises:
            GraycardError: An option is none.
        """
        for option, size in (
            ("--pixels", partial(Size, width=self.pixels)),
            ("--views", partial(Size, train_views=self.views)),
            ("--surfels", partial(Size, surfels=self.surfels)),
        ):
            try:
                size()
            except ValueError as cause:
                raise GraycardError(f"{cause}. Mend {option}") from None
        return Size(self.pixels, self.views, self.surfels)

    def _bench(self, course: _Course, salt: Salt | None) -> tuple[Path, RunRecord]:
        """Run the suite, or a part of it."""
        from graycard.benchmarks import run_bench

        chosen = self._chosen(salt)
        course.terminal.advise(lock_words(chosen.run))
        return chosen.run, run_bench(
            chosen.suite,
            chosen.run,
            course.jobs,
            course.progress,
            self.dataset,
            limits=limits_of(self.timeout, self.memory),
            whole=chosen.whole,
            terms=self._terms(course.machines),
        )

    def _part(self, course: _Course, salt: Salt | None) -> int:
        """Do one of several parts; no record and no report are written."""
        from graycard.benchmarks import parse_part, run_part

        chosen, part = self._chosen(salt), parse_part(self.only or "")
        course.terminal.advise(lock_words(chosen.run))
        limits, terms = limits_of(self.timeout, self.memory), self._terms(course.machines)
        told = chosen.suite, chosen.run, course.jobs, course.progress, part, self.dataset
        results = run_part(*told, limits=limits, terms=terms)
        if not results:
            course.terminal.advise(f"part {part} is empty: the run has fewer jobs than parts")
        lines = failed_lines(results)
        for line in lines:
            course.terminal.err.print(f"failed: {line}")
        write_optional_json(self.json, {"run": chosen.run, "jobs": len(results), "failed": lines})
        course.terminal.out.print(
            f"bench: part {part}, {len(results)} jobs, {len(lines)} failures; the same command without "
            f"--only gathers {chosen.run.resolve()}"
        )
        return FAILED if lines else OK

    def _pursue(self, course: _Course) -> tuple[Path, RunRecord]:
        """Run the suite, and add scenes until its claims are decided."""
        from graycard.benchmarks import Plan, load_suite, run_until_decided

        suite, plan = load_suite(self.suite), Plan(self.max_scenes or 0, self.claims)
        run = self.out or Path("runs") / f"{suite.name}-until-decided"
        course.terminal.advise(lock_words(run))
        told = suite, run, course.jobs, course.progress, plan, self.dataset
        limits, terms = limits_of(self.timeout, self.memory), self._terms(course.machines)
        return run, run_until_decided(*told, limits=limits, terms=terms)
