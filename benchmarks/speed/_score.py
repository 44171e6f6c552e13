# SPDX-License-Identifier: Apache-2.0
"""What it costs to score a view with all its layers, on one core, in a process of its own."""

import time
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory

from threadpoolctl import threadpool_limits

import graycard as gc
from graycard.benchmarks._fit import FitSpec, fit_scene, peak_memory_mib
from graycard.eval import score_predictions
from graycard.synth import RenderSettings, SceneSpec, families, render_scene

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
    """Median over the repeats, wall time of one core; two training views, for the gauge, are among it."""
    reading_s: float
    """Of that, to read all layers of the three views from disk, true and predicted."""
    peak_mib: float
    """Largest resident memory of the process, Python and its libraries among it."""


def measure_scoring(size: int = 512, repeats: int = 5, progress: gc.Progress = gc.silent) -> list[ScoreCost]:
    """The cost of one view a track; predictions are the truth itself, so that nothing is left out.

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
    track, predictions = families()[family].track, folder / "predictions" / family
    settings = RenderSettings(size, size, train_views=2, test_views=1, samples=4, relighting=False)
    scene = render_scene(SceneSpec(track, family, SEED), settings, folder / "dataset")
    fit_scene(FitSpec("truth", {}, 0, scene), predictions, gc.silent)
    with ProcessPoolExecutor(1, get_context("spawn")) as pool:
        found = pool.submit(_score_often, predictions, scene, repeats).result()
    return ScoreCost(track, family, size**2, *found)


def _score_often(predictions: Path, scene: Path, repeats: int) -> tuple[int, float, float, float]:
    """How many scores, median seconds in all and of reading, and the peak of this process in MiB."""
    with threadpool_limits(1):
        sheet = score_predictions(predictions, scene)
        whole = [_seconds(lambda: score_predictions(predictions, scene)) for _ in range(repeats)]
        peak = peak_memory_mib()
        reading = [_seconds(lambda: _read(predictions, scene)) for _ in range(repeats)]
    scored = sum(score.status == "scored" for score in sheet.scores)
    return scored, median(whole), median(reading), peak


def _read(predictions: Path, scene: Path) -> None:
    truth, predicted = gc.open_truth(scene / "truth", check=False), gc.open_predictions(predictions)
    for view in truth.views:
        truth.layers(view)
        predicted.layers(view.name)


def _seconds(run: Callable[[], object]) -> float:
    start = time.perf_counter()
    run()
    return time.perf_counter() - start
