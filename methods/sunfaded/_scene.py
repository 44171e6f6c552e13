# SPDX-License-Identifier: Apache-2.0
"""The decomposition of ``sunfaded``: albedo and geometry of surfels, a light that stays, and a lamp."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Self

import numpy as np
import torch

from graycard import Camera, Light, MethodError
from graycard.io import from_builtins as decode_json
from graycard.io import to_builtins
from graycard.lights import light_from_json, light_to_json
from graycard.methods.splat import arrays_of, export_ply, parameters_from, surfels_of
from graycard.methods.sunfaded._layers import Lighting, local_lights
from graycard.methods.sunfaded._model import ALBEDO, albedo_of, draw
from graycard.methods.sunfaded._settings import SunFadedSettings
from graycard.methods.sunfaded._tiles import light_evaluations, tile_side
from graycard.methods.surfels import LayeredScene, SceneContents, srgb_encode_tensor

METHOD = "sunfaded"


@dataclass(frozen=True, eq=False)
class SunFadedScene(LayeredScene):
    """Surfels with an albedo, and the two lights that shine on them."""

    lighting: Lighting

    @property
    def provides(self) -> frozenset[str]:
        """Picture, albedo, geometry; see :attr:`Lighting.provides`."""
        return self.lighting.provides

    def _images(self, camera: Camera, layers: Sequence[str]) -> Mapping[str, np.ndarray]:
        values = self.parameters.all
        drawn = draw(values, camera, self.lighting.settings)
        return self.lighting.layers(layers, drawn, values, camera)

    @torch.no_grad()
    def lights(self) -> tuple[Light, ...] | None:
        """Return the lamp, as a point light; see :meth:`Lighting.lights`."""
        return self.lighting.lights(self.parameters.all)

    def relight(self, lights: tuple[Light, ...]) -> "SunFadedScene | None":
        """Return the same surfels under lights that are known: their falloff, beam and place are not learnt.

        The found lamp and the light that stays are gone. What is known of the given ones takes the place of
        ``i``, so a picture is right up to the gain of the albedo. Nothing casts a shadow or lights another.
        None for surroundings, which have no place.
        """
        given = local_lights(lights)
        return None if given is None else replace(self, lighting=replace(self.lighting, given=given))

    def counts(self, camera: Camera) -> Mapping[str, float]:
        """Return how often the lamp's network is asked for a picture: once a tile, or once a surfel."""
        settings = self.lighting.settings
        if settings.shading == "surfel":
            return {"light evaluations": len(self.parameters.surfels[ALBEDO])}
        side = tile_side(camera.width, settings.tile)
        found = light_evaluations(camera.width, camera.height, side)
        return {"light evaluations": found}

    def _contents(self) -> SceneContents:
        return SceneContents(METHOD, lighting_to_json(self.lighting), arrays_of(self.parameters))

    @classmethod
    def _restored(cls, saved: SceneContents, folder: Path) -> Self:
        return cls(parameters_from(saved.arrays), lighting_from_json(saved.facts))

    def _export(self, path: Path) -> None:
        albedo = albedo_of(self.parameters.surfels)
        albedo = srgb_encode_tensor(albedo) if self.lighting.settings.space == "linear" else albedo
        export_ply(path, surfels_of(self.parameters.surfels), albedo)


def lighting_to_json(lighting: Lighting) -> dict[str, Any]:
    """Facts about the lights besides parameters, as JSON data."""
    given = None if lighting.given is None else [light_to_json(light) for light in lighting.given]
    return {
        "exposure": lighting.exposure,
        "reach": lighting.reach,
        "given": given,
        "settings": to_builtins(lighting.settings),
    }


def lighting_from_json(facts: dict[str, Any]) -> Lighting:
    """Return what :func:`lighting_to_json` gave.

    Raises:
        MethodError: It is damaged.
    """
    settings = decode_json(SunFadedSettings, facts["settings"], MethodError, "settings")
    given = facts["given"]
    lights = None if given is None else [light_from_json(x, MethodError, "given lights") for x in given]
    local = None if lights is None else local_lights(lights)
    return Lighting(settings, float(facts["exposure"]), float(facts["reach"]), local)
