# SPDX-License-Identifier: Apache-2.0
"""The decomposition of ``appearance``: the surfels of ``2dgs``, as the nearest photograph has them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Self

import numpy as np

from graycard import Camera, Light
from graycard.methods.appearance._nearest import Eyes
from graycard.methods.appearance._tone import toned
from graycard.methods.splat import arrays_of, parameters_from
from graycard.methods.surfels import (
    LAYERS,
    LayeredScene,
    SceneContents,
    all_colours,
    coloured_layers,
    export_colours,
)

METHOD = "appearance"


@dataclass(frozen=True, eq=False)
class AppearanceScene(LayeredScene):
    """Surfels whose colours are those of the photograph from nearest to the camera."""

    eyes: Eyes
    exposure: float
    """Factor from radiance to the range of the colours, 1/(W/m²/sr)."""

    @property
    def provides(self) -> frozenset[str]:
        """Radiance, normal and depth."""
        return LAYERS

    def _images(self, camera: Camera, layers: Sequence[str]) -> Mapping[str, np.ndarray]:
        values = self.parameters.all
        seen = toned(values, all_colours(values, camera), self.eyes.nearest(camera))
        return coloured_layers(values, seen, camera, self.exposure)

    def lights(self) -> tuple[Light, ...] | None:
        """None: it looks for none."""
        return None

    def _contents(self) -> SceneContents:
        eyes = {"eyes/positions": self.eyes.positions, "eyes/directions": self.eyes.directions}
        facts = {"exposure": self.exposure, "extent": self.eyes.extent}
        return SceneContents(METHOD, facts, arrays_of(self.parameters) | eyes)

    @classmethod
    def _restored(cls, saved: SceneContents, folder: Path) -> Self:
        facts, arrays = saved.facts, dict(saved.arrays)
        places, directions = arrays.pop("eyes/positions"), arrays.pop("eyes/directions")
        eyes = Eyes(places, directions, float(facts["extent"]))
        return cls(parameters_from(arrays), eyes, float(facts["exposure"]))

    def _export(self, path: Path) -> None:
        """Write the colours before any photograph's change."""
        export_colours(path, self.parameters)
