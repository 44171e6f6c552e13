# SPDX-License-Identifier: Apache-2.0
"""The work of a bench as pure functions of their spec, to be run in any process.

A job leaves its result on disk and gives back an :class:`Outcome`, never an exception: one broken
method fails its own jobs and no others.
"""

import json
import traceback
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from threadpoolctl import threadpool_limits

from graycard import (
    Cost,
    GraycardError,
    Job,
    OutputError,
    PredictionError,
    ScoreSheet,
    decode,
    open_predictions,
    predictions_hash,
    read_json,
    sha256,
    silent,
    write_bytes,
    write_json,
)
from graycard.benchmarks._fit import DONE, FitSpec, finish_job, fit_scene
from graycard.benchmarks._sources import eval_fingerprint
from graycard.eval import score_predictions
from graycard.synth import RenderSettings, SceneSpec, find_scene, render_scene

SCORES = "scores.json"


@dataclass(frozen=True, slots=True)
class Outcome:
    """How a job ended."""

    reason: str = ""
    """Why it failed; empty if it did not."""
    reused: bool = False
    """Whether all was there already."""
    value: Any = None


@dataclass(frozen=True, slots=True)
class RenderJob:
    """Render one scene."""

    spec: SceneSpec
    settings: RenderSettings
    dataset: Path
    threads: int


@dataclass(frozen=True, slots=True)
class FitJob:
    """Fit one method on one scene and score it."""

    job: Job
    job_hash: str
    scene: Path
    folder: Path
    threads: int


def run_render(job: RenderJob) -> Outcome:
    """Render a scene; the renderer keeps what is there and intact."""
    return _guarded(
        lambda: Outcome(value=render_scene(job.spec, job.settings, job.dataset, silent, job.threads)), None
    )


def run_fit(job: FitJob) -> Outcome:
    """Fit a method and write its predictions."""

    def work() -> Outcome:
        (job.folder / DONE).unlink(missing_ok=True)
        spec = FitSpec(job.job.method, job.job.settings, job.job.seed, job.scene)
        with threadpool_limits(job.threads):
            cost = fit_scene(spec, job.folder / "predictions", silent)
        finish_job(job.folder, {"job": job.job, "job_hash": job.job_hash}, cost)
        return Outcome(value=cost)

    return _guarded(work, job.folder / "error.txt")


def run_score(job: FitJob) -> Outcome:
    """Score the predictions of a job and keep the scores."""

    def work() -> Outcome:
        key = _score_key(job)
        with threadpool_limits(job.threads):
            sheet = score_predictions(job.folder / "predictions", job.scene)
        write_json(job.folder / SCORES, {"key": key, "sheet": sheet})
        return Outcome(value=sheet)

    return _guarded(work, job.folder / "error.txt")


def scene_at_hand(job: RenderJob) -> Outcome | None:
    """The folder of a scene that is rendered and intact; None if there is work to do."""
    try:
        folder = find_scene(job.spec, job.settings, job.dataset)
    except GraycardError as error:
        return Outcome(reason=str(error))
    return None if folder is None else Outcome(reused=True, value=folder)


def fit_at_hand(job: FitJob) -> Outcome | None:
    """The outcome of a fit that has been done and whose predictions are intact; else None."""
    cost = finished_cost(job)
    return None if cost is None else Outcome(reused=True, value=cost)


def score_at_hand(job: FitJob) -> Outcome | None:
    """The scores of exactly these predictions, this truth and these metrics; None if there are none."""
    sheet = _stored_sheet(job.folder / SCORES, _score_key(job))
    return None if sheet is None else Outcome(reused=True, value=sheet)


def finished_cost(job: FitJob) -> Cost | None:
    """What a job took that has been done and whose predictions are intact; else None."""
    path = job.folder / DONE
    if not path.is_file():
        return None
    done = read_json(path)
    if not isinstance(done, dict) or done.get("job_hash") != job.job_hash:
        return None
    try:
        predictions = open_predictions(job.folder / "predictions")
        for view in predictions.view_names():
            predictions.layers(view)
    except PredictionError:
        return None
    return decode(Cost, done["cost"])


def _score_key(job: FitJob) -> list[str]:
    """What scores depend on: the code of the metrics, the predictions, the truth."""
    truth = sha256(job.scene / "truth" / "manifest.json")
    return [eval_fingerprint(), predictions_hash(job.folder / "predictions"), truth]


def _stored_sheet(path: Path, key: list[str]) -> ScoreSheet | None:
    if not path.is_file():
        return None
    try:
        stored = json.loads(path.read_text(encoding="utf-8"))
        return decode(ScoreSheet, stored["sheet"]) if stored["key"] == key else None
    except (ValueError, KeyError, GraycardError):
        return None


def _guarded(work: Callable[[], Outcome], log: Path | None) -> Outcome:
    try:
        return work()
    except OutputError:
        raise  # a full disk is no fault of the method: it ends the run
    except GraycardError as error:
        return Outcome(reason=str(error))
    except Exception as error:  # a method may raise anything at all
        if log is not None:
            write_bytes(log, traceback.format_exc().encode())
        where = f" (traceback in {log.name})" if log is not None else ""
        return Outcome(reason=f"{type(error).__name__}: {error}{where}")
