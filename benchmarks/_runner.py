# SPDX-License-Identifier: Apache-2.0
"""Run a suite: render the scenes, fit every method on each, score, and write ``run.json``.

    RUN/dataset/<track>/<scene>/{capture,truth}
    RUN/jobs/<track>/<scene>/<method>-<seed>-<hash>/   job.json predictions/ scores.json
    RUN/run.json

What is there and whole is reused, so a run that was cut off goes on where it stopped, and ends with the
same scores as one that was not.
"""

import hashlib
import multiprocessing
import re
import time
from collections.abc import Callable, Sequence
from concurrent.futures import Future, as_completed
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, TypeVar

from pebble import ProcessExpired, ProcessPool

from graycard import (
    GraycardError,
    Job,
    JobResult,
    MethodRecord,
    OutputError,
    Progress,
    RunRecord,
    SceneRecord,
    dumps,
    encode,
    manifest_of,
    open_truth,
    sha256,
    writable_folder,
    write_json,
)
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
from graycard.benchmarks._sources import environment, usable_cores
from graycard.benchmarks._suites import Suite, SuiteMethod
from graycard.eval import metrics
from graycard.methods import fingerprint, load_method, settings_of
from graycard.synth import SceneSpec, describe, scene_name

J = TypeVar("J")


class RunError(GraycardError):
    """A bench cannot go on: a scene could not be rendered."""


