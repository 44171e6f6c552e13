# SPDX-License-Identifier: Apache-2.0
"""Run a suite: render the scenes, fit every method on each, score, compare, and write what was found.

    RUN/dataset/<track>/<scene>/{capture,truth}
    RUN/jobs/<track>/<scene>/<method>-<seed>-<hash>/   job.json predictions/ scores.json
    RUN/run.json comparison.json suite.json
    RUN/stages/<code>/<capture>/   what fits leave for each other until all are done

What is there and whole is reused, so a run that was cut off goes on where it stopped, and ends with the
same scores as one that was not.
"""

import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from graycard import Progress, open_truth
from graycard.benchmarks._edition import refuse_sealed
from graycard.benchmarks._introduction import introduce
from graycard.benchmarks._jobs import (
    DONE,
    JOBS_EACH,
    FitJob,
    RenderJob,
    find_fit,
    find_scores,
    run_fit,
    run_score,
)
from graycard.benchmarks._run_record import (
    RunError,
    check_seen,
    commitment_of,
    joined,
    keep_suite,
    measures_nothing_new,
    method_record,
    of_machines,
    plain_record_before,
    record_before,
    renderers,
    results_of,
    scene_record,
    tidied,
    with_places_before,
    with_places_of_fits,
)
from graycard.benchmarks._sizes import at_size, scaled
from graycard.benchmarks._sources import environment
from graycard.benchmarks._submitted import check_folder
from graycard.benchmarks._suites import Suite
from graycard.benchmarks.claims import claims_of_suite, judge_run
from graycard.benchmarks.planning import (
    Part,
    clear_stages,
    part_of_plan,
    plan_fits,
    render_scenes,
    staging,
)
from graycard.eval import all_metrics
from graycard.eval.statistics import compare_first_look
from graycard.io import file_lock, write_json
from graycard.machines import Machines
from graycard.methods.confined import SERVE, Introduction
from graycard.processes import USUAL, Limits, Outcome, part_of, run_all
from graycard.records import CLAIMS, COMPARISON, RUN_FILE, Edition, JobResult, RunRecord, Size
from graycard.resources import usable_cores
from graycard.synth import SceneSpec, donor_scene, scene_name


@dataclass(frozen=True, slots=True)
class Terms:
    """Differences of a run from its suite, and where its jobs are done."""

    budget: float = 1.0
    """Factor on the iterations of all fits."""
    size: Size = field(default_factory=Size)
    """Pictures, views and surfels, where they are not those of the suite."""
    edition: Edition | None = None
    """The tag that vouches for code and claims where scenes are sealed; None: those are refused."""
    allowed: tuple[Path, ...] = ()
    """Files and folders that methods may read and change besides their code and the capture."""
    machines: Machines | None = None
    """Other machines that do the jobs; None: worker processes of this one do."""

    def __post_init__(self) -> None:
        if not 0 < self.budget < math.inf:
            raise RunError(f"expected a budget above 0, as 0.5 or 2, got {self.budget}. Mend --budget")
        if self.edition is not None and self.size.words:
            raise RunError(
                f"expected sealed scenes at the size of their suite, got {self.size.words}. Leave out "
                "--pixels, --views and --surfels"
            )


@dataclass(frozen=True, slots=True)
class Measured:
    """The results of a bench."""

    record: RunRecord
    all_reused: bool
    """True where every fit and every score was there already."""


Fits = Sequence[tuple[FitJob, Outcome]]
"""Jobs with how they ended, in the order of the plan."""


