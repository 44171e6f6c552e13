# SPDX-License-Identifier: Apache-2.0
"""From a predictions folder and a scene folder to a sheet of scores."""

from pathlib import Path
from typing import Any

from graycard import PredictionError, Predictions, Truth, open_predictions, open_truth
from graycard.eval._protocol import PROTOCOL
from graycard.eval.hints._hints import Hints, with_hints
from graycard.eval.kinds._images import is_in_every_view
from graycard.eval.kinds._metric import Metric, Scorer
from graycard.eval.lights._read import true_names
from graycard.eval.metrics._registry import gauge_names, registry
from graycard.eval.protocols import PublishedProtocol, find_protocols, score_protocols
from graycard.eval.scoring._findings import SceneFacts
from graycard.eval.scoring._gauge import Factors
from graycard.eval.scoring._readings import WITH_LIGHTS, read_prediction, read_truth
from graycard.eval.scoring._training import fit_gauges, survey_training
from graycard.io import sha256
from graycard.records import Score, ScoreSheet


def score_predictions(predictions: Path, scene: Path, protocol: str = PROTOCOL) -> ScoreSheet:
    """Score a predictions folder by the rules of a protocol.

    A pure function of the files in the two folders: the same files give the same sheet.

    Args:
        predictions: The predictions folder.
        scene: The scene's folder, ``DATASET/<track>/<scene>``; each file of its truth is first
            compared with its SHA-256.
        protocol: Name, id or group, as of :func:`graycard.eval.find_protocols`. By graycard's own, ``scores``
            holds one score for each metric that the scene has, in the order of
            :func:`graycard.eval.registry`; published ones fill ``protocols``; ``"all"`` fills both.

    Returns:
        What is wrong with a layer is in its scores; it raises nothing.

    Raises:
        UnknownNameError: There is no such protocol.
        PredictionError: The folder has no index, or is for another scene.
        DatasetError: The truth is missing or damaged.
    """
    chosen = find_protocols(protocol)
    published = [p for p in chosen if isinstance(p, PublishedProtocol)]
    truth = open_truth(Path(scene) / "truth")
    found, digest = open_predictions(Path(predictions)).hashed()
    if (found.track, found.scene) != (truth.track, truth.scene):
        raise PredictionError(
            f"expected predictions for {truth.track}/{truth.scene}, got some for "
            f"{found.track}/{found.scene} in {predictions}. Score them by their own scene"
        )
    return ScoreSheet(
        truth.track,
        truth.scene,
        found.method,
        digest,
        sha256(Path(scene) / "truth" / "manifest.json"),
        scores_of(found, truth) if len(published) < len(chosen) else (),
        score_protocols(published, found, truth) if published else (),
    )


def training_gauges(predictions: Path, scene: Path) -> dict[str, Factors]:
    """Return the gauges that a predictions folder has by its training views.

    Args:
        predictions: The predictions folder.
        scene: ``DATASET/<track>/<scene>``; its files are not compared with their hashes.

    Returns:
        Factors for R, G, B by id of each metric that has a gauge; without those that cannot be fitted.

    Raises:
        PredictionError: The folder has no index.
        DatasetError: The truth is missing or broken.
    """
    truth = open_truth(Path(scene) / "truth", check=False)
    fitted = fit_gauges(survey_training(open_predictions(Path(predictions)), truth))
    found = {metric: fitted.get(name, "") for metric, name in gauge_names().items()}
    return {metric: factors for metric, factors in found.items() if not isinstance(factors, str)}


def in_every_view() -> dict[str, bool]:
    """Return the metrics that each held-out view with an object in it has a value of.

    Returns:
        By id: whether the surfaces of lights are judged, too.
    """
    return {m.id: m.layer in WITH_LIGHTS for m in registry() if is_in_every_view(m)}


def scores_of(predictions: Predictions, truth: Truth) -> tuple[Score, ...]:
    """Return all scores by graycard's own protocol, in the order of the registry, of open folders.

    Raises:
        DatasetError: The truth of a view is missing or broken.
    """
    names = true_names(predictions, truth)
    training = survey_training(predictions, truth, names)
    scene = SceneFacts(truth.exposure, training, fit_gauges(training), names)
    metrics = [metric for metric in registry() if metric.available()]
    scorers, hints = _scorers(metrics, predictions, truth, scene), Hints()
    for view in (v for v in truth.views if v.split == "test"):
        true, predicted = read_truth(truth, view), read_prediction(predictions, view, names)
        for observer in (*scorers, hints):
            observer.observe(predicted, true, scene)
    found = {score.metric: score for scorer in scorers for score in scorer.scores()}
    scores = [found[metric.id] for metric in metrics if metric.id in found]
    return with_hints(scores, hints.found(predictions, truth))


def _scorers(
    metrics: list[Metric[Any]], predictions: Predictions, truth: Truth, scene: SceneFacts
) -> list[Scorer]:
    """Return a scorer for each kind of metric, in the order of the first metric of each."""
    kinds = dict.fromkeys(type(metric.rule) for metric in metrics)
    return [
        kind.scorer([m for m in metrics if type(m.rule) is kind], predictions, truth, scene) for kind in kinds
    ]
