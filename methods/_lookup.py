# SPDX-License-Identifier: Apache-2.0
"""Decompositions that know images for certain cameras and nothing in between."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from graycard import Camera, Capture, EnvironmentLight, Light, MethodError
from graycard.lights import light_from_json, light_to_json
from graycard.methods._contract import Priors, check_layers
from graycard.methods._store import restore, store, whole_decomposition

_SURROUNDINGS = "environments"


@dataclass(frozen=True, slots=True)
class Lookup:
    """Stored layers by camera: what single-image methods and the oracle give."""

    method: str
    images: Mapping[str, Mapping[str, np.ndarray]]
    """By the digest of the camera, then by layer name."""
    found_lights: tuple[Light, ...] | None = None
    environments: Mapping[str, np.ndarray] = field(default_factory=dict)
    """Images of the environments among the lights, by name."""

    @property
    def provides(self) -> frozenset[str]:
        """Layers that are there for every camera."""
        return frozenset.intersection(*(frozenset(known) for known in self.images.values()))

    def render(self, camera: Camera, layers: Sequence[str]) -> dict[str, np.ndarray]:
        """Return the stored layers of exactly this camera.

        Raises:
            MethodError: The camera is none of the capture's, or a layer is not provided.
        """
        if camera.digest not in self.images:
            raise MethodError(
                f"expected one of the {len(self.images)} cameras of the capture, got another: "
                f"{self.method!r} works on single images and knows no views in between"
            )
        known = self.images[camera.digest]
        check_layers(layers, known)
        return {name: known[name] for name in layers}

    def lights(self) -> tuple[Light, ...] | None:
        """Return the lights that were handed in."""
        return self.found_lights

    def environment(self, light: EnvironmentLight) -> np.ndarray:
        """Return the image of one of :meth:`lights`.

        Raises:
            MethodError: It was not handed in.
        """
        if light.name not in self.environments:
            raise MethodError(f"expected the image of {light.name!r} among {sorted(self.environments)}")
        return self.environments[light.name]

    def save(self, folder: Path) -> None:
        """Write as safetensors and JSON.

        Raises:
            OutputError: The folder cannot be written to, or the disk is full.
        """
        facts, arrays = pack(self)
        store(folder, self.method, facts, arrays)


def pack(lookup: Lookup) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
    """Return the facts and arrays of a lookup, for :func:`graycard.methods._store.store`."""
    arrays = {f"{key}/{name}": a for key, known in lookup.images.items() for name, a in known.items()}
    arrays |= {f"{_SURROUNDINGS}/{name}": image for name, image in lookup.environments.items()}
    lights = None if lookup.found_lights is None else [light_to_json(x) for x in lookup.found_lights]
    return {"lights": lights}, arrays


def unpack(method: str, facts: Mapping[str, Any], arrays: Mapping[str, np.ndarray]) -> Lookup:
    """Return the lookup that was packed."""
    images: dict[str, dict[str, np.ndarray]] = {}
    environments: dict[str, np.ndarray] = {}
    for key, values in arrays.items():
        digest, _, name = key.partition("/")
        known = environments if digest == _SURROUNDINGS else images.setdefault(digest, {})
        known[name] = values
    lights = facts["lights"]
    found = None if lights is None else tuple(light_from_json(x, MethodError, method) for x in lights)
    return Lookup(method, images, found, environments)


def load_lookup(folder: Path, method: str) -> Lookup:
    """Return a lookup that was saved.

    Raises:
        MethodError: It is missing, damaged, or of another method.
    """
    with whole_decomposition(folder):
        return unpack(method, *restore(folder, method))


def photographs(capture: Capture, priors: Priors) -> dict[str, np.ndarray]:
    """Return the linear photograph of every view by the digest of its camera, held-out views included.

    Args:
        capture: Gives the photographs of the training views.
        priors: Hands in ``radiance`` for the held-out views: a single-image method needs the very image.

    Raises:
        MethodError: A held-out photograph was not handed in.
    """
    taken = {view.camera.digest: capture.photograph(view) for view in capture.train}
    return taken | {view.camera.digest: priors.layer(view.name, "radiance") for view in capture.test}
