# SPDX-License-Identifier: Apache-2.0
"""Score predictions of an imported capture by the photographs that were held out of it.

The measures are those of novel views, over all pixels, as there is no truth that says which belong to an
object. Where EXIF tells the exposure of a photograph, both pictures are compared at that, and cut off at its
white, as the camera cut off what it saw. No factor is fitted: where EXIF tells none, a camera that chose its
exposure anew for each photograph costs what it costs.
"""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from graycard import PredictionError, Predictions, Truth, UnknownNameError, open_predictions
from graycard.dataset import HeldOut, open_held_out
from graycard.eval.hints._hints import Hints
from graycard.eval.kinds._images import ImageMetric, ImageRule
from graycard.eval.metrics._registry import registry
from graycard.eval.scoring._findings import SceneFacts
from graycard.eval.scoring._readings import PredictedView, photographed, read_prediction
from graycard.eval.scoring._training import Training
from graycard.records import MetricRecord, PhotographSheet, Score

PROTOCOL = "photographs-2"
GROUP, _FROM = "photographs", "novel_view"
_MEASURES = ("psnr", "ssim", "flip", "lpips", "lpips.vgg")
AS_TAKEN = "as_taken"
"""Name in the breakdown: without the exposure of the scene, as files of 8 bits are compared elsewhere."""


def score_photographs(predictions: Path, scene: Path, protocol: str = "graycard") -> PhotographSheet:
    """Score a predictions folder by held-out photographs.

    Args:
        predictions: The predictions folder.
        scene: ``DATASET/<track>/<scene>`` of an imported capture; each file of its photographs is first
            compared with its SHA-256.
        protocol: There is none but graycard's own.

    Raises:
        UnknownNameError: Another protocol was asked for.
        PredictionError: The folder has no index, or is for another scene.
        DatasetError: No photograph was held out, or one is damaged.
    """
    if protocol != "graycard":
        raise UnknownNameError(
            "protocol without truth", protocol, ["graycard"], "Others need truth, which a capture has not"
        )
    held = open_held_out(Path(scene))
    found, digest = open_predictions(Path(predictions)).hashed()
    capture = held.capture
    if (found.track, found.scene) != (capture.track, capture.scene):
        raise PredictionError(
            f"expected predictions for {capture.track}/{capture.scene}, got some for "
            f"{found.track}/{found.scene} in {predictions}. Score them by their own scene"
        )
    metrics = _metrics()
    scores, hints = _scores(metrics, found, held)
    scored = {score.metric for score in scores}
    return PhotographSheet(
        capture.track,
        capture.scene,
        found.method,
        digest,
        held.sha256,
        tuple(_named(score, hints) for score in scores),
        tuple(_record(metric.record) for metric in metrics if metric.id in scored),
        len(held.views),
        tuple(view.name for view in held.lacking),
    )


def _metrics() -> list[ImageMetric]:
    wanted = [f"{_FROM}.{measure}" for measure in _MEASURES]
    return [metric for metric in registry() if metric.id in wanted and metric.available()]


def _scores(
    metrics: Sequence[ImageMetric], predictions: Predictions, held: HeldOut
) -> tuple[list[Score], tuple[str, ...]]:
    """Return the scores as of novel views, and hints about the pictures."""
    capture, hints = held.capture, Hints()
    nothing = Truth(capture.track, capture.scene, capture.views, capture.exposure, 0.0, ())
    facts = [SceneFacts(exposure, Training(frozenset(), (), {})) for exposure in (capture.exposure, 1.0)]
    exposed, taken = (ImageRule.scorer(metrics, predictions, nothing, scene) for scene in facts)
    brightest = 0.0
    for view in held.views:
        photograph, exposure = held.photograph(view), np.float32(held.exposure(view))
        brightest = max(brightest, float(photograph.max()))
        true = photographed(view, photograph * exposure)
        predicted = _exposed(read_prediction(predictions, view), exposure)
        for observer, scene in ((exposed, facts[0]), (taken, facts[1]), (hints, facts[0])):
            observer.observe(predicted, true, scene)
    plain = {s.metric: s.value for s in taken.scores()} if brightest <= 1 and held.sensor is None else {}
    scores = [replace(s, breakdown={**s.breakdown, **_taken(plain.get(s.metric))}) for s in exposed.scores()]
    return scores, tuple(hint.says for hint in hints.of_layers() if hint.layer == "radiance")


def _exposed(predicted: PredictedView, exposure: np.float32) -> PredictedView:
    """Return a prediction whose light is brought to the exposure of a photograph."""
    if "radiance" not in predicted.layers:
        return predicted
    light = {"radiance": predicted.layers["radiance"] * exposure}
    return replace(predicted, layers={**predicted.layers, **light})


def _taken(value: float | None) -> dict[str, float]:
    return {} if value is None else {AS_TAKEN: value}


def _named(score: Score, hints: tuple[str, ...]) -> Score:
    """Return a score by its own name, with the hints beside the first."""
    name = score.metric.replace(_FROM, GROUP, 1)
    told = hints if name == f"{GROUP}.psnr" else ()
    return replace(score, metric=name, protocol=PROTOCOL, warnings=score.warnings + told)


def _record(record: MetricRecord) -> MetricRecord:
    return replace(
        record,
        id=record.id.replace(_FROM, GROUP, 1),
        title=record.title.replace("Novel view", "Photographs"),
        group=GROUP,
        headline=False,
        formula=f"{record.formula}; here every pixel of held-out photographs, which are no truth",
    )
