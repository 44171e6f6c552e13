# SPDX-License-Identifier: Apache-2.0
"""From a predictions folder and a scene folder to a sheet of scores."""

from pathlib import Path

import graycard as gc
from graycard.eval._images import score_images
from graycard.eval._light_scores import score_lights


def score_predictions(predictions: Path, scene: Path) -> gc.ScoreSheet:
    """Score a predictions folder by the rules of :data:`graycard.eval.PROTOCOL`.

    A pure function of the files in the two folders: the same files give the same sheet.

    Args:
        predictions: The predictions folder.
        scene: The scene's folder, ``DATASET/<track>/<scene>``; each file of its truth is first
            compared with its SHA-256.

    Returns:
        One score for each metric that the scene has, in the order of :func:`graycard.eval.metrics`.
        What is wrong with a layer is in its scores; it raises nothing.

    Raises:
        PredictionError: The folder has no index, or is for another scene.
        DatasetError: The truth is missing or damaged.
    """
    truth = gc.open_truth(Path(scene) / "truth")
    found = gc.open_predictions(Path(predictions))
    if (found.track, found.scene) != (truth.track, truth.scene):
        raise gc.PredictionError(
            f"expected predictions for {truth.track}/{truth.scene}, got some for "
            f"{found.track}/{found.scene} in {predictions}. Score them by their own scene"
        )
    return gc.ScoreSheet(
        truth.track,
        truth.scene,
        found.method,
        gc.predictions_hash(Path(predictions)),
        gc.sha256(Path(scene) / "truth" / "manifest.json"),
        (*score_images(found, truth), *score_lights(found, truth)),
    )
