# SPDX-License-Identifier: Apache-2.0
"""Measure a step of the second stages by the size of pictures, and its parts."""

import statistics
import time
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, fields
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from skimage.transform import resize
from threadpoolctl import threadpool_limits

from graycard import Camera, Capture, Points, Progress, Truth, View, open_capture, open_truth
from graycard.benchmarks.speed._machine import threads
from graycard.io import silent
from graycard.layers import with_derived
from graycard.methods import Method, Priors, asks_of, load_method, seed_everything, settings_of
from graycard.methods.priors import PriorSpec, make_priors, truth_of
from graycard.synth import RenderSettings, SceneSpec, all_families, render_scene

SEED = 1000
"""No scene that judges."""
SIZES = (112, 256)
RENDERED = 64
"""Pixels along the sides of what is rendered, and then enlarged: what pictures show does not matter here."""
SURFELS = 5000
PRIORS = PriorSpec("oracle", 2)
WARM, PROFILED = 3, 5
"""Steps of the second stage before any is timed, and those that are looked at by PyTorch's profiler."""


@dataclass(frozen=True, slots=True)
class StagedMethod:
    """A method with a second stage."""

    name: str
    family: str
    settings: Mapping[str, Any]
    """Settings that leave out what interrupts the second stage."""


METHODS = (
    StagedMethod("gsid", "studio", {"aggregate_every": 1.0}),
    StagedMethod("goris", "glossy-table", {"first_light": False}),
)
PARTS: Mapping[str, tuple[str, ...]] = {
    "drawing": ("_Draw",),
    "tracing": ("_Trace",),
    "lamps": ("_Lit",),
    "skies": ("_Seen", "aten::mm"),
    "losses": ("_Compare", "_Mismatch", "_Normals", "_Over", "_Colours"),
    "blur": ("aten::convolution", "aten::mkldnn", "aten::_slow_conv", "aten::replication", "aten::upsample"),
}
"""Beginnings of what the profiler calls them. All else is arithmetic of PyTorch, pixel by pixel. It does not
see Adam, whose kernel is called without it."""
REST = "PyTorch"


@dataclass(frozen=True, slots=True)
class StageCost:
    """A step of a second stage at one size of pictures, on one core."""

    method: str
    size: int
    """Pixels along each side."""
    steps: int
    """Number of steps that were timed."""
    ms: float
    """CPU time of a step, median; other programs hardly change it."""
    least_ms: float
    parts: Mapping[str, float]
    """Shares of what PyTorch's profiler sees: those of :data:`PARTS` and :data:`REST`."""


def measure_second_stages(
    sizes: Sequence[int] = SIZES, steps: int = 40, surfels: int = SURFELS, progress: Progress = silent
) -> list[StageCost]:
    """Fit until the second stage has done so many steps, at each size.

    Args:
        sizes: Pixels along each side.
        steps: How many are timed.
        surfels: How many there may be.
        progress: Told about each method and size.

    Raises:
        RenderError: The renderer is not usable here.
    """
    cases = [(method, size) for method in METHODS for size in sizes]
    costs = []
    with TemporaryDirectory() as folder, threads(1), threadpool_limits(1):
        for number, (method, size) in enumerate(cases):
            progress(number / len(cases), f"{method.name}, {size} x {size}")
            costs.append(_cost(method, size, steps, surfels, Path(folder)))
    return costs


def growth(costs: Sequence[StageCost]) -> dict[str, float]:
    """Return the time of a step with the largest pictures over that with the smallest, by method."""
    found = {}
    for name in dict.fromkeys(cost.method for cost in costs):
        by_size = {cost.size: cost.ms for cost in costs if cost.method == name}
        found[name] = by_size[max(by_size)] / by_size[min(by_size)]
    return found


def _cost(staged: StagedMethod, size: int, steps: int, surfels: int, folder: Path) -> StageCost:
    scene = _rendered(staged.family, folder)
    method = load_method(staged.name)
    capture, priors = _enlarged(method, scene, size)
    budget = 3 * (WARM + PROFILED + steps)  # about a half of it, and more, is the second stage
    settings = settings_of(method, {**staged.settings, "iterations": budget, "surfels": surfels})
    seed_everything(0)
    clock = _Clock(steps)
    with suppress(_EnoughError):
        method.fit(capture, priors, settings, 0, clock)
    times = [1e3 * spent for spent in clock.spent]
    return StageCost(staged.name, size, len(times), statistics.median(times), min(times), clock.parts())


