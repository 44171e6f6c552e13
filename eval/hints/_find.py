# SPDX-License-Identifier: Apache-2.0
"""Find hints without scores: about every view that has a prediction, as when outputs were just adopted."""

from collections.abc import Iterator
from pathlib import Path

from graycard import open_capture, open_predictions, open_truth
from graycard.dataset import HELD_OUT, has_truth, open_held_out
from graycard.eval.hints._hints import Hint, Hints
from graycard.eval.scoring._findings import SceneFacts
from graycard.eval.scoring._readings import TrueView, photographed, read_prediction, read_truth
from graycard.eval.scoring._training import Training


def find_hints(predictions: Path, scene: Path) -> list[Hint]:
    """Return the mistakes that a predictions folder looks like.

    Training views are looked at, too, as what exchanges views may put one in the place of the other. Without
    truth, light alone is looked at, in the photographs.

    Args:
        predictions: The predictions folder.
        scene: ``DATASET/<track>/<scene>``; its files are not compared with their hashes.

    Raises:
        PredictionError: The folder has no index.
        DatasetError: The scene is missing or broken.
    """
    found, hints = open_predictions(predictions), Hints()
    known = set(found.view_names())
    exposure = open_capture(scene / "capture", check=False).exposure
    facts = SceneFacts(exposure, Training(frozenset(), (), {}))
    for true in _seen(scene):
        if true.view.name in known:
            hints.observe(read_prediction(found, true.view), true, facts)
    return hints.of_layers()


def _seen(scene: Path) -> Iterator[TrueView]:
    """Yield the truth of every view; of an imported capture its photographs, of which every pixel counts."""
    if has_truth(scene):
        truth = open_truth(scene / "truth", check=False)
        yield from (read_truth(truth, view) for view in truth.views)
        return
    capture = open_capture(scene / "capture", check=False)
    for view in capture.train:
        yield photographed(view, capture.photograph(view))
    if (scene / HELD_OUT).is_dir():
        held = open_held_out(scene, check=False)
        for view in held.views:
            yield photographed(view, held.photograph(view))
