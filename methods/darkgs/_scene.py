# SPDX-License-Identifier: Apache-2.0
"""The decomposition of ``darkgs``: albedo and geometry of surfels under the lamp that was handed in."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch

from graycard import Camera, Light, MethodError, PointLight, SpotLight, light_from_json, light_to_json
from graycard.methods._contract import check_layers
from graycard.methods._priors import Lamp
from graycard.methods._store import restore, store
from graycard.methods.darkgs._model import albedo_of, shade
from graycard.methods.splat import Parameters, arrays_of, export_ply, parameters_from, rasterize, surfels_of
from graycard.methods.surfels import depth_layer, encode, normal_layer

METHOD = "darkgs"


@dataclass(frozen=True, eq=False)
class DarkGsScene:
    """Surfels with an albedo, a light that stays, and a calibrated lamp on the camera."""

    parameters: Parameters
    lamp: Lamp
    """As it was handed in, in camera axes."""
    exposure: float
    """Factor from radiance to the range of the fit, 1/(W/m²/sr)."""

    @property
    def provides(self) -> frozenset[str]:
        """The picture, its two lights apart, albedo and geometry."""
        return frozenset({"radiance", "radiance.lamp", "radiance.ambient", "base_color", "normal", "depth"})

    @torch.no_grad()
    def render(self, camera: Camera, layers: Sequence[str]) -> dict[str, np.ndarray]:
        """Layers as any camera sees them; the lamp goes with it.

        Where surfels cover less than half of a pixel its depth is +inf; where there is none at all, its
        normal faces the camera.

        Raises:
            MethodError: A layer is not provided.
        """
        check_layers(layers, self.provides)
        values = self.parameters.all
        shaded = shade(values, camera, self.lamp, self.exposure)
        features = torch.cat([shaded.albedo, shaded.lamp, shaded.ambient], dim=1)
        drawn = rasterize(surfels_of(values, features), camera)
        albedo, lamp, ambient = drawn.features.split(3, dim=-1)
        images = {
            "radiance": ((lamp + ambient) / self.exposure).numpy(),
            "radiance.lamp": (lamp / self.exposure).numpy(),
            "radiance.ambient": (ambient / self.exposure).numpy(),
            "base_color": albedo.clamp(0, 1).numpy(),
            "normal": normal_layer(drawn, camera),
            "depth": depth_layer(drawn),
        }
        return {name: images[name] for name in layers}

    def lights(self) -> tuple[Light, ...] | None:
        """The lamp as it was handed in: nothing of it is found. The light that stays has no place."""
        return (self.lamp,)

    def save(self, folder: Path) -> None:
        """Write as safetensors and JSON, and the albedo as a PLY that viewers of Gaussian splats read.

        Raises:
            OutputError: The folder cannot be written to, or the disk is full.
        """
        facts = {"exposure": self.exposure, "lamp": light_to_json(self.lamp)}
        store(folder, METHOD, facts, arrays_of(self.parameters))
        shown = encode(albedo_of(self.parameters.surfels).clamp(0, 1))
        export_ply(Path(folder) / "surfels.ply", surfels_of(self.parameters.surfels), shown)


def load_scene(folder: Path) -> DarkGsScene:
    """A scene that was saved.

    Raises:
        MethodError: It is missing, damaged, or of another method.
    """
    facts, arrays = restore(folder, METHOD)
    lamp = light_from_json(facts["lamp"], MethodError, str(folder))
    if not isinstance(lamp, PointLight | SpotLight):
        raise MethodError(f"expected a point or spot light in {folder}, got {type(lamp).__name__}")
    return DarkGsScene(parameters_from(arrays), lamp, float(facts["exposure"]))
