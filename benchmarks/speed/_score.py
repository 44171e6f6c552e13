# SPDX-License-Identifier: Apache-2.0
"""What it costs to score a view with all its layers, on one core, in a process of its own."""

import resource
import time
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory

from threadpoolctl import threadpool_limits

import graycard as gc
from graycard.benchmarks._fit import FitSpec, fit_scene
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
        scores, seconds, peak = pool.submit(_score_often, predictions, scene, repeats).result()
    return ScoreCost(track, family, size**2, scores, seconds, peak)


def _score_often(predictions: Path, scene: Path, repeats: int) -> tuple[int, float, float]:
    """How many scores, median seconds, and the peak of this process in MiB."""
    times, scored = [], 0
    with threadpool_limits(1):
        for _ in range(repeats + 1):
            start = time.perf_counter()
            sheet = score_predictions(predictions, scene)
            times.append(time.perf_counter() - start)
            scored = sum(score.status == "scored" for score in sheet.scores)
    return scored, median(times[1:]), resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
