# SPDX-License-Identifier: Apache-2.0
"""Small pictures of training scenes with the layers that a network is to tell, one file a scene."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from safetensors import safe_open
from safetensors.numpy import load_file, save_file

from graycard import GraycardError
from graycard.benchmarks.training._scenes import training_scene
from graycard.io import Progress, atomic_path, dumps, writable_folder
from graycard.synth import GENERATOR_VERSION, RenderSettings, family_of, scene_name, use_renderer

IN_A_PIXEL = 16
"""Light paths for a pixel: noise that is left is less than what a training adds."""
WHITE = 99
"""Percentile of a scene's pictures that is display white, as in a capture."""
LAYERS = ("image", "depth", "normal", "base_color", "roughness", "metallic")


@dataclass(frozen=True, slots=True)
class ViewSettings:
    """Settings of the views of training scenes.

    Raises:
        ValueError: A number is out of its range.
    """

    size: int = 112
    """Width and height, pixels: those of the suites."""
    views: int = 5
    """Number of views of a scene, along the walk of its family."""

    def __post_init__(self) -> None:
        self.rendering()  # checks both

    def rendering(self) -> RenderSettings:
        """Return the settings of the renderer."""
        return RenderSettings(
            self.size, self.size, self.views - 1, 1, IN_A_PIXEL, relighting=False, composition=False
        )


def scene_file(folder: Path, seed: int) -> Path:
    """Return where the views of a scene are kept."""
    spec = training_scene(seed)
    return folder / f"{scene_name(spec)}.safetensors"


def render_views(
    seeds: Sequence[int], settings: ViewSettings, folder: Path, progress: Progress, threads: int | None = None
) -> list[Path]:
    """Render the views of scenes, those that are there already left out, and return their files.

    Each file holds :data:`LAYERS` of shape ``(V, H, W)`` or ``(V, H, W, 3)`` in float16 and the matrices
    ``K`` ``(V, 3, 3)``: pictures in display range, z-depth in metres (+inf where nothing is), normals in
    camera axes (x right, y down, z forward).

    Raises:
        OutputError: The folder cannot be written to.
    """
    writable_folder(folder)
    files = [scene_file(folder, seed) for seed in seeds]
    stamp = {"generator": str(GENERATOR_VERSION), "settings": dumps(settings)}
    todo = [(seed, file) for seed, file in zip(seeds, files, strict=True) if _stamp_of(file) != stamp]
    if todo:
        use_renderer(threads)
    for number, (seed, file) in enumerate(todo):
        progress(number / len(todo), file.stem)
        with atomic_path(file) as partial:
            save_file(dict(_rendered(seed, settings)), partial, stamp)
    return files


def read_views(seeds: Sequence[int], folder: Path) -> dict[str, dict[str, np.ndarray]]:
    """Return the layers of the views of scenes, by track and name of the scene, as in ``dark/corridor-…``.

    Raises:
        GraycardError: A scene was not rendered.
    """
    found = {}
    for seed in seeds:
        file = scene_file(folder, seed)
        if not file.exists():
            raise GraycardError(f"expected views of seed {seed} in {file}, got none. Render them first")
        found[f"{training_scene(seed).track}/{file.stem}"] = load_file(file)
    return found


def _stamp_of(file: Path) -> Mapping[str, str] | None:
    if not file.exists():
        return None
    with safe_open(file, "numpy") as opened:
        return opened.metadata()


def _rendered(seed: int, settings: ViewSettings) -> Mapping[str, np.ndarray]:
    """Return the views of a scene."""
    from graycard.synth import passes  # Mitsuba: not before its variant is chosen

    rendering = settings.rendering()
    scene = family_of(training_scene(seed)).build(seed, rendering)
    found: dict[str, list[np.ndarray]] = {name: [] for name in (*LAYERS, "K")}
    for number, view in enumerate(scene.views):
        loaded = passes.load_scene(scene, view.camera)
        once = int(np.random.SeedSequence([seed, number]).generate_state(1)[0])
        layers = passes.surface_layers(loaded, scene, view.camera)
        layers["image"] = passes.picture_images(loaded, view.camera, [once], rendering)[0]
        layers["normal"] = layers["normal"] @ view.camera.camera_to_world[:3, :3]
        for name in LAYERS:
            found[name].append(layers[name])
        found["K"].append(view.camera.K)
    stacked = {name: np.stack(values) for name, values in found.items()}
    stacked["image"] /= max(float(np.percentile(stacked["image"], WHITE)), 1e-30)
    halves = {name: np.clip(stacked[name], -60000, 60000) for name in LAYERS if name != "depth"}
    return {
        **{name: np.ascontiguousarray(values.astype(np.float16)) for name, values in halves.items()},
        "depth": stacked["depth"].astype(np.float16),
        "K": stacked["K"].astype(np.float32),
    }
