# SPDX-License-Identifier: Apache-2.0
"""The decomposition of ``appearance``: the surfels of ``2dgs``, as the nearest photograph has them."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch

from graycard import Camera, Light
from graycard.methods._contract import check_layers
from graycard.methods._store import restore, store
from graycard.methods.appearance._nearest import Eyes
from graycard.methods.appearance._tone import toned
from graycard.methods.splat import Parameters, arrays_of, parameters_from
from graycard.methods.surfels import LAYERS, all_colours, coloured_layers, export_colours

METHOD = "appearance"


@dataclass(frozen=True, eq=False)
class AppearanceScene:
    """Surfels whose colours are those of one of the photographs."""

    parameters: Parameters
    eyes: Eyes
    exposure: float
    """Factor from radiance to the range of the colours, 1/(W/m²/sr)."""

    @property
    def provides(self) -> frozenset[str]:
        """Radiance, normal and depth."""
        return LAYERS

    @torch.no_grad()
    def render(self, camera: Camera, layers: Sequence[str]) -> dict[str, np.ndarray]:
        """Layers as any camera sees them, in the appearance of the photograph from nearest to it.

        Raises:
            MethodError: A layer is not provided.
        """
        check_layers(layers, self.provides)
        values = self.parameters.all
        seen = toned(values, all_colours(values, camera), self.eyes.nearest(camera))
        images = coloured_layers(values, seen, camera, self.exposure)
        return {name: images[name] for name in layers}

    def lights(self) -> tuple[Light, ...] | None:
        """None: it looks for none."""
        return None

    def save(self, folder: Path) -> None:
        """Write as safetensors and JSON, and the colours before any photograph's change as a PLY.

        Raises:
            OutputError: The folder cannot be written to, or the disk is full.
        """
        eyes = {"eyes/positions": self.eyes.positions, "eyes/directions": self.eyes.directions}
        facts = {"exposure": self.exposure, "extent": self.eyes.extent}
        store(folder, METHOD, facts, arrays_of(self.parameters) | eyes)
        export_colours(folder, self.parameters)


def load_scene(folder: Path) -> AppearanceScene:
    """A scene that was saved.

    Raises:
        MethodError: It is missing, damaged, or of another method.
    """
    facts, arrays = restore(folder, METHOD)
    places, directions = arrays.pop("eyes/positions"), arrays.pop("eyes/directions")
    eyes = Eyes(places, directions, float(facts["extent"]))
    return AppearanceScene(parameters_from(arrays), eyes, float(facts["exposure"]))
