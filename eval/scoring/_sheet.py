# SPDX-License-Identifier: Apache-2.0
"""From a predictions folder and a scene folder to a sheet of scores."""

from pathlib import Path

from graycard import PredictionError, Predictions, Truth, open_predictions, open_truth
from graycard.eval.hints._hints import Hints, with_hints
from graycard.eval.lights._environment import score_environments
from graycard.eval.lights._scores import local, score_lights, true_names
from graycard.eval.metrics._light_off import LightsOff
from graycard.eval.metrics._relighting import Masks, score_changed
from graycard.eval.metrics._table import VIEW_METRICS, gauge_names
from graycard.eval.metrics._training_view import score_training_views
from graycard.eval.metrics._view_metrics import ViewScores
from graycard.eval.protocols import PROTOCOL, AlbedoProtocol, find_protocols, score_protocols
from graycard.eval.scoring._gauge import Factors
from graycard.eval.scoring._images import score_images
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
        protocol: Name or id. By graycard's own, ``scores`` holds one score for each metric that the scene
            has, in the order of :func:`graycard.eval.metrics`; a published one judges base colour
            alone, into ``protocols``; ``"all"`` fills both.

    Returns:
        What is wrong with a layer is in its scores; it raises nothing.

    Raises:
        UnknownNameError: There is no such protocol.
        PredictionError: The folder has no index, or is for another scene.
        DatasetError: The truth is missing or damaged.
    """
    chosen = find_protocols(protocol)
    published = [p for p in chosen if isinstance(p, AlbedoProtocol)]
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
    """The gauges that a predictions folder has by its training views.

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


def scores_of(predictions: Predictions, truth: Truth) -> tuple[Score, ...]:
    """All scores by graycard's own protocol, in the order of the table, of folders that are open already.

    Raises:
        DatasetError: The truth of a view is missing or broken.
    """
    names = true_names(predictions, truth)
    training = survey_training(predictions, truth, names)
    views, masks, hints = ViewScores(VIEW_METRICS), Masks(), Hints()
    off = LightsOff([light.name for light in local(truth.lights())], names)
    scores = (
        *score_images(predictions, truth, training, names, (views, off, masks, hints)),
        *views.scores(),
        *off.scores(),
        *score_changed(predictions, truth, masks),
        *score_training_views(training),
        *score_lights(predictions, truth, fit_gauges(training)["light"]),
        *score_environments(predictions, truth),
    )
    return with_hints(scores, hints.found(predictions, truth))
