# SPDX-License-Identifier: Apache-2.0
"""Run a suite: render the scenes, fit every method on each, score, compare, and write what was found.

    RUN/dataset/<track>/<scene>/{capture,truth}
    RUN/jobs/<track>/<scene>/<method>-<seed>-<hash>/   job.json predictions/ scores.json
    RUN/run.json comparison.json suite.json
    RUN/stages/<code>/<capture>/   what fits leave for each other until all are done

What is there and whole is reused, so a run that was cut off goes on where it stopped, and ends with the
same scores as one that was not.
"""

import hashlib
import re
import shutil
import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

from graycard import Progress, open_truth
from graycard.benchmarks._introduction import Introduction, introduce
from graycard.benchmarks._jobs import (
    FitJob,
    Outcome,
    RenderJob,
    fit_at_hand,
    run_fit,
    run_render,
    run_score,
    scene_at_hand,
    score_at_hand,
)
from graycard.benchmarks._run_record import (
    RunError,
    joined,
    measures_nothing_new,
    method_record,
    record_before,
    renderers,
    result_of,
    scene_record,
)
from graycard.benchmarks._sources import environment, usable_cores
from graycard.benchmarks._submitted import check_folder, given_for
from graycard.benchmarks._suites import KEPT, Suite, SuiteMethod
from graycard.benchmarks._workers import run_all
from graycard.benchmarks.claims import claims_of_suite, judge_claims
from graycard.eval import all_metrics
from graycard.eval.statistics import compare_run
from graycard.io import dumps, sha256, to_builtins, writable_folder, write_json
from graycard.methods.priors import truth_of, weights_of
from graycard.records import CLAIMS, COMPARISON, Job, RunRecord
from graycard.synth import SceneSpec, donor_scene, scene_name

STAGES = "stages"


