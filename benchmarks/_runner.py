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
from dataclasses import replace
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
    RecordError,
    RunRecord,
    SceneRecord,
    dumps,
    encode,
    manifest_of,
    open_truth,
    read_run,
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
    """A bench cannot go on: a scene was not rendered, or the run folder is of another suite."""


def run_bench(
    suite: Suite,
    run: Path,
    jobs: int,
    progress: Progress,
    dataset: Path | None = None,
    *,
    timeout_s: float | None = None,
    part: bool = False,
) -> RunRecord:
    """Run a suite and write ``RUN/run.json``.

    Args:
        suite: What to run.
        run: The run folder; what is there and whole is reused.
        jobs: Number of fits at a time.
        progress: Called after each job.
        dataset: Where the scenes are or go; ``RUN/dataset`` by default.
        timeout_s: A fit or scoring that takes longer has failed; None for no limit.
        part: The suite was narrowed: what ``run.json`` has of its other parts stays in it.

    Raises:
        UnknownNameError: A method does not exist.
        MethodError: A method does not load, or does not take its settings.
        RunError: A scene could not be rendered, the folder holds a run of another suite, or ``jobs`` < 1.
        OutputError: The folder cannot be written to, or the disk is full.
    """
    if jobs < 1:
        raise RunError(f"expected 1 or more jobs at a time, got {jobs}. Mend --jobs")
    started, clock = datetime.now(UTC).isoformat(timespec="seconds"), time.perf_counter()
    methods = [_method_record(method) for method in suite.methods]  # a misspelt one fails before any work
    run = writable_folder(run)
    before = _record_before(run, suite)
    origins = environment()
    scenes = _render(suite, dataset or run / "dataset", progress)
    fits = _plan(suite, scenes, run, threads=max(1, usable_cores() // jobs))
    fitted = run_all(run_fit, fits, jobs, _part(progress, 1, "fitting"), fit_at_hand, timeout_s)
    done = [fit for fit, outcome in zip(fits, fitted, strict=True) if not outcome.reason]
    scored = run_all(run_score, done, jobs, _part(progress, 2, "scoring"), score_at_hand, timeout_s)
    outcomes = dict(zip([fit.folder for fit in done], scored, strict=True))
    record = RunRecord(
        suite=suite.name,
        suite_version=suite.version,
        scenes=tuple(_scene_record(spec, folder, run) for spec, folder in scenes),
        methods=tuple(methods),
        metrics=metrics(),
        results=tuple(_result(f, o, outcomes.get(f.folder), run) for f, o in zip(fits, fitted, strict=True)),
        environment=origins | {"renderer": _renderers(scenes)},
        started=started,
        wall_s=round(time.perf_counter() - clock, 2),
    )
    if before is not None and all(outcome.reused for outcome in (*fitted, *scored)):
        same = {"started": before.started, "wall_s": before.wall_s, "environment": before.environment}
        record = replace(record, **same)  # nothing was measured anew: keep what was true of the measurement
    if part and before is not None:
        record = _joined(record, before)
    write_json(run / "run.json", record)
    return record


def run_all(
    work: Callable[[J], Outcome],
    jobs: Sequence[J],
    at_a_time: int,
    progress: Progress,
    at_hand: Callable[[J], Outcome | None] = lambda job: None,
    timeout_s: float | None = None,
) -> list[Outcome]:
    """Do jobs in worker processes, each in a process of its own; outcomes in the order of the jobs.

    A worker that dies (out of memory, a crash in native code) fails its own job only.

    Args:
        work: Does a job; must be importable by a fresh process.
        jobs: What to do.
        at_a_time: Number of workers.
        progress: Called after each job.
        at_hand: Gives the outcome of a job that need not be done again.
        timeout_s: A job that takes longer has failed; None for no limit.

    Raises:
        OutputError: A job could not write its result.
    """
    outcomes = {number: found for number, job in enumerate(jobs) if (found := at_hand(job)) is not None}
    context = multiprocessing.get_context("spawn")
    with ProcessPool(max_workers=at_a_time, max_tasks=1, context=context) as pool:
        try:
            todo = [number for number in range(len(jobs)) if number not in outcomes]
            waiting = {pool.schedule(work, [jobs[n]], timeout=timeout_s): n for n in todo}
            for future in as_completed(waiting):
                outcomes[waiting[future]] = _outcome_of(future, timeout_s)
                progress(len(outcomes) / len(jobs), f"{len(outcomes)} of {len(jobs)}")
        except BaseException:
            pool.stop()  # otherwise leaving the block waits for all the rest
            raise
    return [outcomes[number] for number in range(len(jobs))]


def job_hash(job: Job, sees: Sequence[str], origin: str) -> str:
    """What addresses a job: its spec, the hashes of what the method is handed, and its code."""
    text = dumps({"job": job, "sees": list(sees), "origin": origin})
    return hashlib.sha256(text.encode()).hexdigest()[:12]


def _render(suite: Suite, dataset: Path, progress: Progress) -> list[tuple[SceneSpec, Path]]:
    """Render all scenes one after the other: Mitsuba itself takes all cores."""
    jobs = [RenderJob(spec, suite.render_of(spec), dataset, usable_cores()) for spec in suite.scenes]
    outcomes = run_all(run_render, jobs, 1, _part(progress, 0, "rendering"), scene_at_hand)
    for job, outcome in zip(jobs, outcomes, strict=True):
        if outcome.reason:
            raise RunError(f"scene {job.spec.track}/{scene_name(job.spec)}: {outcome.reason}")
    return [(job.spec, outcome.value) for job, outcome in zip(jobs, outcomes, strict=True)]


def _record_before(run: Path, suite: Suite) -> RunRecord | None:
    """What an earlier bench left in this folder.

    Raises:
        RunError: It was of another suite.
    """
    if not (run / "run.json").is_file():
        return None
    try:
        before = read_run(run)
    except RecordError:
        return None  # of an older format or damaged: it is written anew
    if (before.suite, before.suite_version) != (suite.name, suite.version):
        raise RunError(
            f"expected {run} to be free or to hold a run of {suite.name!r} version {suite.version}, got "
            f"one of {before.suite!r} version {before.suite_version}. Choose another --out"
        )
    return before


def _joined(record: RunRecord, before: RunRecord) -> RunRecord:
    """A record with those results of an earlier one that this one has not, on scenes that are the same."""
    truths = {(s.track, s.scene): s.truth_sha256 for s in record.scenes}
    kept = [s for s in before.scenes if truths.get((s.track, s.scene), s.truth_sha256) == s.truth_sha256]
    places = {(s.track, s.scene) for s in kept}
    keys = {_key(r.job) for r in record.results}
    old = [r for r in before.results if _key(r.job) not in keys and (r.job.track, r.job.scene) in places]
    names = {m.name for m in record.methods}
    return replace(
        record,
        scenes=record.scenes + tuple(s for s in kept if (s.track, s.scene) not in truths),
        methods=record.methods + tuple(m for m in before.methods if m.name not in names),
        results=record.results + tuple(old),
    )


def _key(job: Job) -> tuple[str, str, str, int]:
    return job.track, job.scene, job.method, job.seed


def _plan(suite: Suite, scenes: list[tuple[SceneSpec, Path]], run: Path, threads: int) -> list[FitJob]:
    plan = []
    for spec, folder in scenes:
        for method in suite.methods:
            loaded = load_method(method.name)
            settings = encode(settings_of(loaded, method.settings))
            sees = [
                folder / part / "manifest.json" for part in ("capture", "truth")[: 1 + bool(loaded.needs)]
            ]
            for seed in suite.seeds:
                job = Job(spec.track, folder.name, method.row, seed, settings, method.name)
                name = job_hash(job, [sha256(path) for path in sees], fingerprint(method.name))
                where = run / "jobs" / spec.track / folder.name / f"{_slug(method.row)}-{seed}-{name}"
                plan.append(FitJob(job, name, folder, where, threads))
    return plan


def _outcome_of(future: Future[Any], timeout_s: float | None) -> Outcome:
    try:
        outcome = future.result()
    except TimeoutError:
        return Outcome(reason=f"expected an end within {timeout_s:g} s, got none. Give it a longer --timeout")
    except ProcessExpired as death:
        return Outcome(
            reason=f"expected the worker to come back, got its death (exit code {death.exitcode}): "
            "out of memory, or a crash in native code. Try fewer --jobs"
        )
    if outcome.fatal:
        raise OutputError(outcome.reason)
    return outcome


def _method_record(method: SuiteMethod) -> MethodRecord:
    loaded = load_method(method.name)
    settings_of(loaded, method.settings)
    changed = ", ".join(f"{name} {value}" for name, value in method.settings.items())
    summary = f"{loaded.summary} ({changed})" if changed else loaded.summary
    return MethodRecord(method.row, summary, loaded.needs, method.name)


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
