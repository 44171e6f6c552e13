# SPDX-License-Identifier: Apache-2.0
"""Costs of splitting the light by source, lobe and bounce, beside Mitsuba's own path tracer."""

import resource
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from itertools import product
from statistics import median
from typing import Any

from graycard import Progress
from graycard.io import silent
from graycard.synth import RenderSettings, Scene, SceneSpec, all_families, family_of, use_renderer

SEED = 1000
"""No scene that judges."""

MANY_LIGHTS = ("studio", {"lights": 8})
"""The scene with the most lights to tell apart."""


@dataclass(frozen=True, slots=True)
class TruthCost:
    """Seconds for one view of a scene; medians over the repeats, which take turns."""

    track: str
    family: str
    lights: int
    pixels: int
    samples: int
    path_s: float
    """Mitsuba's ``path``: the radiance and nothing else."""
    separated_s: float
    """Ours, at equal samples: the radiance and each light x {direct, indirect} x {diffuse, specular}."""
    path_cpu_s: float
    separated_cpu_s: float

    @property
    def ratio(self) -> float:
        """Return how much dearer ours is, in wall time."""
        return self.separated_s / self.path_s

    @property
    def cpu_ratio(self) -> float:
        """Return how much dearer ours is, in processor time, which a busy machine disturbs less."""
        return self.separated_cpu_s / self.path_cpu_s


def measure_truth(
    size: int = 128, samples: int = 64, repeats: int = 5, progress: Progress = silent
) -> list[TruthCost]:
    """Return the cost of one view of each family, and of one with eight lamps and the sky.

    Args:
        size: Pixels along each side.
        samples: Light paths a pixel.
        repeats: How often each is timed, after one run that compiles.
        progress: Told about each family.

    Raises:
        RenderError: LLVM, which the separation needs, is not usable here.
    """
    use_renderer(variant="llvm_ad_rgb")
    settings = RenderSettings(size, size, samples=samples)
    wanted: list[tuple[str, Mapping[str, Any]]] = [(name, {}) for name in all_families()]
    wanted += [MANY_LIGHTS] if MANY_LIGHTS[0] in all_families() else []
    costs = []
    for number, (name, knobs) in enumerate(wanted):
        progress(number / len(wanted), name)
        track = all_families()[name].track
        scene = family_of(SceneSpec(track, name, SEED, knobs)).build(SEED, settings)
        path, separated = _timed(scene, settings, repeats)
        seconds = *(t[0] for t in (path, separated)), *(t[1] for t in (path, separated))
        costs.append(TruthCost(track, name, len(scene.lights), size**2, samples, *seconds))
    return costs


def _timed(
    scene: Scene, settings: RenderSettings, repeats: int
) -> tuple[tuple[float, float], tuple[float, float]]:
    """Wall and processor seconds of either tracer."""
    tracers = list(_tracers(scene, settings))
    for tracer in tracers:
        tracer(0)
    times: dict[int, list[tuple[float, float]]] = {0: [], 1: []}
    for seed, which in product(range(1, repeats + 1), (0, 1)):
        times[which].append(_seconds(lambda seed=seed, which=which: tracers[which](seed)))
    path, separated = ([median(column) for column in zip(*times[k], strict=True)] for k in (0, 1))
    return (path[0], path[1]), (separated[0], separated[1])


def _tracers(scene: Scene, settings: RenderSettings) -> Iterator[Callable[[int], object]]:
    """Both take the same four independent images of the middle view."""
    from graycard.synth.passes import load_scene, radiance_images, separated_images

    camera = scene.views[len(scene.views) // 2].camera
    loaded = load_scene(scene, camera)
    for images in (radiance_images, separated_images):
        yield lambda seed, images=images: images(loaded, camera, [4 * seed + k for k in range(4)], settings)


def _seconds(run: Callable[[], object]) -> tuple[float, float]:
    start, used = time.perf_counter(), _processor_s()
    run()
    return time.perf_counter() - start, _processor_s() - used


def _processor_s() -> float:
    used = resource.getrusage(resource.RUSAGE_SELF)
    return used.ru_utime + used.ru_stime
