# SPDX-License-Identifier: Apache-2.0
"""The work of a bench as pure functions of their spec, to be run in any process.

A job leaves its result on disk and gives back an :class:`Outcome`, never an exception: one broken
method fails its own jobs and no others.
"""

import contextlib
import os
import time
import traceback
from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, TypeVar

from threadpoolctl import threadpool_limits

from graycard import GraycardError, OutputError, missing_package, open_predictions
from graycard.benchmarks._fit import FitSpec, Fitted, fit_scene
from graycard.benchmarks._sources import hardware, scoring_fingerprint
from graycard.benchmarks._submitted import Given, take_predictions
from graycard.benchmarks.commands._command import RECORDED, Command
from graycard.benchmarks.commands._fit import CommandSpec, fit_command
from graycard.eval import find_metric, score_predictions, unavailable
from graycard.io import (
    await_file,
    file_lock,
    from_builtins,
    printable,
    read_json,
    remove,
    sha256,
    writable_folder,
    write_bytes,
    write_json,
)
from graycard.methods import words_of
from graycard.methods.priors import PriorSpec
from graycard.predictions import predictions_hash
from graycard.processes import Outcome, worker_progress
from graycard.records import Access, Cost, Job, ScoreSheet
from graycard.synth import (
    RenderSettings,
    SceneSpec,
    begin_scene,
    find_scene,
    render_part,
    render_scene,
    scene_name,
)

R = TypeVar("R")

DONE, SCORES, ERROR, SCORING = "job.json", "scores.json", "error.txt", "scoring.json"
RENDERING = "rendering"
"""Folder of a run with what its scenes took."""

JOBS_EACH = 20
"""Fits or sheets of a worker, until a fresh one takes over: to import what they need takes seconds."""
PROTOCOLS = "albedo"
"""A bench scores by graycard's rules and puts the published albedo protocols beside them."""


@dataclass(frozen=True, slots=True)
class RenderJob:
    """Render one scene."""

    spec: SceneSpec
    settings: RenderSettings
    dataset: Path
    threads: int
    run: Path | None = None
    """Run folder, where the cost of a scene is kept; None: nowhere."""

    @property
    def words(self) -> str:
        """Return which scene it renders."""
        return f"{self.spec.track}/{scene_name(self.spec)}"


@dataclass(frozen=True, slots=True)
class PartJob:
    """Render some pictures of a scene that was begun."""

    scene: RenderJob
    numbers: tuple[int, ...]

    @property
    def words(self) -> str:
        """Return which scene it renders a part of."""
        return f"{len(self.numbers)} pictures of {self.scene.words}"


@dataclass(frozen=True, slots=True)
class FitJob:
    """Fit one method on one scene and score it."""

    job: Job
    job_hash: str
    scene: Path
    folder: Path
    threads: int
    jobs: Path | None = None
    """Folder of all jobs of the run, whose predictions are none of this method's business."""
    donor: Path | None = None
    """The scene whose object is put in; None: none is."""
    stages: Path | None = None
    """Folder in which fits of the same code leave stages for others."""
    given: Given | None = None
    """Predictions of other code, taken in place of a fit."""
    allowed: tuple[Path, ...] = ()
    """Files and folders that the method may read and change besides."""
    command: Command | None = None
    """Command that is run in place of a fit."""

    @property
    def words(self) -> str:
        """Return what it fits on which scene."""
        seed = f", seed {self.job.seed}" if self.job.seed else ""
        return f"{self.job.track}/{self.job.scene} {self.job.method}{seed}"

    @property
    def may_use_gpu(self) -> bool:
        """Tell whether the fit may use a GPU: not with back end ``cpu``, nor where nothing is fitted."""
        return self.given is None and self.job.settings.get("backend") != "cpu"


@dataclass(frozen=True, slots=True)
class Done:
    """``job.json``, written last: a job folder without it is half-done and is begun anew."""

    job: Job
    job_hash: str
    cost: Cost | None
    """None, as ``access``, where predictions of other code were taken: neither is known."""
    access: Access | None
    machine: Mapping[str, Any] | None = None
    """Hardware that it was fitted on; None where nothing was, or older code did it."""

    @property
    def fitted(self) -> Fitted | None:
        """Record; None where nothing was fitted."""
        return Fitted(self.cost, self.access, self.machine) if self.cost and self.access else None