def run_bench(
    suite: Suite, run: Path, jobs: int, progress: Progress, dataset: Path | None = None
) -> RunRecord:
    """Run a suite and write ``RUN/run.json``.

    Args:
        suite: What to run.
        run: The run folder; what is there and whole is reused.
        jobs: Number of fits at a time.
        progress: Called after each job.
        dataset: Where the scenes are or go; ``RUN/dataset`` by default.

    Raises:
        UnknownNameError: A method does not exist.
        MethodError: A method does not load, or does not take its settings.
        RunError: A scene could not be rendered.
        OutputError: The folder cannot be written to, or the disk is full.
    """
    started, clock = datetime.now(UTC).isoformat(timespec="seconds"), time.perf_counter()
    methods = [_method_record(method) for method in suite.methods]  # a misspelt one fails before any work
    run = writable_folder(run)
    scenes = _render(suite, dataset or run / "dataset", progress)
    fits = _plan(suite, scenes, run, threads=max(1, usable_cores() // jobs))
    fitted = run_all(run_fit, fits, jobs, _part(progress, 1, "fitting"), fit_at_hand)
    done = [fit for fit, outcome in zip(fits, fitted, strict=True) if not outcome.reason]
    scored = run_all(run_score, done, jobs, _part(progress, 2, "scoring"), score_at_hand)
    outcomes = dict(zip([fit.folder for fit in done], scored, strict=True))
    record = RunRecord(
        suite=suite.name,
        suite_version=suite.version,
        scenes=tuple(_scene_record(spec, folder, run) for spec, folder in scenes),
        methods=tuple(methods),
        metrics=metrics(),
        results=tuple(_result(f, o, outcomes.get(f.folder), run) for f, o in zip(fits, fitted, strict=True)),
        environment=environment() | {"renderer": _renderers(scenes)},
        started=started,
        wall_s=round(time.perf_counter() - clock, 2),
    )
    write_json(run / "run.json", record)
    return record


def run_all(
    work: Callable[[J], Outcome],
    jobs: Sequence[J],
    at_a_time: int,
    progress: Progress,
    at_hand: Callable[[J], Outcome | None] = lambda job: None,
) -> list[Outcome]:
    """Do jobs in worker processes, each in a process of its own; outcomes in the order of the jobs.

    A worker that dies (out of memory, a crash in native code) fails its own job only.

    Args:
        work: Does a job; must be importable by a fresh process.
        jobs: What to do.
        at_a_time: Number of workers.
        progress: Called after each job.
        at_hand: Gives the outcome of a job that need not be done again.

    Raises:
        OutputError: A job could not write its result.
    """
    outcomes = {number: found for number, job in enumerate(jobs) if (found := at_hand(job)) is not None}
    context = multiprocessing.get_context("spawn")
    with ProcessPool(max_workers=at_a_time, max_tasks=1, context=context) as pool:
        try:
            waiting = {pool.schedule(work, [jobs[n]]): n for n in range(len(jobs)) if n not in outcomes}
            for future in as_completed(waiting):
                outcomes[waiting[future]] = _outcome_of(future)
                progress(len(outcomes) / len(jobs), f"{len(outcomes)} of {len(jobs)}")
        except BaseException:
            pool.stop()  # otherwise leaving the block waits for all the rest
            raise
    return [outcomes[number] for number in range(len(jobs))]


def job_hash(job: Job, capture_sha256: str, origin: str) -> str:
    """What addresses a job: equal specs on equal captures by equal methods have equal hashes."""
    text = dumps({"job": job, "capture": capture_sha256, "origin": origin})
    return hashlib.sha256(text.encode()).hexdigest()[:12]


def _render(suite: Suite, dataset: Path, progress: Progress) -> list[tuple[SceneSpec, Path]]:
    """Render all scenes one after the other: Mitsuba itself takes all cores."""
    jobs = [RenderJob(spec, suite.render, dataset, usable_cores()) for spec in suite.scenes]
    outcomes = run_all(run_render, jobs, 1, _part(progress, 0, "rendering"), scene_at_hand)
    for job, outcome in zip(jobs, outcomes, strict=True):
        if outcome.reason:
            raise RunError(f"scene {job.spec.track}/{scene_name(job.spec)}: {outcome.reason}")
    return [(job.spec, outcome.value) for job, outcome in zip(jobs, outcomes, strict=True)]


def _plan(suite: Suite, scenes: list[tuple[SceneSpec, Path]], run: Path, threads: int) -> list[FitJob]:
    plan = []
    for spec, folder in scenes:
        capture_sha256 = sha256(folder / "capture" / "manifest.json")
        for method in suite.methods:
            settings = encode(settings_of(load_method(method.name), method.settings))
            for seed in suite.seeds:
                job = Job(spec.track, folder.name, method.name, seed, settings)
                name = job_hash(job, capture_sha256, fingerprint(method.name))
                where = run / "jobs" / spec.track / folder.name / f"{_slug(method.name)}-{seed}-{name}"
                plan.append(FitJob(job, name, folder, where, threads))
    return plan


def _outcome_of(future: Future[Any]) -> Outcome:
    try:
        return future.result()
    except OutputError:
        raise
    except ProcessExpired as death:
        return Outcome(
            reason=f"expected the worker to come back, got its death (exit code {death.exitcode}): "
            "out of memory, or a crash in native code. Try fewer --jobs"
        )


def _method_record(method: SuiteMethod) -> MethodRecord:
    loaded = load_method(method.name)
    settings_of(loaded, method.settings)
    return MethodRecord(method.name, loaded.summary, tuple(loaded.needs))


def _scene_record(spec: SceneSpec, folder: Path, run: Path) -> SceneRecord:
    return SceneRecord(
        track=spec.track,
        scene=folder.name,
        family=spec.family,
        seed=spec.seed,
        folder=_relative(folder, run),
        truth_sha256=sha256(folder / "truth" / "manifest.json"),
        title=describe(spec),
    )


def _result(fit: FitJob, fitted: Outcome, scored: Outcome | None, run: Path) -> JobResult:
    reason = fitted.reason or (scored.reason if scored else "not scored")
    return JobResult(
        job=fit.job,
        job_hash=fit.job_hash,
        folder=_relative(fit.folder, run),
        status="failed" if reason else "done",
        reason=reason,
        sheet=scored.value if scored and not reason else None,
        cost=fitted.value,
    )


def _renderers(scenes: list[tuple[SceneSpec, Path]]) -> list[Any]:
    """The renderers that made the scenes, each once."""
    found = [manifest_of(open_truth(folder / "truth", check=False)).generator for _, folder in scenes]
    return [g for i, g in enumerate(found) if g not in found[:i]]


def _part(progress: Progress, stage: int, doing: str) -> Progress:
    """The progress of one of the three stages in that of the run."""
    return lambda done, what: progress((stage + done) / 3, f"{doing} {what}")


def _relative(path: Path, run: Path) -> str:
    """Relative to the run where it lies in it, so that a run folder can be moved."""
    path, run = path.resolve(), run.resolve()
    return path.relative_to(run).as_posix() if path.is_relative_to(run) else path.as_posix()


def _slug(name: str) -> str:
    return re.sub(r"[^A-Za-z0-9_.-]+", "_", name)
