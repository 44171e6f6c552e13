# SPDX-License-Identifier: Apache-2.0
"""The decomposition of ``darkgs``: albedo and geometry of surfels under the lamp that was handed in."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import torch

from graycard import Camera, EnvironmentLight, Light, MethodError
from graycard.lights import light_from_json, light_to_json
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
    shining: tuple[Lamp, ...]
    """Lamps that shine, in camera axes: the calibrated one, until others are put in its place."""
    stays: bool = True
    """Whether the light that stays shines."""

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
        sent = torch.zeros_like(shaded.lamp)
        for lamp in self.shining:
            sent = sent + shade(values, camera, lamp, self.exposure).lamp
        features = torch.cat([shaded.albedo, sent, shaded.ambient * self.stays], dim=1)
        drawn = rasterize(surfels_of(values, features), camera)
        albedo, lit, ambient = drawn.features.split(3, dim=-1)
        images = {
            "radiance": ((lit + ambient) / self.exposure).numpy(),
            "radiance.lamp": (lit / self.exposure).numpy(),
            "radiance.ambient": (ambient / self.exposure).numpy(),
            "base_color": albedo.clamp(0, 1).numpy(),
            "normal": normal_layer(drawn, camera),
            "depth": depth_layer(drawn),
        }
        return {name: images[name] for name in layers}

    def lights(self) -> tuple[Light, ...] | None:
        """The lamp as it was handed in: nothing of it is found. The light that stays has no place."""
        return self.shining

    def relight(self, lights: tuple[Light, ...]) -> "DarkGsScene | None":
        """The same surfels under other lamps on the camera, and under the light that stays or not.

        A light in the room is taken for the one that was found there, whatever is said about it: its place is
        none of the model's. That light keeps the cosine to the calibrated lamp, as it was fitted. None for
        surroundings, and for a light on the camera that is no point or spot light.
        """
        mounted = [light for light in lights if getattr(light, "frame", "world") == "camera"]
        lamps = tuple(light for light in mounted if isinstance(light, Lamp))
        if len(lamps) < len(mounted) or any(isinstance(light, EnvironmentLight) for light in lights):
            return None
        return replace(self, shining=lamps, stays=len(lights) > len(mounted))

    def save(self, folder: Path) -> None:
        """Write as safetensors and JSON, and the albedo as a PLY that viewers of Gaussian splats read.

        Raises:
            OutputError: The folder cannot be written to, or the disk is full.
        """
        facts = {
            "exposure": self.exposure,
            "lamp": light_to_json(self.lamp),
            "shining": [light_to_json(lamp) for lamp in self.shining],
            "stays": self.stays,
        }
        store(folder, METHOD, facts, arrays_of(self.parameters))
        shown = encode(albedo_of(self.parameters.surfels).clamp(0, 1))
        export_ply(Path(folder) / "surfels.ply", surfels_of(self.parameters.surfels), shown)


def load_scene(folder: Path) -> DarkGsScene:
    """A scene that was saved.

    Raises:
        MethodError: It is missing, damaged, or of another method.
    """
    facts, arrays = restore(folder, METHOD)
    lamp, *shining = (_lamp(found, folder) for found in (facts["lamp"], *facts["shining"]))
    exposure, stays = float(facts["exposure"]), bool(facts["stays"])
    return DarkGsScene(parameters_from(arrays), lamp, exposure, tuple(shining), stays)


def _lamp(data: Any, folder: Path) -> Lamp:
    lamp = light_from_json(data, MethodError, str(folder))
    if not isinstance(lamp, Lamp):
        raise MethodError(f"expected a point or spot light in {folder}, got {type(lamp).__name__}")
    return lamp
