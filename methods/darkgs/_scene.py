# SPDX-License-Identifier: Apache-2.0
"""The decomposition of ``darkgs``: albedo and geometry of surfels under the lamp that was handed in."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Self

import numpy as np
import torch

from graycard import Camera, EnvironmentLight, Light, MethodError
from graycard.io import from_builtins as decode_json
from graycard.io import to_builtins
from graycard.lights import light_from_json, light_to_json
from graycard.methods._priors import Lamp
from graycard.methods.darkgs._lamp import LampProfile, MeasuredLamp
from graycard.methods.darkgs._model import albedo_of, shade
from graycard.methods.splat import arrays_of, export_ply, parameters_from, rasterize, surfels_of
from graycard.methods.surfels import (
    LayeredScene,
    SceneContents,
    depth_layer,
    normal_layer,
    srgb_encode_tensor,
)

METHOD = "darkgs"


@dataclass(frozen=True, eq=False)
class DarkGsScene(LayeredScene):
    """Surfels with an albedo, a light that stays, and a calibrated lamp on the camera."""

    lamp: Lamp
    """Lamp as it was handed in, in camera axes."""
    exposure: float
    """Factor from radiance to the range of the fit, 1/(W/m²/sr)."""
    shining: tuple[Lamp, ...]
    """Lamps that shine, in camera axes: the calibrated one, until others are put in its place."""
    stays: bool = True
    """True if the light that stays shines."""
    profile: LampProfile | None = None
    """Measured beam of the calibrated lamp; None: it shines as told. Other lamps shine as told."""

    @property
    def provides(self) -> frozenset[str]:
        """The picture, its two lights apart, albedo and geometry."""
        return frozenset({"radiance", "radiance.lamp", "radiance.ambient", "base_color", "normal", "depth"})

    def _images(self, camera: Camera, layers: Sequence[str]) -> Mapping[str, np.ndarray]:
        values = self.parameters.all
        shaded = shade(values, camera, self.lamp, self.exposure)
        sent = torch.zeros_like(shaded.lamp)
        for lamp in self.shining:
            sent = sent + shade(values, camera, self._source(lamp), self.exposure).lamp
        features = torch.cat([shaded.albedo, sent, shaded.ambient * self.stays], dim=1)
        drawn = rasterize(surfels_of(values, features), camera)
        albedo, lit, ambient = drawn.features.split(3, dim=-1)
        return {
            "radiance": ((lit + ambient) / self.exposure).numpy(),
            "radiance.lamp": (lit / self.exposure).numpy(),
            "radiance.ambient": (ambient / self.exposure).numpy(),
            "base_color": albedo.clamp(0, 1).numpy(),
            "normal": normal_layer(drawn, camera),
            "depth": depth_layer(drawn),
        }

    def _source(self, lamp: Lamp) -> Lamp | MeasuredLamp:
        """Return a lamp that shines, with its measured beam if it is the one whose beam was measured."""
        if self.profile is None or lamp != self.lamp:
            return lamp
        return MeasuredLamp(lamp, self.profile)

    def lights(self) -> tuple[Light, ...] | None:
        """Return the lamp as it was handed in: nothing of it is found. The light that stays has no place."""
        return self.shining

    def relight(self, lights: tuple[Light, ...]) -> "DarkGsScene | None":
        """Return the same surfels under other lamps on the camera, and under the light that stays or not.

        A light in the room is taken for the one that was found there, whatever is said about it: its place is
        none of the model's. That light keeps the cosine to the calibrated lamp, as it was fitted. None for
        surroundings, and for a light on the camera that is no point or spot light.
        """
        mounted = [light for light in lights if getattr(light, "frame", "world") == "camera"]
        lamps = tuple(light for light in mounted if isinstance(light, Lamp))
        if len(lamps) < len(mounted) or any(isinstance(light, EnvironmentLight) for light in lights):
            return None
        return replace(self, shining=lamps, stays=len(lights) > len(mounted))

    def _contents(self) -> SceneContents:
        facts = {
            "exposure": self.exposure,
            "lamp": light_to_json(self.lamp),
            "shining": [light_to_json(lamp) for lamp in self.shining],
            "stays": self.stays,
            "profile": None if self.profile is None else to_builtins(self.profile),
        }
        return SceneContents(METHOD, facts, arrays_of(self.parameters))

    @classmethod
    def _restored(cls, saved: SceneContents, folder: Path) -> Self:
        facts = saved.facts
        lamp, *shining = (_lamp(found, folder) for found in (facts["lamp"], *facts["shining"]))
        exposure, stays = float(facts["exposure"]), bool(facts["stays"])
        told = facts["profile"]
        profile = None if told is None else decode_json(LampProfile, told, MethodError, "profile of the lamp")
        return cls(parameters_from(saved.arrays), lamp, exposure, tuple(shining), stays, profile)

    def _export(self, path: Path) -> None:
        shown = srgb_encode_tensor(albedo_of(self.parameters.surfels).clamp(0, 1))
        export_ply(path, surfels_of(self.parameters.surfels), shown)


def _lamp(data: Any, folder: Path) -> Lamp:
    lamp = light_from_json(data, MethodError, str(folder))
    if not isinstance(lamp, Lamp):
        raise MethodError(f"expected a point or spot light in {folder}, got {type(lamp).__name__}")
    return lamp
