# SPDX-License-Identifier: Apache-2.0
"""Rules for a valid result that the files of a run and of its scenes can break."""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TypeVar

import numpy as np

from graycard import DatasetError, GraycardError, Progress, open_truth
from graycard.benchmarks._jobs import DONE, PROTOCOLS, SCORES, Done, Scored
from graycard.benchmarks.validity._record import Breach, difference, place_of
from graycard.eval import in_every_view, judged_mask, score_predictions, training_gauges
from graycard.io import Manifest, damaged_files, from_builtins, read_json, read_manifest, sha256, to_builtins
from graycard.predictions import predictions_hash
from graycard.records import JobResult, RunRecord, SceneRecord, job_folder

_PARTS = ("capture", "truth")

T = TypeVar("T")


def _told(items: Sequence[T], unit: str, progress: Progress) -> Iterator[T]:
    """Yield items, and say before each how many are done."""
    for done, item in enumerate(items):
        progress(done / len(items), f"{done:,} of {len(items):,} {unit}")
        yield item


def scene_breaches(run: RunRecord, folder: Path, progress: Progress) -> list[Breach]:
    """Scenes that are gone, damaged, or other than those that were measured."""
    return [breach for scene in _told(run.scenes, "scenes", progress) for breach in _scene(scene, folder)]


def _scene(scene: SceneRecord, run: Path) -> Iterator[Breach]:
    where = f"{scene.track}/{scene.scene}"
    for part in _PARTS:
        folder = run / scene.folder / part
        try:
            manifest = read_manifest(folder, f"graycard-{part}")
        except DatasetError as cause:
            yield Breach("hashes", where, str(cause), unknown=True)
            continue
        for name, fault in damaged_files(folder, manifest).items():
            yield Breach("hashes", where, f"{part}/{name}: {fault}")
        if part == "truth":
            yield from _truth(scene, manifest, sha256(folder / "manifest.json"))


def _truth(scene: SceneRecord, manifest: Manifest, digest: str) -> Iterator[Breach]:
    where = f"{scene.track}/{scene.scene}"
    if digest != scene.truth_sha256:
        what = f"expected truth with SHA-256 {scene.truth_sha256[:12]}…, as run.json says, got {digest[:12]}…"
        yield Breach("hashes", where, what)
    seed = manifest.seeds.get("scene")
    if scene.seed is not None and seed != scene.seed:
        what = f"expected a scene of seed {scene.seed}, as run.json says, got one of seed {seed}"
        yield Breach("seeds", where, what)


def hash_breaches(run: RunRecord, folder: Path, progress: Progress) -> list[Breach]:
    """Predictions, scores and fits that are gone, or other than those of ``run.json``."""
    scenes = {(s.track, s.scene): s for s in run.scenes}
    found: list[Breach] = []
    done = [result for result in run.results if result.status == "done" and result.sheet]
    for result in _told(done, "fits", progress):
        scene = scenes.get((result.job.track, result.job.scene))
        found += [*_predictions(result, folder), *_records(result, folder)]
        found += _depends(result, scene, folder) if scene else ()
    return found


def _predictions(result: JobResult, run: Path) -> Iterator[Breach]:
    predictions = job_folder(run, result) / "predictions"
    if not predictions.is_dir():
        what = f"expected predictions in {predictions}, got none"
        yield Breach("hashes", place_of(result), what, unknown=True)
    elif result.sheet and (found := predictions_hash(predictions)) != result.sheet.predictions_sha256:
        scored = result.sheet.predictions_sha256
        what = f"expected predictions with SHA-256 {scored[:12]}…, which were scored, got {found[:12]}…"
        yield Breach("hashes", place_of(result), what)


def _records(result: JobResult, run: Path) -> Iterator[Breach]:
    """Yield a breach where ``scores.json`` or ``job.json`` does not say what ``run.json`` says."""
    try:
        scored = from_builtins(Scored, read_json(job_folder(run, result) / SCORES), source=SCORES)
        done = from_builtins(Done, read_json(job_folder(run, result) / DONE), source=DONE)
    except GraycardError as cause:
        yield Breach("hashes", place_of(result), str(cause), unknown=True)
        return
    kept = {SCORES: scored.sheet, DONE: (done.job, done.job_hash, done.cost, done.access)}
    said = {SCORES: result.sheet, DONE: (result.job, result.job_hash, result.cost, result.access)}
    for name in kept:
        if (place := difference(to_builtins(kept[name]), to_builtins(said[name]), tolerance=0)) is not None:
            what = f"expected run.json to say what {name} says, got another {place or 'value'}"
            yield Breach("hashes", place_of(result), what)


