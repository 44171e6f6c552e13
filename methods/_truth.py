# SPDX-License-Identifier: Apache-2.0
"""``truth``: the oracle row of each table, what a perfect method scores."""

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from graycard import Camera, Capture, Composition, EnvironmentLight, Light, MethodError, Progress
from graycard.io import sha256, to_builtins
from graycard.layers import LOBES, PARTS
from graycard.lights import light_to_json
from graycard.methods._contract import COMPOSITION, LIGHTS, RELIGHTING, Guest, NoSettings, Priors
from graycard.methods._lookup import Lookup, pack, unpack
from graycard.methods._store import restore, store, whole_decomposition

WITHOUT_TARGET = "counterfactual.radiance"
_SURFACE = (
    "base_color", "diffuse_reflectance", "albedo", "f0", "roughness", "metallic", "glossy", "normal", "depth",
)  # fmt: skip
_LIGHT = ("radiance", "shading", "irradiance.<light>", "radiance.<light>", *LOBES, *PARTS)
_CHANGED = "changed"
"""Prefix of the arrays of :attr:`TrueDecomposition.changed` on disk."""


@dataclass(frozen=True, slots=True)
class TrueDecomposition:
    """The truth behind the contract of a decomposition."""

    known: Lookup
    target: int | None
    """The only object that the truth knows the scene without."""
    changed: Mapping[str, Mapping[str, np.ndarray]] = field(default_factory=dict)
    """Radiance of the held-out views by the digest of the change, then by that of the camera."""

    @property
    def provides(self) -> frozenset[str]:
        """All true layers but those without the target: radiance then comes from :meth:`remove`."""
        return frozenset(name for name in self.known.provides if not name.startswith("counterfactual."))

    def render(self, camera: Camera, layers: Sequence[str]) -> dict[str, np.ndarray]:
        """Return true layers of a camera of the scene.

        Raises:
            MethodError: The camera is none of the scene's, or a layer is not provided.
        """
        return self.known.render(camera, layers)

    def lights(self) -> tuple[Light, ...] | None:
        """Return the exact lights."""
        return self.known.lights()

    def environment(self, light: EnvironmentLight) -> np.ndarray:
        """Return the exact image of an environment.

        Raises:
            MethodError: It is none of the scene's.
        """
        return self.known.environment(light)

    def remove(self, object_id: int) -> Lookup:
        """Return the scene as it was rendered without its target.

        Raises:
            MethodError: The object is not the target: the scene was not rendered without it.
        """
        if object_id != self.target or WITHOUT_TARGET not in self.known.provides:
            raise MethodError(f"expected the target of the scene ({self.target}), got object {object_id}")
        images = {key: {"radiance": known[WITHOUT_TARGET]} for key, known in self.known.images.items()}
        return Lookup(self.known.method, images, self.known.found_lights)

    def relight(self, lights: tuple[Light, ...]) -> Lookup | None:
        """Return the scene as it was rendered under other lights.

        None for lights it was not rendered under.
        """
        return self._after(_digest_of_lights(lights))

    def compose(self, composition: Composition, guest: Guest | None = None) -> Lookup | None:
        """Return the scene as it was rendered with an object put in; None for another object or place."""
        del guest  # what the scene looks like with it is known
        return self._after(_digest(to_builtins(composition)))

    def _after(self, change: str) -> Lookup | None:
        if change not in self.changed:
            return None
        images = {camera: {"radiance": values} for camera, values in self.changed[change].items()}
        return Lookup(self.known.method, images)

    def save(self, folder: Path) -> None:
        """Write as safetensors and JSON.

        Raises:
            OutputError: The folder cannot be written to, or the disk is full.
        """
        facts, arrays = pack(self.known)
        changed = {
            f"{_CHANGED}/{change}/{camera}": values
            for change, images in self.changed.items()
            for camera, values in images.items()
        }
        store(folder, self.known.method, {**facts, "target": self.target}, arrays | changed)


class TruthMethod:
    """Hands back the truth that it is handed: proves the scores, and bounds every table."""

    summary = "The truth itself: what a perfect method scores"
    needs = (*_SURFACE, *_LIGHT, WITHOUT_TARGET, LIGHTS, RELIGHTING, COMPOSITION)
    settings_type = NoSettings

    def fit(
        self, capture: Capture, priors: Priors, settings: NoSettings, seed: int, progress: Progress
    ) -> TrueDecomposition:
        """Keep the truth of every view.

        Raises:
            MethodError: No truth was handed in.
        """
        if priors.source != "oracle":
            raise MethodError(f"expected the truth as an oracle prior, got source {priors.source!r}")
        images = {view.camera.digest: priors.layers[view.name] for view in capture.views}
        known = Lookup("truth", images, priors.lights, priors.environments)
        return TrueDecomposition(known, capture.target, _changed(capture, priors))

    def load(self, folder: Path) -> TrueDecomposition:
        """Return a saved oracle.

        Raises:
            MethodError: It is missing, damaged, or of another method.
        """
        with whole_decomposition(folder):
            return _restored(*restore(folder, "truth"))


def _restored(facts: Mapping[str, Any], arrays: Mapping[str, np.ndarray]) -> TrueDecomposition:
    """Return the oracle that was saved."""
    stored = {name: a for name, a in arrays.items() if name.startswith(f"{_CHANGED}/")}
    known = unpack("truth", facts, {name: a for name, a in arrays.items() if name not in stored})
    changed: dict[str, dict[str, np.ndarray]] = {}
    for name, values in stored.items():
        _, change, camera = name.split("/")
        changed.setdefault(change, {})[camera] = values
    return TrueDecomposition(known, facts["target"], changed)


def _changed(capture: Capture, priors: Priors) -> dict[str, dict[str, np.ndarray]]:
    """Return the true pictures of each change, as :attr:`TrueDecomposition.changed` keeps them."""
    pictures = {_digest_of_lights(relit.lights): relit.radiance for relit in priors.relighting}
    if priors.composition is not None:
        pictures[_digest(to_builtins(priors.composition.composition))] = priors.composition.radiance
    cameras = {view.name: view.camera.digest for view in capture.test}
    return {
        change: {cameras[view]: values for view, values in images.items()}
        for change, images in pictures.items()
    }


def _digest_of_lights(lights: Sequence[Light]) -> str:
    """Return the same for the same lights, wherever the images of environments lie."""
    named = (
        replace(light, image=sha256(Path(light.image))) if isinstance(light, EnvironmentLight) else light
        for light in lights
    )
    return _digest([light_to_json(light) for light in named])


def _digest(data: Any) -> str:
    return hashlib.sha256(json.dumps(data, sort_keys=True).encode()).hexdigest()[:16]
