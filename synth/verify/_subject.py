# SPDX-License-Identifier: Apache-2.0
"""Subject of verification: a scene as its files say, and as its spec says that it must be."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from graycard import (
    Camera,
    Capture,
    EnvironmentLight,
    GraycardError,
    Light,
    Truth,
    View,
    open_capture,
    open_truth,
)
from graycard.dataset import manifest_of
from graycard.io import Manifest, from_builtins, read_rgb
from graycard.synth._scene import Scene
from graycard.synth._spec import GENERATOR_VERSION, RenderSettings, SceneSpec
from graycard.synth.families import family_of
from graycard.synth.renderer._variant import LLVM_RGB
from graycard.synth.verify._check import At

Layers = Mapping[str, np.ndarray]


@dataclass(frozen=True)
class TruePicture:
    """The true layers of one view."""

    at: At
    number: int
    view: View
    layers: Layers
    is_split: bool
    """True where its light is told apart by source and lobe."""

    @property
    def camera(self) -> Camera:
        """The camera of the view."""
        return self.view.camera

    @cached_property
    def seen(self) -> np.ndarray:
        """Return where an object is seen, shape ``(H, W)``, bool."""
        return self.layers["object_id"] > 0

    @cached_property
    def rays(self) -> np.ndarray:
        """World directions through the pixel centres, shape ``(H, W, 3)``."""
        return self.camera.rays()

    def has(self, *names: str) -> bool:
        """Return whether the view holds all of these layers."""
        return all(name in self.layers for name in names)


@dataclass(frozen=True)
class Rebuilt:
    """The scene that a dataset's spec describes, built anew."""

    spec: SceneSpec
    settings: RenderSettings
    scene: Scene


@dataclass(frozen=True)
class Subject:
    """A scene on disk whose files are whole."""

    at: At
    folder: Path
    capture: Capture
    truth: Truth
    manifest: Manifest
    lights: tuple[Light, ...]
    sky: np.ndarray | None
    """``environment.exr``, shape ``(H, W, 3)``; None where there is none."""

    @property
    def is_separated(self) -> bool:
        """Return whether the renderer was one that tells the parts of the light apart."""
        return self.manifest.generator.get("variant") == LLVM_RGB

    def is_split(self, view: View) -> bool:
        """Tell whether a view holds the parts of its light; a training view may be made without."""
        return self.is_separated and not self.is_reduced(view)

    def is_reduced(self, view: View) -> bool:
        """Tell whether a view is a training view that holds no more than is needed of it."""
        render = self.manifest.settings.get("render")
        asked = render.get("training_layers") if isinstance(render, Mapping) else None
        return view.split == "train" and asked == "needed"

    def pictures(self) -> Iterator[TruePicture]:
        """Yield the views one after another, so that one at a time is in memory."""
        for number in range(len(self.truth.views)):
            yield self.picture(number)

    def picture(self, number: int) -> TruePicture:
        """Return the true layers of a view."""
        view = self.truth.views[number]
        at = At(self.at.scene, view.name)
        layers = self.truth.layers(view, derive=self.is_reduced(view))
        return TruePicture(at, number, view, layers, self.is_split(view))


def open_subject(folder: Path) -> Subject:
    """Return the scene in a folder; its files have been compared with their hashes before.

    Raises:
        GraycardError: A file of it cannot be read.
    """
    truth = open_truth(folder / "truth", check=False)
    lights = truth.lights()
    images = [light.image for light in lights if isinstance(light, EnvironmentLight)]
    sky = read_rgb(folder / "truth" / images[0]) if images else None
    return Subject(
        At(f"{folder.parent.name}/{folder.name}"),
        folder,
        open_capture(folder / "capture", check=False),
        truth,
        manifest_of(truth),
        lights,
        sky,
    )


def rebuild(manifest: Manifest) -> Rebuilt | str:
    """Return the scene that a truth's manifest describes, or why it cannot be built."""
    made_by = manifest.generator.get("generator")
    if made_by != GENERATOR_VERSION:
        return f"the scene is of generator {made_by}, this graycard has generator {GENERATOR_VERSION}"
    try:
        settings = from_builtins(RenderSettings, manifest.settings["render"], source="the render settings")
        spec = _spec_of(manifest)
        return Rebuilt(spec, settings, family_of(spec).build(spec.seed, settings))
    except (GraycardError, KeyError, TypeError, ValueError) as cause:
        return f"its spec cannot be built here: {cause}"


def _spec_of(manifest: Manifest) -> SceneSpec:
    settings: Mapping[str, Any] = manifest.settings
    return SceneSpec(manifest.track, settings["family"], manifest.seeds["scene"], dict(settings["knobs"]))
