# SPDX-License-Identifier: Apache-2.0
"""The decomposition of ``gsid``: surfels with materials, lamps, and surroundings."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch

from graycard import Camera, EnvironmentLight, Light, MethodError, encode
from graycard import decode as decode_json
from graycard.methods._contract import check_layers
from graycard.methods._store import restore, store
from graycard.methods.gsid._lights import lamps_from, sky_from
from graycard.methods.gsid._model import (
    BASE_COLOR,
    OPEN,
    Ground,
    Picture,
    Pixels,
    ground_of,
    picture_of,
    pixels_of,
    shadows_of,
)
from graycard.methods.gsid._settings import GsidSettings
from graycard.methods.gsid._visibility import lamp_visibility
from graycard.methods.shading import Lamps, lights_of, surroundings_of, to_latitudes
from graycard.methods.splat import Parameters, arrays_of, export_ply, parameters_from, surfels_of
from graycard.methods.surfels import depth_layer, normal_layer
from graycard.methods.surfels import encode as show

METHOD = "gsid"
SKY_NAME = "sky"
HEIGHT = 64
"""Rows of the image of the surroundings."""
_ALWAYS = frozenset({"radiance", "base_color", "roughness", "metallic", "normal", "depth"})


@dataclass(frozen=True, eq=False)
class GsidScene:
    """Surfels with materials, lit by lamps with places and by surroundings."""

    parameters: Parameters
    settings: GsidSettings
    exposure: float
    """Factor from radiance to the range of the fit, 1/(W/m²/sr)."""
    extent: float
    """Of the scene, metres."""

    @property
    def provides(self) -> frozenset[str]:
        """Picture, material, geometry, and the picture light by light."""
        return _ALWAYS | {f"radiance.{name}" for name in (*self._names, SKY_NAME)}

    @property
    def _shining(self) -> torch.Tensor:
        """Numbers of the lamps that are not out: each with its share of all local light, by flux."""
        flux = lamps_from(self.parameters.all).flux().sum(dim=-1)
        return (flux >= self.settings.least_share * flux.sum()).nonzero()[:, 0]

    @property
    def _names(self) -> list[str]:
        return [f"lamp-{number}" for number in range(1, len(self._shining) + 1)]

    @property
    def _lamps(self) -> Lamps:
        return lamps_from(self.parameters.all)[self._shining]

    @torch.no_grad()
    def render(self, camera: Camera, layers: Sequence[str]) -> dict[str, np.ndarray]:
        """Layers as any camera sees them.

        Where surfels cover less than half of a pixel its depth is +inf; where there is none at all, its
        normal faces the camera.

        Raises:
            MethodError: A layer is not provided.
        """
        check_layers(layers, self.provides)
        values = self.parameters.all
        ground = ground_of(surfels_of(values), camera, values[OPEN])
        pixels = pixels_of(values, ground)
        found = self._surface_layers(ground, pixels) | self._light_layers(self._picture(ground, pixels))
        return {name: found[name] for name in layers}

    def _picture(self, ground: Ground, pixels: Pixels) -> Picture:
        lamps, surfels = self._lamps, surfels_of(self.parameters.surfels)
        shadows = None
        if self.settings.visibility == "traced":
            reached = lamp_visibility(surfels, surfels.centres, lamps.positions, self.extent)
            shadows = shadows_of(surfels, ground.camera, reached, ground)
        surroundings = surroundings_of(sky_from(self.parameters.shared))
        return picture_of(pixels, lamps, surroundings, shadows, self.settings.visibility, self.extent)

    def _surface_layers(self, ground: Ground, pixels: Pixels) -> dict[str, np.ndarray]:
        return {
            "base_color": pixels.material.base_color.numpy(),
            "roughness": pixels.material.roughness.numpy(),
            "metallic": pixels.material.metallic.numpy(),
            "normal": normal_layer(ground.drawn, ground.camera),
            "depth": depth_layer(ground.drawn),
        }

    def _light_layers(self, picture: Picture) -> dict[str, np.ndarray]:
        by_lamp = {
            f"radiance.{name}": (picture.by_lamp[..., number, :] / self.exposure).numpy()
            for number, name in enumerate(self._names)
        }
        whole, sky = (image / self.exposure for image in (picture.whole, picture.by_sky))
        return by_lamp | {"radiance": whole.numpy(), f"radiance.{SKY_NAME}": sky.numpy()}

    @torch.no_grad()
    def lights(self) -> tuple[Light, ...]:
        """The lamps that are not out, in W/sr, and the surroundings."""
        lamps = self._lamps
        true = Lamps(lamps.positions, lamps.axes, lamps.sharpness, lamps.amplitudes / self.exposure)
        return *lights_of(true, self._names), EnvironmentLight(SKY_NAME, "environment.exr")

    @torch.no_grad()
    def environment(self, light: EnvironmentLight) -> np.ndarray:
        """The surroundings, shape ``(64, 128, 3)``, W/m²/sr."""
        return to_latitudes(sky_from(self.parameters.shared) / self.exposure, HEIGHT)

    def save(self, folder: Path) -> None:
        """Write as safetensors and JSON, and the base colour as a PLY that viewers of Gaussian splats read.

        Raises:
            OutputError: The folder cannot be written to, or the disk is full.
        """
        facts = {"exposure": self.exposure, "extent": self.extent, "settings": encode(self.settings)}
        store(folder, METHOD, facts, arrays_of(self.parameters))
        surfels = self.parameters.surfels
        export_ply(Path(folder) / "surfels.ply", surfels_of(surfels), show(surfels[BASE_COLOR].sigmoid()))


def load_scene(folder: Path) -> GsidScene:
    """A scene that was saved.

    Raises:
        MethodError: It is missing, damaged, or of another method.
    """
    facts, arrays = restore(folder, METHOD)
    settings = decode_json(GsidSettings, facts["settings"], MethodError, "settings")
    return GsidScene(parameters_from(arrays), settings, float(facts["exposure"]), float(facts["extent"]))
