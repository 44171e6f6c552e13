# SPDX-License-Identifier: Apache-2.0
"""The verbs of the command line: each is a dataclass of its options, and says its result in one line.

Stages are imported inside the verbs: ``graycard methods`` must not wait for a renderer.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import tyro
from rich.console import Console
from rich.progress import BarColumn, TextColumn, TimeElapsedColumn
from rich.progress import Progress as ProgressBar
from rich.table import Table

from graycard._dataset import TRACKS
from graycard._errors import GraycardError, UnknownNameError
from graycard._json import write_json
from graycard._progress import Progress
from graycard._records import RunRecord, ScoreSheet, read_run
from graycard._transfer import ExchangeFormat

if TYPE_CHECKING:
    from graycard.synth.verify import Verdict

Json = Annotated[Path | None, tyro.conf.arg(metavar="FILE")]

OK, FAILED = 0, 1
WIDE = 1000
"""Columns of what is no terminal."""


def _console(stderr: bool) -> Console:
    """A console that cuts nothing off: in a file or a pipe its lines are as long as they need to be."""
    console = Console(stderr=stderr, soft_wrap=True, highlight=False, markup=False, emoji=False)
    if not console.is_terminal:
        console.width = WIDE
    return console


@dataclass(frozen=True)
class Screen:
    """Where a verb writes: results on stdout, progress and advice on stderr."""

    out: Console = field(default_factory=lambda: _console(stderr=False))
    err: Console = field(default_factory=lambda: _console(stderr=True))

    def advise(self, advice: str) -> None:
        """Say how to get more out of this machine; an empty advice says nothing."""
        if advice:
            self.err.print(f"advice: {advice}")

    @contextmanager
    def progress(self) -> Iterator[Progress]:
        """A progress bar for the length of a block."""
        columns = TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn()
        with ProgressBar(*columns, console=self.err, transient=True, disable=not self.err.is_terminal) as bar:
            task = bar.add_task("", total=1.0)

            def report(done: float, doing: str, /) -> None:
                bar.update(task, completed=done, description=doing)

            yield report


@dataclass(frozen=True)
class Doctor:
    """Say what is here (renderer, GPU, weights, disk) and what to do for the rest."""

    json: Json = None
    """Also write the findings to this file."""

    def run(self, screen: Screen, rest: list[str]) -> int:
        """Look around."""
        from graycard.benchmarks import findings

        found = findings(Path.cwd())
        table = _table("", "found", "what to do")
        for item in found:
            table.add_row(item.name, item.found, item.advice)
        screen.out.print(table)
        _write_json(self.json, found)
        advised = sum(bool(item.advice) for item in found)
        screen.out.print(f"doctor: {len(found)} things looked at, {advised} could be better")
        return OK


@dataclass(frozen=True)
class Scenes:
    """List the scene families and the scenes of each suite, or the knobs of one family."""

    family: Annotated[str | None, tyro.conf.Positional] = None
    """Show the knobs of this family."""
    json: Json = None
    """Also write the list to this file."""

    def run(self, screen: Screen, rest: list[str]) -> int:
        """List them."""
        if self.family is not None:
            return self._show(screen, self.family)
        from graycard.benchmarks import load_suite, suite_names
        from graycard.synth import describe, families, scene_name

        suites = [load_suite(name) for name in suite_names()]
        table = _table("suite", "track", "scene", "what is to be seen")
        for suite in suites:
            for spec in suite.scenes:
                table.add_row(suite.name, spec.track, scene_name(spec), describe(spec))
        screen.out.print(table)
        known = {track: [n for n, f in families().items() if f.track == track] for track in TRACKS}
        _write_json(self.json, {"families": known, "suites": suites})
        names = ", ".join(f"{track}: {'/'.join(found)}" for track, found in known.items())
        screen.out.print(f"scenes: {sum(len(s.scenes) for s in suites)} in {len(suites)} suites ({names})")
        return OK

    def _show(self, screen: Screen, name: str) -> int:
        from graycard.synth import families, knobs

        if name not in families():
            raise UnknownNameError("scene family", name, families())
        family = families()[name]
        found = knobs(family)
        table = _table("knob", "default", "allowed", "what it does")
        for item in found:
            table.add_row(item.name, str(item.default), item.allowed, item.meaning)
        screen.out.print(table)
        _write_json(self.json, {"family": name, "track": family.track, "title": family.title, "knobs": found})
        screen.out.print(f"scenes: {name} ({family.track}), {family.title}; {len(found)} knobs")
        return OK


@dataclass(frozen=True)
class Methods:
    """List the methods, or show one with its settings."""

    name: Annotated[str | None, tyro.conf.Positional] = None
    """Show this one: a name or module:attribute."""
    json: Json = None
    """Also write the list to this file."""

    def run(self, screen: Screen, rest: list[str]) -> int:
        """List them; one that fails to load says why and hurts no other."""
        if self.name is not None:
            return self._show(screen, self.name)
        from graycard.methods import listings

        found = listings()
        table = _table("method", "from", "what it does")
        for row in found:
            table.add_row(row.name, row.origin, row.summary or f"cannot be loaded: {row.reason}")
        screen.out.print(table)
        _write_json(self.json, found)
        broken = sum(row.summary is None for row in found)
        screen.out.print(f"methods: {len(found) - broken} work, {broken} cannot be loaded")
        return OK

    def _show(self, screen: Screen, name: str) -> int:
        from graycard.methods import load_method

        method = load_method(name)
        screen.out.print(f"{name}: {method.summary}")
        screen.out.print(f"is handed beyond the capture: {', '.join(method.needs) or 'nothing'}\n")
        with suppress(SystemExit):
            tyro.cli(
                method.settings_type, args=["--help"], prog=f"graycard fit {name} SCENE --out PREDICTIONS"
            )
        settings = method.settings_type()
        _write_json(
            self.json, {"name": name, "summary": method.summary, "needs": method.needs, "settings": settings}
        )
        screen.out.print(f"methods: {name} with {settings}")
        return OK


@dataclass(frozen=True)
class Render:
    """Render the scenes of a suite, or one scene of a track with any seed."""

    what: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="SUITE|TRACK")]
    """A suite, or one of the tracks. For a track, size and samples may follow: --width, --height, …"""
    out: Annotated[Path, tyro.conf.arg(metavar="DATASET")]
    """Where to: DATASET/<track>/<scene>/{capture,truth}. What is there and intact is kept."""
    seed: int | None = None
    """Seed of the scene (for a track); 0 by default."""
    family: str | None = None
    """Family of the scene (for a track); `graycard scenes` lists them. The first of the track by default."""
    knob: Annotated[tuple[str, ...], tyro.conf.arg(metavar="NAME=VALUE ...")] = ()
    """Knobs of the family that are to differ from its defaults; `graycard scenes FAMILY` lists them."""

    def run(self, screen: Screen, rest: list[str]) -> int:
        """Render, view by view."""
        from graycard._dataset import open_truth
        from graycard.synth import find_llvm, render_scene

        jobs = self._jobs(rest)
        screen.advise(find_llvm().advice)
        for number, (spec, settings) in enumerate(jobs):
            with screen.progress() as progress:
                folder = render_scene(spec, settings, self.out, _share(progress, number, len(jobs)))
            ceiling = open_truth(folder / "truth", check=False).noise_ceiling
            screen.out.print(f"{folder.as_posix()} (noise ceiling {ceiling:.1f} dB)")
        screen.out.print(f"render: {len(jobs)} scene{'s' * (len(jobs) != 1)} in {self.out}")
        return OK

    def _jobs(self, rest: list[str]) -> list[tuple[Any, Any]]:
        from graycard.benchmarks import load_suite, suite_names
        from graycard.synth import RenderSettings, SceneSpec, families

        if self.what in TRACKS:
            settings = tyro.cli(RenderSettings, args=rest, prog=f"graycard render {self.what}")
            first = next(name for name, f in families().items() if f.track == self.what)
            seed = self.seed or 0
            if seed < 0:
                raise GraycardError(f"expected a seed of 0 or more, got {seed}. Mend --seed")
            return [(SceneSpec(self.what, self.family or first, seed, _knobs(self.knob)), settings)]
        refuse(rest, "render")
        known = [*suite_names(), *TRACKS]
        if self.what not in known and not self.what.endswith(".toml"):
            raise UnknownNameError("suite or track", self.what, known)
        if self.seed is not None or self.family is not None or self.knob:
            raise GraycardError(
                "expected --seed, --family and --knob with a track only: a suite names its own scenes"
            )
        suite = load_suite(self.what)
        return [(spec, suite.render_of(spec)) for spec in suite.scenes]


@dataclass(frozen=True)
class Verify:
    """Check the truth of a dataset by integrity, physics and a second rendering."""

    dataset: Annotated[Path, tyro.conf.Positional]
    """The dataset."""
    views: int = 3
    """Views of each scene that are rendered again."""
    render: bool = True
    """--no-render: look at the files only."""
    json: Json = None
    """Also write every check to this file."""

    def run(self, screen: Screen, rest: list[str]) -> int:
        """Check; a check that failed makes the exit code 1."""
        from graycard.synth.verify import verify_dataset

        if self.views < 1:
            raise GraycardError(
                f"expected 1 or more views, got {self.views}. Mend --views, or use --no-render"
            )
        with screen.progress() as progress:
            verdict = verify_dataset(self.dataset, self.views, self.render, progress)
        screen.out.print(_verdict_table(verdict))
        _write_json(self.json, verdict)
        for check in verdict.checks:
            if check.status == "failed":
                screen.err.print(f"failed: {check.scene} {check.view} {check.name}: {check.reason}")
        passed, failed, skipped = (verdict.count(status) for status in ("passed", "failed", "skipped"))
        screen.out.print(
            f"verify: {verdict.scenes} scene{'s' * (verdict.scenes != 1)}, {passed} checks passed, "
            f"{failed} failed, {skipped} skipped"
        )
        return FAILED if failed else OK


@dataclass(frozen=True)
class Fit:
    """Fit a method on a scene; its own settings may follow as options."""

    method: Annotated[str, tyro.conf.Positional]
    """A name or module:attribute; `graycard methods NAME` shows its settings."""
    scene: Annotated[Path, tyro.conf.Positional]
    """DATASET/<track>/<scene>."""
    out: Annotated[Path, tyro.conf.arg(metavar="PREDICTIONS")]
    """Where to; what is there is replaced."""
    seed: int = 0
    """Equal seeds give equal predictions."""
    save: Annotated[Path | None, tyro.conf.arg(metavar="FOLDER")] = None
    """Also save the decomposition itself here."""

    def run(self, screen: Screen, rest: list[str]) -> int:
        """Fit, then render every view."""
        from graycard._json import encode
        from graycard.benchmarks import FitSpec, fit_scene
        from graycard.methods import load_method

        method = load_method(self.method)
        settings = tyro.cli(method.settings_type, args=rest, prog=f"graycard fit {self.method}")
        spec = FitSpec(self.method, encode(settings), self.seed, self.scene)
        with screen.progress() as progress:
            cost = fit_scene(spec, self.out, progress, self.save)
        screen.out.print(f"fit: {self.out} in {cost.wall_s:.1f} s, {cost.peak_memory_mib:.0f} MiB")
        return OK


@dataclass(frozen=True)
class ScoreCommand:
    """Score a predictions folder, from any code, against the truth of its scene."""

    predictions: Annotated[Path, tyro.conf.Positional]
    """The folder: docs/formats.md says what is in it."""
    scene: Annotated[Path, tyro.conf.Positional]
    """DATASET/<track>/<scene>."""
    json: Json = None
    """Also write the scores to this file."""

    def run(self, screen: Screen, rest: list[str]) -> int:
        """Score; a score that failed makes the exit code 1."""
        from graycard.eval import score_predictions

        sheet = score_predictions(self.predictions, self.scene)
        screen.out.print(_score_table(sheet))
        _write_json(self.json, sheet)
        failed = [score for score in sheet.scores if score.status == "failed"]
        for reason in dict.fromkeys(score.reason for score in failed):
            screen.err.print(f"failed: {reason}")
        scored = sum(score.status == "scored" for score in sheet.scores)
        if not scored:
            screen.err.print("nothing was scored: docs/formats.md lists the layers that are")
        screen.out.print(
            f"score: {sheet.method} on {sheet.track}/{sheet.scene}: {scored} scored, {len(failed)} failed, "
            f"{len(sheet.scores) - scored - len(failed)} not provided"
        )
        return OK if scored and not failed else FAILED


@dataclass(frozen=True)
class Bench:
    """Run a suite from scene to report; what is there already is reused."""

    suite: Annotated[str, tyro.conf.Positional]
    """A suite, or a path to one of your own that ends in .toml."""
    tracks: tuple[str, ...] = ()
    """Only these tracks."""
    methods: tuple[str, ...] = ()
    """Only these methods; names or module:attribute, also such as are not in the suite."""
    jobs: int | None = None
    """Fits at a time; as many as there are cores by default."""
    timeout: float | None = None
    """Seconds after which a fit has failed; no limit by default."""
    out: Annotated[Path | None, tyro.conf.arg(metavar="RUN")] = None
    """The run folder; runs/<suite> by default."""
    dataset: Annotated[Path | None, tyro.conf.arg(metavar="DATASET")] = None
    """Where the scenes are or go; RUN/dataset by default."""

    def run(self, screen: Screen, rest: list[str]) -> int:
        """Run it; a job or a score that failed makes the exit code 1."""
        from graycard.benchmarks import load_suite, narrow, run_bench, usable_cores
        from graycard.reports import write_report
        from graycard.synth import find_llvm

        suite = narrow(load_suite(self.suite), self.tracks, self.methods)
        run = self.out or Path("runs") / suite.name
        screen.advise(find_llvm().advice)
        jobs = usable_cores() if self.jobs is None else self.jobs
        part = bool(self.tracks or self.methods)
        with screen.progress() as progress:
            record = run_bench(suite, run, jobs, progress, self.dataset, timeout_s=self.timeout, part=part)
        report = write_report(run)
        failures = _failures(record)
        for line in failures:
            screen.err.print(f"failed: {line}")
        screen.out.print(
            f"bench: {len(record.results)} jobs, {len(failures)} failures, {record.wall_s:.1f} s; "
            f"report: {report.resolve()}"
        )
        return FAILED if failures else OK


@dataclass(frozen=True)
class Gate:
    """Fail if a run is worse than a baseline (1), or measured less than it expects (2)."""

    run_folder: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="RUN")]
    """The run folder."""
    baseline: Annotated[Path, tyro.conf.arg(metavar="FILE")]
    """The expected scores with their tolerances."""
    write: bool = False
    """Write the baseline from the run instead of comparing."""
    json: Json = None
    """Also write the verdict to this file."""

    def run(self, screen: Screen, rest: list[str]) -> int:
        """Compare."""
        from graycard.benchmarks import judge, make_baseline, read_baseline, write_baseline

        if self.write:
            made = make_baseline(read_run(self.run_folder))
            write_baseline(self.baseline, made)
            screen.out.print(f"gate: wrote {len(made.scores)} expected scores to {self.baseline}")
            return OK
        verdict = judge(read_run(self.run_folder), read_baseline(self.baseline))
        for label in ("worse", "missing", "better"):
            for change in getattr(verdict, label):
                screen.out.print(f"{label}: {change}")
        _write_json(self.json, verdict)
        says = {0: "passed", 1: "failed: accuracy dropped", 2: "failed: scores are missing"}
        screen.out.print(
            f"gate: {says[verdict.exit_code]} ({verdict.compared} compared, {len(verdict.worse)} worse, "
            f"{len(verdict.missing)} missing, {len(verdict.better)} better)"
        )
        return verdict.exit_code


@dataclass(frozen=True)
class Report:
    """Write the report of a run: one HTML file that opens offline."""

    run_folder: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="RUN")]
    """The run folder."""

    def run(self, screen: Screen, rest: list[str]) -> int:
        """Write it."""
        from graycard.reports import write_report

        screen.out.print(f"report: {write_report(self.run_folder).resolve()}")
        return OK


@dataclass(frozen=True)
class Look:
    """Draw a contact sheet of each scene: photographs, true layers, plan of cameras and lights."""

    dataset: Annotated[Path, tyro.conf.Positional]
    """The dataset; what is half-written in it is left out."""
    out: Annotated[Path | None, tyro.conf.arg(metavar="FOLDER")] = None
    """Where the PNGs go, one a scene; DATASET/look by default."""

    def run(self, screen: Screen, rest: list[str]) -> int:
        """Draw them."""
        from graycard.reports import write_contact_sheets

        out = self.out or self.dataset / "look"
        with screen.progress() as progress:
            sheets = write_contact_sheets(self.dataset, out, progress)
        for sheet in sheets:
            screen.out.print(sheet.as_posix())
        screen.out.print(f"look: {len(sheets)} contact sheet{'s' * (len(sheets) != 1)} in {out}")
        return OK


@dataclass(frozen=True)
class Export:
    """Write a capture for another program; photographs of held-out views are in no capture."""

    scene: Annotated[Path, tyro.conf.Positional]
    """DATASET/<track>/<scene>."""
    format: ExchangeFormat
    """transforms.json of nerfstudio, or the text model of COLMAP."""
    out: Annotated[Path, tyro.conf.arg(metavar="FOLDER")]
    """Where to: a new or an empty folder."""

    def run(self, screen: Screen, rest: list[str]) -> int:
        """Write it."""
        from graycard._transfer import export_capture

        capture = export_capture(self.scene, self.format, self.out)
        screen.out.print(
            f"export: {self.out} as {self.format}, {len(capture.train)} photographs and, without one, "
            f"{len(capture.test)} held-out cameras"
        )
        return OK


@dataclass(frozen=True)
class Import:
    """Make a capture of your own photographs and cameras; it has no truth."""

    folder: Annotated[Path, tyro.conf.Positional]
    """With transforms.json (nerfstudio), or sparse/0/*.txt and images/ (COLMAP)."""
    track: str
    """What kind of scene it is: dark, tabletop or multilight."""
    scene: str
    """A name for it."""
    out: Annotated[Path, tyro.conf.arg(metavar="DATASET")]
    """Where to: DATASET/<track>/<scene>/capture."""
    hold_out_every: int = 8
    """Hold out each how many-th photograph by name, 0 for none; lists in the folder go first."""

    def run(self, screen: Screen, rest: list[str]) -> int:
        """Read, check, then write."""
        from graycard import __version__
        from graycard._dataset import open_capture
        from graycard._transfer import import_capture

        with screen.progress() as progress:
            made = import_capture(
                self.folder,
                self.out,
                self.track,
                self.scene,
                hold_out_every=self.hold_out_every,
                version=__version__,
                progress=progress,
            )
        capture = open_capture(made / "capture", check=False)
        screen.out.print(
            f"import: {made}, {len(capture.train)} photographs, {len(capture.test)} views held out, no truth"
        )
        return OK


@dataclass(frozen=True)
class Speed:
    """Measure what the machinery costs, beside a peer in the same run."""

    what: Annotated[Literal["truth"], tyro.conf.Positional]
    """truth: light split by source and lobe, beside Mitsuba's path tracer."""
    repeats: int = 5
    """How often each is timed; medians count."""
    json: Json = None
    """Also write the figures to this file."""

    def run(self, screen: Screen, rest: list[str]) -> int:
        """Time both, in turns."""
        from graycard.benchmarks.speed import measure_truth

        with screen.progress() as progress:
            costs = measure_truth(repeats=self.repeats, progress=progress)
        table = _table("track", "family", "lights", "path s", "separated s", "ratio", "CPU ratio")
        for c in costs:
            figures = f"{c.path_s:.3f}", f"{c.separated_s:.3f}", f"{c.ratio:.2f}", f"{c.cpu_ratio:.2f}"
            table.add_row(c.track, c.family, str(c.lights), *figures)
        screen.out.print(table)
        _write_json(self.json, costs)
        worst = max(costs, key=lambda cost: cost.ratio)
        screen.out.print(
            f"speed: the separated truth takes at most {worst.ratio:.2f} times as long as a plain picture "
            f"({worst.family}; in processor time {worst.cpu_ratio:.2f})"
        )
        return OK


def refuse(rest: list[str], verb: str) -> None:
    """Say that options were not understood.

    Raises:
        GraycardError: There are some.
    """
    if rest:
        raise GraycardError(
            f"expected options of `graycard {verb}`, got {' '.join(rest)}. See `graycard {verb} --help`"
        )


def _table(*heads: str) -> Table:
    """A table without lines whose cells wrap rather than lose their ends."""
    table = Table(box=None, pad_edge=False)
    for head in heads:
        table.add_column(head, overflow="fold")
    return table


def _score_table(sheet: ScoreSheet) -> Table:
    table = _table("metric", "score", "unit", "optimum", "ceiling", "views", "gauge")
    for score in sheet.scores:
        value = f"{score.value:.4g}" if score.value is not None else score.status
        ceiling = f"{score.noise_ceiling:.1f}" if score.noise_ceiling is not None else ""
        gauge = " ".join(f"{g:.4g}" for g in score.gauge) if score.gauge else ""
        counts = f"{score.scored}/{score.expected}"
        table.add_row(score.metric, value, score.unit, f"{score.optimum:g}", ceiling, counts, gauge)
    return table


def _verdict_table(verdict: Verdict) -> Table:
    """The worst of each check of each scene."""
    from graycard.synth.verify import worst

    table = _table("scene", "check", "figure", "bound", "unit", "worst view", "")
    for check in worst(verdict.checks):
        figure, bound = (f"{v:.3g}" if v is not None else "" for v in (check.figure, check.bound))
        status = f"skipped: {check.reason}" if check.status == "skipped" else check.status
        table.add_row(check.scene, check.name, figure, bound, check.unit, check.view, status)
    return table


def _failures(record: RunRecord) -> list[str]:
    """A line for each job that failed, and for each score that failed."""
    lines = []
    for result in record.results:
        where = f"{result.job.track}/{result.job.scene} {result.job.method}"
        if result.status == "failed":
            lines.append(f"{where}: {result.reason}")
        for score in result.sheet.scores if result.sheet else ():
            if score.status == "failed":
                lines.append(f"{where} {score.metric}: {score.reason}")
    return lines


def _knobs(pairs: tuple[str, ...]) -> dict[str, Any]:
    """Knobs by name from ``name=value``; a value that is no number is a word.

    Raises:
        GraycardError: A pair is none.
    """
    knobs: dict[str, Any] = {}
    for pair in pairs:
        name, sign, value = pair.partition("=")
        if not (name and sign and value):
            raise GraycardError(f"expected a knob as NAME=VALUE, got {pair!r}")
        knobs[name] = _number(value)
    return knobs


def _number(text: str) -> int | float | str:
    for kind in (int, float):
        with suppress(ValueError):
            return kind(text)
    return text


def _share(progress: Progress, number: int, of: int) -> Callable[[float, str], None]:
    """The progress of one part in that of the whole."""
    return lambda done, doing: progress((number + done) / of, doing)


def _write_json(path: Path | None, value: Any) -> None:
    if path is not None:
        write_json(path, value)


COMMANDS: dict[str, type[Any]] = {
    "doctor": Doctor,
    "scenes": Scenes,
    "methods": Methods,
    "render": Render,
    "verify": Verify,
    "fit": Fit,
    "score": ScoreCommand,
    "bench": Bench,
    "gate": Gate,
    "report": Report,
    "look": Look,
    "export": Export,
    "import": Import,
    "speed": Speed,
}
"""Verb by verb, in the order of ``--help``."""