def run_bench(
    suite: Suite,
    run: Path,
    jobs: int,
    progress: Progress,
    dataset: Path | None = None,
    *,
    timeout_s: float | None = None,
    whole: Suite | None = None,
) -> RunRecord:
    """Run a suite and write ``RUN/run.json``.

    Args:
        suite: What to run.
        run: The run folder; what is there and whole is reused.
        jobs: Number of fits at a time.
        progress: Called after each job.
        dataset: Where the scenes are or go; ``RUN/dataset`` by default.
        timeout_s: A fit or scoring that takes longer has failed, stages that a fit found done left out; None
            for no limit.
        whole: What the suite was narrowed from: what ``run.json`` has of its other parts stays in it.

    Raises:
        UnknownNameError: A method does not exist.
        MethodError: A method does not load, or does not take its settings.
        PredictionError: Submitted predictions are of no scene of the suite.
        RunError: A scene could not be rendered, the folder holds a run of another suite, or ``jobs`` < 1.
        OutputError: The folder cannot be written to, or the disk is full.
    """
    if jobs < 1:
        raise RunError(f"expected 1 or more jobs at a time, got {jobs}. Mend --jobs")
    started, clock = datetime.now(UTC).isoformat(timespec="seconds"), time.perf_counter()
    dataset = dataset or run / "dataset"
    for method in suite.methods:
        if method.predictions:
            check_folder(method.predictions, [(spec.track, scene_name(spec)) for spec in suite.scenes])
    known = introduce(suite.methods, dataset, run / "jobs", jobs, timeout_s)  # fails before any work
    run = writable_folder(run)
    before = record_before(run, suite)
    origins = environment()
    scenes = _render(suite, suite.scenes, dataset, progress)
    donors = _donors(suite, scenes, dataset, progress)
    fits = _plan(suite, known, scenes, donors, run, threads=max(1, usable_cores() // jobs))
    fitted = run_all(run_fit, fits, jobs, _part(progress, 1, "fitting"), fit_at_hand, timeout_s)
    done = [fit for fit, outcome in zip(fits, fitted, strict=True) if not outcome.reason]
    if not any(outcome.reason for outcome in _of_fits(fits, fitted)):
        shutil.rmtree(run / STAGES, ignore_errors=True)  # all that could go on from them is done
    scored = run_all(run_score, done, jobs, _part(progress, 2, "scoring"), score_at_hand, timeout_s)
    outcomes = dict(zip([fit.folder for fit in done], scored, strict=True))
    record = RunRecord(
        suite=suite.name,
        suite_version=suite.version,
        scenes=tuple(scene_record(spec, folder, run) for spec, folder in scenes),
        methods=tuple(map(method_record, suite.methods, known)),
        metrics=all_metrics(),
        results=tuple(
            result_of(f, o, outcomes.get(f.folder), run) for f, o in zip(fits, fitted, strict=True)
        ),
        environment=origins | {"renderer": renderers(scenes)},
        started=started,
        wall_s=round(time.perf_counter() - clock, 2),
        suite_sha256=_keep(whole or suite, run),
    )
    reused = all(outcome.reused for outcome in (*_of_fits(fits, fitted), *_of_fits(done, scored)))
    if before is not None and reused and measures_nothing_new(record, before):
        same = {"started": before.started, "wall_s": before.wall_s, "environment": before.environment}
        record = replace(record, **same)  # nothing was measured anew: keep what was true of the measurement
    if whole is not None and before is not None:
        record = joined(record, before, whole)
    write_json(run / "run.json", record)
    write_json(run / COMPARISON, compare_run(record))
    if claims := claims_of_suite(record.suite):
        write_json(run / CLAIMS, judge_claims(record, run, claims))
    return record


def _of_fits(jobs: Sequence[FitJob], outcomes: Sequence[Outcome]) -> list[Outcome]:
    """Outcomes of what was fitted here: submitted predictions measure nothing and leave no stages."""
    return [outcome for job, outcome in zip(jobs, outcomes, strict=True) if job.given is None]


def job_hash(job: Job, sees: Sequence[str], origin: str) -> str:
    """What addresses a job: its spec, the hashes of what the method is handed, and its code."""
    text = dumps({"job": job, "sees": list(sees), "origin": origin})
    return hashlib.sha256(text.encode()).hexdigest()[:12]


def _keep(suite: Suite, run: Path) -> str:
    """Write the suite beside its run, by which one sees what is missing there, and give its hash."""
    write_json(run / KEPT, suite)
    return sha256(run / KEPT)


def _render(
    suite: Suite, specs: Sequence[SceneSpec], dataset: Path, progress: Progress
) -> list[tuple[SceneSpec, Path]]:
    """Render scenes one after the other: Mitsuba itself takes all cores."""
    jobs = [RenderJob(spec, suite.render_of(spec), dataset, usable_cores()) for spec in specs]
    outcomes = run_all(run_render, jobs, 1, _part(progress, 0, "rendering"), scene_at_hand)
    for job, outcome in zip(jobs, outcomes, strict=True):
        if outcome.reason:
            raise RunError(f"scene {job.spec.track}/{scene_name(job.spec)}: {outcome.reason}")
    return [(job.spec, outcome.value) for job, outcome in zip(jobs, outcomes, strict=True)]


def _donors(
    suite: Suite, scenes: list[tuple[SceneSpec, Path]], dataset: Path, progress: Progress
) -> dict[Path, Path]:
    """Folders of the scenes that objects come from, rendered, by those of the scenes that they are put in."""
    if not any(method.composes for method in suite.methods):
        return {}
    truths = {folder: open_truth(folder / "truth", check=False).composition() for _, folder in scenes}
    specs = {folder: donor_scene(known.donor) for folder, known in truths.items() if known is not None}
    once = {scene_name(spec): spec for spec in specs.values()}  # a donor may give to several scenes
    rendered = dict(zip(once, _render(suite, list(once.values()), dataset, progress), strict=True))
    return {folder: rendered[scene_name(spec)][1] for folder, spec in specs.items()}


def _plan(
    suite: Suite,
    introductions: Sequence[Introduction],
    scenes: list[tuple[SceneSpec, Path]],
    donors: Mapping[Path, Path],
    run: Path,
    threads: int,
) -> list[FitJob]:
    plan = []
    for spec, folder in scenes:
        for method, known in zip(suite.methods, introductions, strict=True):
            donor = donors.get(folder) if method.composes else None
            given = given_for(method.predictions, spec.track, folder.name) if method.predictions else None
            sees = [
                *_seen(method, known, folder),
                *_of_guest(folder, donor),
                *([given.sha256] if given else []),
            ]
            priors = to_builtins(method.priors) if known.asks else {}
            for seed in suite.seeds:
                job = Job(spec.track, folder.name, method.row, seed, known.settings, method.entry, priors)
                name = job_hash(job, sees, known.fingerprint)
                where = run / "jobs" / spec.track / folder.name / f"{_slug(method.row)}-{seed}-{name}"
                stages = _stages(run, known, folder, threads)
                plan.append(FitJob(job, name, folder, where, threads, run / "jobs", donor, stages, given))
    return plan


def _stages(run: Path, known: Introduction, scene: Path, threads: int) -> Path:
    """Where fits leave stages for others: of the same code on the same capture, with as many threads."""
    code = hashlib.sha256(known.fingerprint.encode()).hexdigest()[:12]
    capture = sha256(scene / "capture" / "manifest.json")[:12]
    return run / STAGES / code / f"{capture}-{threads}"


def _seen(method: SuiteMethod, known: Introduction, scene: Path) -> list[str]:
    """Hashes of all that a method is handed: the capture, the truth if it is handed any, weights."""
    asks = known.asks
    told = bool(known.needs) or bool(truth_of(method.priors, asks))
    parts = ("capture", "truth")[: 1 + told]
    return [*(sha256(scene / part / "manifest.json") for part in parts), *weights_of(method.priors, asks)]


def _of_guest(scene: Path, donor: Path | None) -> list[str]:
    """Hashes of where an object comes from, which it is, and where it is put; none without a donor."""
    if donor is None:
        return []
    of_donor = [sha256(donor / part / "manifest.json") for part in ("capture", "truth")]
    return [*of_donor, sha256(scene / "truth" / "composition" / "composition.json")]


def _part(progress: Progress, stage: int, doing: str) -> Progress:
    """The progress of one of the three stages in that of the run."""
    return lambda done, what: progress((stage + done) / 3, f"{doing} {what}")


def _slug(name: str) -> str:
    return re.sub(r"[^A-Za-z0-9_.-]+", "_", name)
