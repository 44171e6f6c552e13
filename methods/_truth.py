# SPDX-License-Identifier: Apache-2.0
"""``truth``: the oracle row of each table, what a perfect method scores."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from graycard import PARTS, Camera, Capture, EnvironmentLight, Light, MethodError, Progress
from graycard.methods._contract import NoSettings, Priors
from graycard.methods._lookup import Lookup, pack, unpack
from graycard.methods._store import restore, store

WITHOUT_TARGET = "counterfactual.radiance"
_SURFACE = ("base_color", "diffuse_reflectance", "albedo", "roughness", "metallic", "normal", "depth")
_LIGHT = ("radiance", "shading", "irradiance.<light>", "radiance.<light>", *PARTS)


@dataclass(frozen=True, slots=True)
class Oracle:
    """The truth behind the contract of a decomposition."""

    known: Lookup
    target: int | None
    """The only object that the truth knows the scene without."""

    @property
    def provides(self) -> frozenset[str]:
        """All true layers but the counterfactual, which comes from :meth:`remove`."""
        return self.known.provides - {WITHOUT_TARGET}

    def render(self, camera: Camera, layers: Sequence[str]) -> dict[str, np.ndarray]:
        """True layers of a camera of the scene.

        Raises:
            MethodError: The camera is none of the scene's, or a layer is not provided.
        """
        return self.known.render(camera, layers)

    def lights(self) -> tuple[Light, ...] | None:
        """The exact lights."""
        return self.known.lights()

    def environment(self, light: EnvironmentLight) -> np.ndarray:
        """The exact image of an environment.

        Raises:
            MethodError: It is none of the scene's.
        """
        return self.known.environment(light)

    def remove(self, object_id: int) -> Lookup:
        """The scene as it was rendered without its target.

        Raises:
            MethodError: The object is not the target: the scene was not rendered without it.
        """
        if object_id != self.target or WITHOUT_TARGET not in self.known.provides:
            raise MethodError(f"expected the target of the scene ({self.target}), got object {object_id}")
        images = {key: {"radiance": known[WITHOUT_TARGET]} for key, known in self.known.images.items()}
        return Lookup(self.known.method, images, self.known.found_lights)

    def save(self, folder: Path) -> None:
        """Write as safetensors and JSON.

        Raises:
            OutputError: The folder cannot be written to, or the disk is full.
        """
        facts, arrays = pack(self.known)
        store(folder, self.known.method, {**facts, "target": self.target}, arrays)


class TruthMethod:
    """Hands back the truth that it is handed: proves the scores, and bounds every table."""

    summary = "The truth itself: what a perfect method scores"
    needs = (*_SURFACE, *_LIGHT, WITHOUT_TARGET, "lights")
    settings_type = NoSettings

    def fit(
        self, capture: Capture, priors: Priors, settings: NoSettings, seed: int, progress: Progress
    ) -> Oracle:
        """Keep the truth of every view.

        Raises:
            MethodError: No truth was handed in.
        """
        if priors.source != "oracle":
            raise MethodError(f"expected the truth as an oracle prior, got source {priors.source!r}")
        images = {view.camera.digest: priors.layers[view.name] for view in capture.views}
        known = Lookup("truth", images, priors.lights, priors.environments)
        return Oracle(known, capture.target)

    def load(self, folder: Path) -> Oracle:
        """A saved oracle.

        Raises:
            MethodError: It is missing, damaged, or of another method.
        """
        facts, arrays = restore(folder, "truth")
        return Oracle(unpack("truth", facts, arrays), facts["target"])
