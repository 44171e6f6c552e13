# SPDX-License-Identifier: Apache-2.0
"""The decomposition of ``2dgs``: surfels that can be drawn from anywhere."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Self

import numpy as np
import torch

from graycard import Camera, Light
from graycard.methods.splat import (
    GaussianMaps,
    Maps,
    Parameters,
    arrays_of,
    coefficient_count,
    export_harmonics_ply,
    parameters_from,
    rasterize,
    surfels_of,
)
from graycard.methods.surfels._colour import srgb_decode_tensor
from graycard.methods.surfels._compose import composed
from graycard.methods.surfels._layered_scene import LayeredScene, SceneContents
from graycard.methods.surfels._objective import colours, sky_basis
from graycard.methods.surfels._start import COEFFICIENTS, DETAIL, SKY

LAYERS = frozenset({"radiance", "normal", "depth"})
"""Layers of coloured surfels."""
SEEN = 0.5
"""Share of a pixel that surfels must cover for it to have a depth."""


@dataclass(frozen=True, eq=False)
class SurfelScene(LayeredScene):
    """Surfels with the harmonics of their colours, and a sky behind them."""

    method: str
    """Name of the method that made it."""
    exposure: float
    """Factor from radiance to the range of the colours, 1/(W/m²/sr)."""

    @property
    def provides(self) -> frozenset[str]:
        """Radiance, normal and depth."""
        return LAYERS

    def _images(self, camera: Camera, layers: Sequence[str]) -> Mapping[str, np.ndarray]:
        values = self.parameters.all
        return coloured_layers(values, all_colours(values, camera), camera, self.exposure)

    def lights(self) -> tuple[Light, ...] | None:
        """None: it looks for none."""
        return None

    def _contents(self) -> SceneContents:
        return SceneContents(self.method, {"exposure": self.exposure}, arrays_of(self.parameters))

    @classmethod
    def _restored(cls, saved: SceneContents, folder: Path) -> Self:
        return cls(parameters_from(saved.arrays), saved.method, float(saved.facts["exposure"]))

    def _export(self, path: Path) -> None:
        export_colours(path, self.parameters)


def all_colours(values: Mapping[str, torch.Tensor], camera: Camera) -> torch.Tensor:
    """Return encoded colours of the surfels as a camera sees them, with all their harmonics, shape ``(N,
    3)``.
    """
    return colours(values, camera.position, _degree(values[DETAIL].shape[1] + 1))


def coloured_layers(
    values: Mapping[str, torch.Tensor], seen: torch.Tensor, camera: Camera, exposure: float
) -> dict[str, np.ndarray]:
    """Radiance, normal and depth of surfels over their sky; see :meth:`LayeredScene.render`.

    Args:
        values: Parameters by name, the sky's among them.
        seen: Shape ``(N, 3)``: encoded colours of the surfels as the camera sees them.
        camera: Any.
        exposure: Factor from radiance to the range of the colours, 1/(W/m²/sr).
    """
    drawn = rasterize(surfels_of(values, seen), camera)
    sky = sky_basis(camera, _degree(len(values[SKY])))
    return {
        "radiance": (srgb_decode_tensor(composed(drawn, sky, values)).clamp(min=0) / exposure).numpy(),
        "normal": normal_layer(drawn, camera),
        "depth": depth_layer(drawn),
    }


def export_colours(path: Path, parameters: Parameters) -> None:
    """Write surfels with their harmonics as a PLY that viewers of Gaussian splats read.

    Raises:
        OutputError: The file cannot be written, or the disk is full.
    """
    coefficients = torch.cat([parameters.surfels[COEFFICIENTS], parameters.surfels[DETAIL]], dim=1)
    export_harmonics_ply(path, surfels_of(parameters.surfels), coefficients)


def _degree(count: int) -> int:
    """Return the degree of so many harmonics."""
    degrees = {coefficient_count(degree): degree for degree in range(4)}
    if count not in degrees:
        raise ValueError(f"expected {', '.join(map(str, degrees))} harmonics, got {count}")
    return degrees[count]


def depth_layer(drawn: Maps | GaussianMaps) -> np.ndarray:
    """z-depth, shape ``(H, W)``, metres; +inf where surfels cover less than half of a pixel."""
    return torch.where(drawn.alpha >= SEEN, drawn.median_depth, torch.inf).numpy()


def normal_layer(drawn: Maps, camera: Camera) -> np.ndarray:
    """Return unit normals in the world, shape ``(H, W, 3)``.

    Those that face the camera where no surfel is.
    """
    normals = drawn.normal.numpy()
    lengths = np.linalg.norm(normals, axis=-1, keepdims=True)
    facing = -camera.rays().astype(np.float32)
    return np.where(lengths > 1e-6, normals / np.maximum(lengths, 1e-6), facing)
