# SPDX-License-Identifier: Apache-2.0
"""Radiance-only surfels with an object, and without it."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Self

import numpy as np

from graycard import Camera, Light, MethodError
from graycard.methods._contract import Decomposition
from graycard.methods.splat import Parameters, arrays_of, parameters_from
from graycard.methods.surfels import SavedScene, SceneContents, SurfelScene, export_colours

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
        """Return the scene without the object.

        Raises:
            MethodError: It is another object than the one that the capture names.
        """
        if object_id != self.target:
            raise MethodError(f"expected the object that was fitted ({self.target}), got {object_id}")
        return self.after

    def lights(self) -> tuple[Light, ...] | None:
        """None: it looks for none."""
        return None

    def _scenes(self) -> tuple[Decomposition, ...]:
        return self.before, self.after, self.remove(self.target)


@dataclass(frozen=True, eq=False)
class RemovalScene(Emptied, SavedScene):
    """Radiance-only surfels with the object, and without it."""

    before: SurfelScene
    after: SurfelScene

    def _contents(self) -> SceneContents:
        facts = {"exposure": self.before.exposure, "target": self.target}
        arrays = _named(self.before.parameters, _BEFORE) | _named(self.after.parameters, _AFTER)
        return SceneContents(self.before.method, facts, arrays)

    @classmethod
    def _restored(cls, saved: SceneContents, folder: Path) -> Self:
        exposure = float(saved.facts["exposure"])
        before, after = (
            SurfelScene(parameters_from(_part(saved.arrays, part)), saved.method, exposure)
            for part in (_BEFORE, _AFTER)
        )
        return cls(before, after, int(saved.facts["target"]))

    def _export(self, path: Path) -> None:
        """Write the surfels that are left."""
        export_colours(path, self.after.parameters)


def _named(parameters: Parameters, part: str) -> dict[str, np.ndarray]:
    return {part + name: values for name, values in arrays_of(parameters).items()}


def _part(arrays: dict[str, np.ndarray], part: str) -> dict[str, np.ndarray]:
    return {name.removeprefix(part): values for name, values in arrays.items() if name.startswith(part)}