@dataclass(frozen=True)
class Bench:
    """A run under way: suite, folder and start."""

    suite: Suite
    run: Path
    dataset: Path
    jobs: int
    """At a time."""
    progress: Progress
    limits: Limits
    whole: Suite | None
    """The suite that this one was narrowed from; None for a whole one."""
    terms: Terms
    started: str = field(default_factory=lambda: datetime.now(UTC).isoformat(timespec="milliseconds"))
    clock: float = field(default_factory=time.perf_counter)

    @property
    def threads(self) -> int:
        """Threads of each fit."""
        machines = self.terms.machines
        return machines.threads if machines else max(1, usable_cores() // self.jobs)

    @property
    def run_all(self) -> Callable[..., list[Outcome]]:
        """Function that does jobs: :func:`graycard.processes.run_all`, or that of the machines."""
        return self.terms.machines.run_all if self.terms.machines else run_all

    def elapsed_s(self) -> float:
        """Return the seconds since the start, to 0.01 s."""
        return round(time.perf_counter() - self.clock, 2)

    def part(self, stage: int, doing: str) -> Progress:
        """Return the progress of one of the three stages in that of the run."""
        return part_of(self.progress, stage, 3, doing)


def run_bench(
    suite: Suite,
    run: Path,
    jobs: int,
    progress: Progress,
    dataset: Path | None = None,
    *,
    limits: Limits = USUAL,
    whole: Suite | None = None,
    terms: Terms = Terms(),
) -> RunRecord:
    """Run a suite and write ``RUN/run.json``.

    Args:
        suite: What to run.
        run: The run folder; what is there and whole is reused.
        jobs: Number of fits at a time, and of scenes where memory allows.
        progress: Called after each job.
        dataset: Where the scenes are or go; ``RUN/dataset`` by default.
        limits: Of each fit and each scoring; time of stages that a fit found done is left out.
        whole: What the suite was narrowed from: what ``run.json`` has of its other parts stays in it.
        terms: The budget of fits, and what vouches for sealed scenes.

    Raises:
        UnknownNameError: A method does not exist.
        MethodError: A method does not load, or does not take its settings.
        PredictionError: Submitted predictions are of no scene of the suite.
        RunError: A scene could not be rendered or is sealed, the folder holds another run, or ``jobs`` < 1.
        OutputError: The folder cannot be written to, or the disk is full.
    """
    bench = Bench(suite, run, dataset or run / "dataset", jobs, progress, limits, whole, terms)
    kind = run, suite, terms.budget, terms.size, terms.edition
    plain_record_before(*kind)  # refuses the folder of another run
    part = measure(bench)
    with file_lock(run / ".lock", lambda who: progress(1.0, f"waiting for {who}")):
        # Another bench may have written its part of the suite meanwhile.
        before = plain_record_before(*kind)
        record = _with_earlier(part, before, whole) if before else part.record
        write_run(record, run)
    return record


def measure(bench: Bench) -> Measured:
    """Render, fit and score all that a bench asks for and that is not there yet; ``run.json`` stays as it is.

    Raises:
        GraycardError: As of :func:`run_bench`.
    """
    bench, known = _begun(bench)  # fails before any work
    with tidied(bench.run, bench.dataset):
        return _measured(bench, known)


def run_part(
    suite: Suite,
    run: Path,
    jobs: int,
    progress: Progress,
    part: Part,
    dataset: Path | None = None,
    *,
    limits: Limits = USUAL,
    terms: Terms = Terms(),
) -> tuple[JobResult, ...]:
    """Do one part of a bench, as a task of a job array does; a bench of the whole then finds it done.

    Args:
        suite: What all parts together run.
        run: The run folder, the same for all parts; no ``run.json`` is written there.
        jobs: As of :func:`run_bench`.
        progress: As of :func:`run_bench`.
        part: Which; scenes that several need are rendered once.
        dataset: As of :func:`run_bench`.
        limits: As of :func:`run_bench`.
        terms: As of :func:`run_bench`.

    Raises:
        GraycardError: As of :func:`run_bench`.
    """
    record_before(run, suite, terms.budget, terms.size, terms.edition)  # refuses that of another run
    bench, known = _begun(Bench(suite, run, dataset or run / "dataset", jobs, progress, limits, None, terms))
    scenes, own = part_of_plan(bench.suite, part)
    if scenes.start == scenes.stop:
        return ()
    with tidied(bench.run, bench.dataset):
        plan = _planned(bench, known, _render(bench, bench.suite.scenes[scenes]))[own]
        fitted = _fit(bench, plan)
        return results_of(fitted, _score(bench, fitted), run)


def _begun(bench: Bench) -> tuple[Bench, list[Introduction]]:
    """Refuse what cannot be run, and return what each method says of itself."""
    if bench.jobs < 1:
        raise RunError(f"expected 1 or more jobs at a time, got {bench.jobs}. Mend --jobs")
    if bench.terms.edition is None:
        refuse_sealed(bench.suite.scenes, bench.whole or bench.suite)
    sized = at_size(bench.suite, bench.terms.size)
    return _introduced(replace(bench, suite=sized, whole=bench.whole or bench.suite))


def _planned(
    bench: Bench, known: Sequence[Introduction], scenes: list[tuple[SceneSpec, Path]]
) -> list[FitJob]:
    """Return the fits on some scenes."""
    plan = plan_fits(bench.suite, known, scenes, _donors(bench, scenes), bench.run, bench.threads)
    return [replace(job, allowed=bench.terms.allowed) for job in plan]


def _measured(bench: Bench, known: Sequence[Introduction]) -> Measured:
    origins = environment()
    scenes = _render(bench, bench.suite.scenes)
    plan = _planned(bench, known, scenes)
    fitted = _fit(bench, plan)
    if not any(outcome.reason for outcome in _of_fits(fitted)):
        clear_stages(bench.run, plan)  # nothing can go on from them any more
    scored = _score(bench, fitted)
    record = _record(bench, known, scenes, fitted, scored, origins)
    reused = all(outcome.reused for outcome in (*_of_fits(fitted), *_of_fits(scored)))
    return Measured(with_places_of_fits(record, fitted), reused)


def _introduced(bench: Bench) -> tuple[Bench, list[Introduction]]:
    """Return what each method says of itself, its steps and surfels as asked for, in the suite as well.

    Submitted predictions have to be of a scene of the suite.
    """
    scenes = (*bench.suite.scenes, *(bench.whole.scenes if bench.whole else ()))
    for method in bench.suite.methods:
        if method.predictions:
            check_folder(method.predictions, [(s.track, scene_name(s)) for s in scenes])
    count = len(bench.suite.methods)
    bench.progress(0.0, f"{bench.suite.name}: asking {count} row{'s' * (count != 1)} for their settings")
    told = bench.dataset, bench.run / "jobs", bench.jobs, bench.limits, bench.terms.allowed
    known = introduce(bench.suite.methods, *told)
    own = [scaled(row.settings, bench.terms.budget, bench.terms.size.surfels) for row in known]
    if bench.terms.size.surfels != 1 and not any("surfels" in new for new in own):
        raise RunError("expected a row with surfels for --surfels, got none. Leave it out")
    methods = [
        replace(m, settings={**m.settings, **new}) for m, new in zip(bench.suite.methods, own, strict=True)
    ]
    rows = [replace(k, settings={**k.settings, **new}) for k, new in zip(known, own, strict=True)]
    return replace(bench, suite=replace(bench.suite, methods=tuple(methods))), rows


def _fit(bench: Bench, plan: Sequence[FitJob]) -> Fits:
    """Make all predictions."""
    given = run_fit, plan, bench.jobs, bench.part(1, "fitting"), find_fit, bench.limits
    with staging(bench.run):
        outcomes = bench.run_all(*given, tasks_each=JOBS_EACH, confines=SERVE)
    fitted = list(zip(plan, outcomes, strict=True))
    check_seen(job.folder / DONE for job, outcome in fitted if not outcome.reason)
    return fitted


def _score(bench: Bench, fitted: Fits) -> Fits:
    """Score all predictions that were made."""
    made = [job for job, outcome in fitted if not outcome.reason]
    given = run_score, made, bench.jobs, bench.part(2, "scoring"), find_scores, bench.limits
    outcomes = bench.run_all(*given, tasks_each=JOBS_EACH)
    return list(zip(made, outcomes, strict=True))


def _record(
    bench: Bench,
    known: Sequence[Introduction],
    scenes: list[tuple[SceneSpec, Path]],
    fitted: Fits,
    scored: Fits,
    origins: Mapping[str, Any],
) -> RunRecord:
    """Return what is said of this run alone, and write the suite that it is of beside it."""
    suite, run = bench.suite, bench.run
    return RunRecord(
        suite=suite.name,
        suite_version=suite.version,
        scenes=tuple(scene_record(spec, folder, run) for spec, folder in scenes),
        methods=tuple(map(method_record, suite.methods, known)),
        metrics=all_metrics(),
        results=results_of(fitted, scored, run),
        environment={**origins, **of_machines(bench.terms.machines), "renderer": renderers(scenes)},
        started=bench.started,
        wall_s=bench.elapsed_s(),
        suite_sha256=keep_suite(bench.whole or suite, run),
        budget=bench.terms.budget,
        size=bench.terms.size,
        edition=bench.terms.edition,
        commitment=commitment_of(suite),
    )


def _of_fits(done: Fits) -> list[Outcome]:
    """Return outcomes of what was fitted here: submitted predictions measure nothing and leave no stages."""
    return [outcome for job, outcome in done if job.given is None]


def _with_earlier(part: Measured, before: RunRecord, whole: Suite | None) -> RunRecord:
    """Return a record with what an earlier one of the folder has to say.

    Nothing measured anew keeps what was true of the measurement; of a part of a suite the rest is added.
    """
    record = part.record
    if part.all_reused and measures_nothing_new(record, before):
        same = {"started": before.started, "wall_s": before.wall_s, "environment": before.environment}
        record = replace(record, **same)
    whole_record = record if whole is None else joined(record, before, whole)
    return with_places_before(whole_record, before)


def write_run(record: RunRecord, run: Path, claims: Sequence[str] = ()) -> None:
    """Write a record, and what follows from it: comparison and claims.

    Args:
        record: Of the run.
        run: The run folder.
        claims: Names of files of claims; those that are made for the suite if empty.
    """
    write_json(run / RUN_FILE, record)
    write_json(run / COMPARISON, compare_first_look(record))
    if names := claims or claims_of_suite(record.suite):
        write_json(run / CLAIMS, judge_run(record, run, names))


def _render(bench: Bench, specs: Sequence[SceneSpec]) -> list[tuple[SceneSpec, Path]]:
    """Render scenes; on this machine no more at a time than ``--jobs`` says."""
    machines = bench.terms.machines
    threads = machines.threads if machines else usable_cores()
    given = bench.dataset, threads, bench.run
    jobs = [RenderJob(spec, bench.suite.render_of(spec), *given) for spec in specs]
    folders = render_scenes(jobs, bench.run_all, machines, bench.part(0, "rendering"), bench.jobs)
    check_seen(folder / "truth" / "manifest.json" for folder in folders)
    return list(zip(specs, folders, strict=True))


def _donors(bench: Bench, scenes: list[tuple[SceneSpec, Path]]) -> dict[Path, Path]:
    """Folders of the scenes that objects come from, rendered, by those of the scenes that they are put in."""
    if not any(method.composes for method in bench.suite.methods):
        return {}
    truths = {folder: open_truth(folder / "truth", check=False).composition() for _, folder in scenes}
    specs = {folder: donor_scene(known.donor) for folder, known in truths.items() if known is not None}
    once = {scene_name(spec): spec for spec in specs.values()}  # a donor may give to several scenes
    rendered = dict(zip(once, _render(bench, list(once.values())), strict=True))
    return {folder: rendered[scene_name(spec)][1] for folder, spec in specs.items()}