@dataclass(frozen=True, slots=True)
class CpuCost:
    """``scoring.json``, and the files in ``RUN/rendering``: the time that scores or a scene took."""

    cpu_s: float
    """Over all cores."""


@dataclass(frozen=True, slots=True)
class Scored:
    """``scores.json``: the scores, and what they depend on."""

    key: tuple[str, ...]
    sheet: ScoreSheet
    lacking: tuple[str, ...] = ()
    """Metrics that could not be computed, as weights of their networks were missing or damaged."""


def run_render(job: RenderJob) -> Outcome:
    """Render a scene; the renderer keeps what is there and intact."""
    return guarded(lambda: Outcome(value=_rendered(job)), None)


def _rendered(job: RenderJob) -> Path:
    def keep(cpu_s: float) -> None:
        if job.run is not None:
            path = rendering_cost(job.run, job.spec.track, scene_name(job.spec))
            write_json(writable_folder(path.parent) / path.name, CpuCost(cpu_s))

    return render_scene(job.spec, job.settings, job.dataset, worker_progress(), job.threads, on_cost=keep)


def rendering_cost(run: Path, track: str, scene: str) -> Path:
    """Return the file that says what it took to render a scene, where the run did it in one go."""
    return run / RENDERING / track / f"{scene}.json"


def run_begin(job: RenderJob) -> Outcome:
    """Get a scene ready to be rendered in parts; the value has the numbers of its missing pictures."""
    return guarded(lambda: Outcome(value=begin_scene(job.spec, job.settings, job.dataset, job.threads)), None)


def run_part(job: PartJob) -> Outcome:
    """Render some pictures of a scene; those that are there are kept."""
    scene = job.scene

    def work() -> Outcome:
        render_part(scene.spec, scene.settings, scene.dataset, job.numbers, scene.threads)
        return Outcome()

    return guarded(work, None)


def run_fit(job: FitJob) -> Outcome:
    """Fit a method and write its predictions; two processes at one job do it once."""

    def work() -> Outcome:
        for part in ("capture", "truth"):
            await_file(job.scene / part / "manifest.json")
        with _lock(job):
            found = find_fit(job)
            if found is not None:
                return found
            remove(job.folder / DONE)
            done = Done(job.job, job.job_hash, *_made(job), None if job.given else hardware())
            write_json(job.folder / DONE, done)
            remove(job.folder / ERROR)
            return Outcome(value=done.fitted)

    return guarded(work, job.folder / ERROR, lambda: find_fit(job))


def _made(job: FitJob) -> tuple[Cost, Access] | tuple[None, None]:
    """Make the predictions of a job, and give what that cost and saw; take them where they are given."""
    made, predictions = job.job, job.folder / "predictions"
    if job.given is not None:
        take_predictions(job.given, predictions, made)
        return None, None
    if job.command is not None:
        settings = {name: value for name, value in made.settings.items() if name != RECORDED}
        known = made.settings.get(RECORDED, {})
        code = "" if "." in job.command.code else known.get("code_sha256", "")  # a run there grows
        told = CommandSpec(job.command, made.method, settings, made.seed, job.scene)
        told = replace(told, allowed=job.allowed, code_sha256=code, reads_sha256=known.get("reads", {}))
        with threads_limited(job.threads):
            return fit_command(told, predictions, worker_progress(), job.jobs)
    priors = from_builtins(PriorSpec, made.priors)
    asked = (made.entry, made.settings, made.seed, job.scene, made.method, priors)
    spec = FitSpec(*asked, donor=job.donor, stages=job.stages, allowed=job.allowed)
    with threads_limited(job.threads):
        fitted = fit_scene(spec, predictions, worker_progress(), jobs=job.jobs)
    return fitted.cost, fitted.access


def run_score(job: FitJob) -> Outcome:
    """Score the predictions of a job and keep the scores; two processes at one job do it once."""

    def work() -> Outcome:
        await_file(job.folder / DONE)
        with _lock(job), threads_limited(job.threads):
            if found := find_scores(job):
                return found
            key, lacking, begun = _score_key(job), tuple(unavailable()), time.process_time()
            sheet = score_predictions(job.folder / "predictions", job.scene, PROTOCOLS)
            write_json(job.folder / SCORING, CpuCost(time.process_time() - begun))
            write_json(job.folder / SCORES, Scored(key, sheet, (*lacking, *_damaged(sheet))))
            remove(job.folder / ERROR)
            return Outcome(value=sheet)

    return guarded(work, job.folder / ERROR, lambda: find_scores(job))