def _rendered(family: str, folder: Path) -> Path:
    """Return a scene, rendered unless it is there."""
    track = all_families()[family].track
    settings = RenderSettings(RENDERED, RENDERED, train_views=6, test_views=1, samples=4, relighting=False)
    found = [path for path in (folder / track).glob("*") if path.name.startswith(family)]
    return found[0] if found else render_scene(SceneSpec(track, family, SEED), settings, folder)


class _EnoughError(Exception):
    """Leaves a fit that has done all the steps that are timed."""


@dataclass
class _Clock:
    """A fit's progress, told before each step: takes the time of those of the second series of steps."""

    steps: int
    spent: list[float] = field(default_factory=list)
    """Seconds of processor time a step."""
    _share: float = 2.0
    _series: int = 0
    _step: int = 0
    _before: float = 0.0
    _profile: Any = None

    def __call__(self, share: float, doing: str, /) -> None:
        """Take the time if a step begins."""
        now = time.process_time()
        if not doing.startswith("fitting"):
            return
        if share <= self._share:
            self._series, self._step = self._series + 1, 0
        self._share, self._step = share, self._step + 1
        if self._series == 2:
            self._second(now)
        self._before = time.process_time()

    def _second(self, now: float) -> None:
        """Before a step of the second stage."""
        if self._step == WARM:
            self._profile = _profiler()
            self._profile.start()
        elif self._step == WARM + PROFILED:
            self._profile.stop()
        elif self._step > WARM + PROFILED:
            self.spent.append(now - self._before)
        if len(self.spent) == self.steps:
            raise _EnoughError

    def parts(self) -> dict[str, float]:
        """Shares of parts in what the profiler saw."""
        spent = dict.fromkeys([*PARTS, REST], 0.0)
        for event in self._profile.key_averages():
            name = next((part for part, begins in PARTS.items() if event.key.startswith(begins)), REST)
            spent[name] += event.self_cpu_time_total
        total = sum(spent.values())
        return {name: found / total for name, found in spent.items()}


def _profiler() -> Any:
    from torch.profiler import ProfilerActivity, profile

    return profile(activities=[ProfilerActivity.CPU])


@dataclass(frozen=True, slots=True)
class _EnlargedCapture(Capture):
    """A capture whose pictures have another size."""

    small: Capture = field(kw_only=True)

    def photograph(self, view: View) -> np.ndarray:
        size = view.camera.height, view.camera.width, 3
        small = self.small.photograph(self.small.view(view.name))
        return np.asarray(resize(small, size, order=1), np.float32)

    def target_mask(self, view: View) -> np.ndarray:
        return _nearest(self.small.target_mask(self.small.view(view.name)), view.camera.width)

    def points(self) -> Points:
        return self.small.points()


def _enlarged(method: Method, scene: Path, size: int) -> tuple[Capture, Priors]:
    """Return a square scene's capture, and the priors' answers, with pictures of so many pixels a side."""
    small = open_capture(scene / "capture")
    views = tuple(View(view.name, view.split, _scaled(view.camera, size)) for view in small.views)
    same = {part.name: getattr(small, part.name) for part in fields(Capture)}
    capture = _EnlargedCapture(**{**same, "views": views}, small=small)
    asks = asks_of(method)
    truth, told = open_truth(scene / "truth"), truth_of(PRIORS, asks)
    layers = {view.name: _true_layers(truth, view.name, told, size) for view in views}
    return capture, make_priors(PRIORS, asks, capture, layers)


def _true_layers(truth: Truth, view: str, told: frozenset[str], size: int) -> dict[str, np.ndarray]:
    layers = with_derived(truth.layers(truth.view(view)))
    return {name: _nearest(layer, size) for name, layer in layers.items() if name in told}


def _scaled(camera: Camera, size: int) -> Camera:
    share = size / camera.width
    return Camera(size, size, np.diag([share, share, 1.0]) @ camera.K, camera.camera_to_world)


def _nearest(image: np.ndarray, size: int) -> np.ndarray:
    places = (np.arange(size) + 0.5) * len(image) / size
    return image[np.ix_(places.astype(int), places.astype(int))]
