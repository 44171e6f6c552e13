# SPDX-License-Identifier: Apache-2.0
"""Cost of scoring a view with all its layers, on one core, in a process of its own."""

import time
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from multiprocessing import get_context
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from threadpoolctl import threadpool_limits

from graycard import Predictions, Progress, Truth, open_predictions, open_truth
from graycard.benchmarks._fit import FitSpec, fit_scene
from graycard.eval import score_predictions, scores_of
from graycard.io import keep_freed_memory, peak_memory_mib, sha256, silent
from graycard.synth import RenderSettings, SceneSpec, all_families, render_scene

SEED = 1000
"""No scene that judges."""
FAMILIES = ("corridor", "glossy-table", "studio")
"""One a track: with a lamp on the camera, with a removal, and with many lights."""


@dataclass(frozen=True, slots=True)
class ScoreCost:
    """One held-out view of a scene, as ``graycard score`` judges it; files are read and hashed too."""

    track: str
    family: str
    pixels: int
    scores: int
    """Numbers that came out."""
    seconds: float
    """CPU time of the whole sheet on one core, waiting for the disk left out. Here and below it is the least
    of the repeats, as other programs only add to it."""
    view_s: float
    """CPU time that one more held-out view adds to a sheet, from its files to its scores. The rest is once a
    scene: lights, environments, and the two training views, which the gauge is fitted to."""
    reading_s: float
    """The part of it that reads all layers of the view, true and predicted."""
    peak_mib: float
    """Largest resident memory of the process, Python and its libraries among it."""


def measure_scoring(size: int = 512, repeats: int = 5, progress: Progress = silent) -> list[ScoreCost]:
    """Return the cost of one view a track; predictions are the truth itself, so that nothing is left out.

    Pictures under changed lights are left out: there are several of them to a view.

    Args:
        size: Pixels along each side.
        repeats: How often each is timed, after one run that warms up.
        progress: Told about each family.

    Raises:
        RenderError: The renderer is not usable here.
    """
    costs = []
    with TemporaryDirectory() as folder:
        for number, family in enumerate(FAMILIES):
            progress(number / len(FAMILIES), family)
            costs.append(_cost(family, size, repeats, Path(folder)))
    return costs


def _cost(family: str, size: int, repeats: int, folder: Path) -> ScoreCost:
    track, predictions = all_families()[family].track, folder / "predictions" / family
    settings = RenderSettings(size, size, train_views=2, test_views=1, samples=4, relighting=False)
    scene = render_scene(SceneSpec(track, family, SEED), settings, folder / "dataset")
    fit_scene(FitSpec("truth", {}, 0, scene), predictions, silent)
    with ProcessPoolExecutor(1, get_context("spawn")) as pool:
        found = pool.submit(_score_often, predictions, scene, repeats).result()
    return ScoreCost(track, family, size**2, *found)


def _score_often(predictions: Path, scene: Path, repeats: int) -> tuple[int, float, float, float, float]:
    """Count of scores; least seconds in all, of the view, of reading it; the peak of this process in MiB."""
    keep_freed_memory()
    truth = open_truth(scene / "truth", check=False)
    predicted, _ = open_predictions(predictions).hashed()
    tests = [view for view in truth.views if view.split == "test"]
    again = replace(truth, views=(*truth.views, *tests))
    files = [folder / "views" / f"{v.name}.exr" for v in tests for folder in (scene / "truth", predictions)]
    parts: tuple[Callable[[], object], ...] = (
        lambda: score_predictions(predictions, scene),
        lambda: scores_of(predicted, truth),
        lambda: scores_of(predicted, again),
        lambda: [sha256(path) for path in files],
        lambda: _read(predicted, truth),
    )
    with threadpool_limits(1):
        sheet = score_predictions(predictions, scene)
        times = [[_seconds(part) for part in parts] for _ in range(repeats)]
    whole, once, twice, hashing, reading = np.min(times, axis=0).tolist()
    scored = sum(score.status == "scored" for score in sheet.scores)
    return scored, whole, twice - once + hashing, reading, peak_memory_mib()


def _read(predictions: Predictions, truth: Truth) -> None:
    for view in (v for v in truth.views if v.split == "test"):
        truth.layers(view)
        predictions.layers(view.name)


def _seconds(run: Callable[[], object]) -> float:
    """Return the CPU time of a call in this process, which other processes hardly change."""
    start = time.process_time()
    run()
    return time.process_time() - start