def _depends(result: JobResult, scene: SceneRecord, run: Path) -> Iterator[Breach]:
    """Yield a breach where a fit or its scores are of another truth or capture than the run names."""
    if result.sheet and result.sheet.truth_sha256 != scene.truth_sha256:
        yield Breach(
            "hashes", place_of(result), "expected scores by the truth of run.json, got another truth"
        )
    capture = run / scene.folder / "capture" / "manifest.json"
    if result.access and capture.is_file() and sha256(capture) != result.access.capture_sha256:
        yield Breach(
            "hashes", place_of(result), "expected a fit to the capture of the run, got another capture"
        )


def view_breaches(run: RunRecord, folder: Path, progress: Progress) -> list[Breach]:
    """Held-out views that see something and are in no score, though every method may have left them out."""
    found = []
    for scene in _told(run.scenes, "scenes", progress):
        try:
            seen = _views_that_see(folder / scene.folder)
        except GraycardError:
            continue  # said by `hashes`
        results = [r for r in run.results if (r.job.track, r.job.scene) == (scene.track, scene.scene)]
        found += [b for result in results for b in _views(result, seen)]
    return found


def _views_that_see(scene: Path) -> Mapping[bool, set[str]]:
    """Return the names of the held-out views that see an object, by whether surfaces of lights count."""
    truth = open_truth(scene / "truth", check=False)
    ids = {v.name: truth.layers(v)["object_id"] for v in truth.views if v.split == "test"}
    left_out = {True: frozenset[int](), False: truth.emitter_ids()}
    return {
        lights: {name for name, found in ids.items() if judged_mask(found, out).any()}
        for lights, out in left_out.items()
    }


def _views(result: JobResult, seen: Mapping[bool, set[str]]) -> Iterator[Breach]:
    everywhere = in_every_view()
    for score in result.sheet.scores if result.sheet else ():
        if not score.per_view or score.metric not in everywhere:
            continue
        expected = seen[everywhere[score.metric]]
        if absent := sorted(expected - score.per_view.keys()):
            what = f"{score.metric}: expected {len(expected)} held-out views, got none of {', '.join(absent)}"
            yield Breach("counts", place_of(result), what)


def gauge_breaches(run: RunRecord, folder: Path, progress: Progress) -> list[Breach]:
    """Gauges other than those that the training views give."""
    scenes = {(s.track, s.scene): folder / s.folder for s in run.scenes}
    found: list[Breach] = []
    for result in _told(run.results, "fits", progress):
        scene = scenes.get((result.job.track, result.job.scene))
        if scene and result.sheet:
            found += _gauges(result, scene, folder)
    return found


def _gauges(result: JobResult, scene: Path, run: Path) -> Iterator[Breach]:
    try:
        fitted = training_gauges(job_folder(run, result) / "predictions", scene)
    except GraycardError as cause:
        yield Breach(
            "gauge", place_of(result), f"expected to fit the gauge again, got: {cause}", unknown=True
        )
        return
    for score in result.sheet.scores if result.sheet else ():
        right = fitted.get(score.metric)
        if score.gauge is None and (right is None or score.status != "scored"):
            continue
        if not _agree(score.gauge, right):
            expected, got = (
                " ".join(f"{g:.4g}" for g in factors or ()) or "none" for factors in (right, score.gauge)
            )
            what = f"{score.metric}: expected the gauge that the training views give, {expected}, got {got}"
            yield Breach("gauge", place_of(result), what)


def _agree(one: Sequence[float] | None, other: Sequence[float] | None) -> bool:
    return (
        one is not None
        and other is not None
        and len(one) == len(other)
        and np.allclose(one, other, rtol=1e-6, atol=0)
    )


def score_breaches(run: RunRecord, folder: Path, progress: Progress) -> list[Breach]:
    """Score sheets other than those that scoring the predictions again gives."""
    scenes = {(s.track, s.scene): folder / s.folder for s in run.scenes}
    found = []
    for result in _told([result for result in run.results if result.sheet], "fits", progress):
        scene = scenes.get((result.job.track, result.job.scene))
        try:
            again = score_predictions(job_folder(folder, result) / "predictions", scene or folder, PROTOCOLS)
        except GraycardError as cause:
            what = f"expected to score it again, got: {cause}"
            found.append(Breach("scores", place_of(result), what, unknown=True))
            continue
        if (place := difference(to_builtins(result.sheet), to_builtins(again))) is not None:
            what = f"expected the scores of run.json, got another {place}"
            found.append(Breach("scores", place_of(result), what))
    return found
