# SPDX-License-Identifier: Apache-2.0
"""Radiance-only surfels with an object, and without it."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from graycard import Camera, Light, MethodError
from graycard.methods._contract import Decomposition
from graycard.methods._store import restore, store
from graycard.methods.splat import Parameters, arrays_of, parameters_from
from graycard.methods.surfels import SurfelScene, export_colours

_BEFORE, _AFTER = "before/", "after/"


@dataclass(frozen=True, eq=False)
class Emptied:
    """The scene as it was photographed, and as it is without the object that its capture names."""

    before: Decomposition
    after: Decomposition
    target: int
    """Id of the object."""

    @property
    def provides(self) -> frozenset[str]:
        """The layers with the object."""
        return self.before.provides

    def render(self, camera: Camera, layers: Sequence[str]) -> dict[str, np.ndarray]:
        """Layers with the object as any camera sees them.

        Raises:
            MethodError: A layer is not provided.
        """
        return self.before.render(camera, layers)

    def remove(self, object_id: int) -> Decomposition:
        """The scene without the object.

        Raises:
            MethodError: It is another object than the one that the capture names.
        """
        if object_id != self.target:
            raise MethodError(f"expected the object that was fitted ({self.target}), got {object_id}")
        return self.after

    def lights(self) -> tuple[Light, ...] | None:
        """None: it looks for none."""
        return None


@dataclass(frozen=True, eq=False)
class RemovalScene(Emptied):
    """Radiance-only surfels with the object, and without it."""

    before: SurfelScene
    after: SurfelScene

    def save(self, folder: Path) -> None:
        """Write as safetensors and JSON, and what is left as a PLY that viewers of Gaussian splats read.

        Raises:
            OutputError: The folder cannot be written to, or the disk is full.
        """
        facts = {"exposure": self.before.exposure, "target": self.target}
        arrays = _named(self.before.parameters, _BEFORE) | _named(self.after.parameters, _AFTER)
        store(folder, self.before.method, facts, arrays)
        export_colours(folder, self.after.parameters)


def load_scene(folder: Path, method: str) -> RemovalScene:
    """A scene that was saved.

    Raises:
        MethodError: It is missing, damaged, or of another method.
    """
    facts, arrays = restore(folder, method)
    exposure = float(facts["exposure"])
    before, after = (
        SurfelScene(method, parameters_from(_part(arrays, part)), exposure) for part in (_BEFORE, _AFTER)
    )
    return RemovalScene(before, after, int(facts["target"]))


def _named(parameters: Parameters, part: str) -> dict[str, np.ndarray]:
    return {part + name: values for name, values in arrays_of(parameters).items()}


def _part(arrays: dict[str, np.ndarray], part: str) -> dict[str, np.ndarray]:
    return {name.removeprefix(part): values for name, values in arrays.items() if name.startswith(part)}