def find_rendered(job: RenderJob) -> Outcome | None:
    """Return the folder of a scene that is rendered and intact; None if there is work to do."""
    try:
        folder = find_scene(job.spec, job.settings, job.dataset)
    except GraycardError as error:
        return Outcome(reason=str(error))
    return None if folder is None else Outcome(reused=True, value=folder)


def find_fit(job: FitJob) -> Outcome | None:
    """Return the outcome of a fit that has been done and whose predictions are intact; else None."""
    done = read_or_none(Done, job.folder / DONE)
    if done is None or done.job_hash != job.job_hash:
        return None
    if job.given is None and done.fitted is None:
        return None
    try:
        whole = open_predictions(job.folder / "predictions").is_whole()
    except GraycardError:
        return None
    return Outcome(reused=True, value=done.fitted) if whole else None


def find_scores(job: FitJob) -> Outcome | None:
    """Return the scores of exactly these predictions, this truth and these metrics.

    None if there are none, or if a metric that was lacking can be computed now.
    """
    scored = read_or_none(Scored, job.folder / SCORES)
    if scored is None or scored.key != _score_key(job) or not set(scored.lacking) <= set(unavailable()):
        return None
    return Outcome(reused=True, value=scored.sheet)


def _damaged(sheet: ScoreSheet) -> Iterator[str]:
    """Yield the metrics with weights that failed: the next bench tries them again."""
    for score in sheet.scores:
        if score.status == "failed" and find_metric(score.metric).advice:
            yield score.metric


def _score_key(job: FitJob) -> tuple[str, ...]:
    """Return inputs of scores: the code that makes them, the predictions, the truth, the protocols."""
    truth = sha256(job.scene / "truth" / "manifest.json")
    return scoring_fingerprint(), predictions_hash(job.folder / "predictions"), truth, PROTOCOLS


def read_or_none(cls: type[R], path: Path) -> R | None:
    """Return a record; None where there is none that can be used."""
    try:
        return from_builtins(cls, read_json(path))
    except GraycardError:
        return None


def _lock(job: FitJob) -> AbstractContextManager[None]:
    """One process at a time in a job folder; says for which one it waits."""
    progress = worker_progress()
    return file_lock(writable_folder(job.folder) / ".lock", lambda who: progress(0.0, f"waiting for {who}"))


THREADS = ("OMP_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")
"""Variables that say how many threads libraries may start."""


def threads_limited(count: int) -> AbstractContextManager[Any]:
    """Limit the threads of libraries that are loaded, and by the environment of those to come (torch)."""
    for name in THREADS:
        os.environ[name] = str(count)
    return threadpool_limits(count)


def guarded(
    work: Callable[[], Outcome], log: Path | None, find: Callable[[], Outcome | None] = lambda: None
) -> Outcome:
    """Return the outcome of some work, or of its failure.

    The traceback of what is not ours goes to ``log``.

    Args:
        work: The work.
        log: A file; None for no log.
        find: Returns what another process has made meanwhile: then it does not matter that this one failed.
    """
    try:
        return work()
    except OutputError as error:
        return Outcome(reason=str(error), fatal=True)  # a full disk is no fault of the method
    except BaseException as error:  # Ctrl+C does not reach a worker: whoever raised it here is the job
        with contextlib.suppress(Exception):  # what broke the work may break this
            if found := find():
                return found
        return _failed(error, log)


def _failed(error: BaseException, log: Path | None) -> Outcome:
    """Return the outcome of a failure."""
    if isinstance(error, GraycardError):
        words = printable(words_of(error)) or type(error).__name__
        return Outcome(reason=f"{words}{_logged(log, error)}")
    if missing := missing_package(error):
        return Outcome(reason=str(missing))
    return Outcome(reason=f"{type(error).__name__}: {printable(words_of(error))}{_logged(log, error)}")


def _logged(log: Path | None, error: BaseException) -> str:
    """Keep the traceback of what is not ours, and say where."""
    ours = isinstance(error, GraycardError) and isinstance(error.__cause__, GraycardError | None)
    if log is None or ours:
        return ""
    write_bytes(log, printable("".join(traceback.format_exception(error))).encode())
    return f" (traceback in {log.name})"
