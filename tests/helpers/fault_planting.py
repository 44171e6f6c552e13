# SPDX-License-Identifier: Apache-2.0
"""Faults to be planted in rendered scenes and found by the check that names them."""

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from graycard import Light, View, open_truth
from graycard.io import (
    from_builtins,
    read_json,
    read_layers,
    read_manifest,
    write_json,
    write_layers,
    write_manifest,
)
from graycard.lights import read_lights, write_lights
from graycard.synth import RenderSettings, SceneSpec, family_of
from graycard.synth.verify import verify_dataset

Layers = dict[str, np.ndarray]
Copied = Callable[[str], Path]
Change = Callable[[Layers, View], None]
Plant = Callable[[Path], None]


@dataclass(frozen=True)
class Fault:
    name: str
    track: str
    check: str
    """Name of the check that must fail."""
    says: str
    """Words that its reason must have."""
    plant: Plant
    views: int = 0
    """That are rendered again; 0 where the files tell."""

    def __str__(self) -> str:
        return self.name

    def must_be_found(self, copied: Copied) -> None:
        """Plant it in a scene of its track, seal the scene as its maker would, and look for it."""
        scene = copied(self.track)
        self.plant(scene)
        reseal(scene)
        found = failures(scene, self.views)
        assert self.check in found, f"expected {self.check!r} to fail, got {list(found)}"
        reasons = found[self.check]
        assert any(self.says in reason for reason in reasons), f"expected {self.says!r}, got {reasons}"


@dataclass(frozen=True)
class Faults:
    """The faults of a module, in the order in which they stand there."""

    known: list[Fault] = field(default_factory=list)

    def in_layers(self, track: str, check: str, says: str, views: int = 0) -> Callable[[Change], Change]:
        """Register a change of the layers of each view as a fault."""

        def register(change: Change) -> Change:
            self._add(change, track, check, says, lambda scene: edit(scene, change), views)
            return change

        return register

    def in_scene(self, track: str, check: str, says: str, views: int = 0) -> Callable[[Plant], Plant]:
        """Register a change of a scene folder as a fault."""

        def register(plant: Plant) -> Plant:
            self._add(plant, track, check, says, plant, views)
            return plant

        return register

    def _add(
        self, made: Callable[..., None], track: str, check: str, says: str, plant: Plant, views: int
    ) -> None:
        self.known.append(Fault(made.__name__, track, check, says, plant, views))


def reseal(scene: Path) -> None:
    """Hash the files as they are now: whoever made the fault believed it."""
    for part in ("capture", "truth"):
        write_manifest(scene / part, read_manifest(scene / part, f"graycard-{part}"))


def edit(scene: Path, change: Change, names: tuple[str, ...] = ()) -> None:
    """Change the layers of all views, or of some."""
    for view in open_truth(scene / "truth", check=False).views:
        if not names or view.name in names:
            path = scene / "truth" / "views" / f"{view.name}.exr"
            layers = read_layers(path)
            change(layers, view)
            write_layers(path, layers)


def edit_lights(scene: Path, change: Callable[[Light], Light]) -> None:
    path = scene / "truth" / "lights.json"
    write_lights(path, tuple(change(light) for light in read_lights(path)))


def edit_index(scene: Path, name: str, **values: object) -> None:
    path = scene / name
    write_json(path, read_json(path) | values)


def edit_manifest(scene: Path, change: Callable[[dict[str, Any]], None]) -> None:
    """Change what the manifest of the truth says of where the scene comes from."""
    path = scene / "truth" / "manifest.json"
    data = read_json(path)
    change(data)
    write_json(path, data)


def swap(layers: Layers, a: str, b: str) -> None:
    layers[a], layers[b] = layers[b], layers[a]


def swap_files(a: Path, b: Path) -> None:
    kept = a.read_bytes()
    a.write_bytes(b.read_bytes())
    b.write_bytes(kept)


def failures(scene: Path, views: int) -> dict[str, list[str]]:
    """All reasons of the failed checks, by the name of the check."""
    verdict = verify_dataset(scene.parents[1], views or 1, render=views > 0)
    found: dict[str, list[str]] = {}
    for check in verdict.checks:
        if check.status == "failed":
            found.setdefault(check.name, []).append(check.reason)
    return found


def settings_of(scene: Path) -> RenderSettings:
    manifest = read_manifest(scene / "truth", "graycard-truth")
    return from_builtins(RenderSettings, manifest.settings["render"])


def render_otherwise(scene: Path, name: str, settings: RenderSettings, seed: int) -> None:
    """Replace a picture by one that is rendered with other settings or another seed."""
    from graycard.synth.layers._separation import estimate
    from graycard.synth.layers._views import radiance_images, sub_buffer_seeds
    from graycard.synth.renderer._mitsuba import load_scene

    manifest = read_manifest(scene / "truth", "graycard-truth")
    spec = SceneSpec(manifest.track, str(manifest.settings["family"]), 1000)
    built = family_of(spec).build(1000, settings)
    numbers = {view.name: number for number, view in enumerate(built.views)}

    def replace_picture(layers: Layers, view: View):
        without = built.target if name.startswith("counterfactual") else ""
        loaded = load_scene(built, view.camera, without=without)
        seeds = sub_buffer_seeds(seed, numbers[view.name])
        layers |= estimate(name, radiance_images(loaded, view.camera, seeds, settings))

    edit(scene, replace_picture)
