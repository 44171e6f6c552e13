# SPDX-License-Identifier: Apache-2.0
"""The decomposition of ``sunfaded``: albedo and geometry of surfels, a light that stays, and a lamp."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
import torch

from graycard import Camera, Light, MethodError, PointLight, encode
from graycard import decode as decode_json
from graycard.methods._contract import check_layers
from graycard.methods._store import restore, store
from graycard.methods.splat import Maps, Parameters, arrays_of, export_ply, parameters_from, surfels_of
from graycard.methods.sunfaded._light import POSITION, lamp_intensity
from graycard.methods.sunfaded._model import ALBEDO, Picture, draw, picture_of
from graycard.methods.sunfaded._settings import SunFadedSettings
from graycard.methods.sunfaded._tiles import lens_of, light_evaluations, tile_side
from graycard.methods.surfels import decode, depth_layer, normal_layer
from graycard.methods.surfels import encode as show

LAMP, STAYS = "lamp", "ambient"
"""Names of the two lights."""
METHOD = "sunfaded"


@dataclass(frozen=True, eq=False)
class SunFadedScene:
    """Surfels with an albedo, and the two lights that shine on them."""

    parameters: Parameters
    settings: SunFadedSettings
    exposure: float
    """Factor from radiance to the range of the fit, 1/(W/m²/sr)."""
    reach: float
    """Metres: the middle distance of what training views see ahead; there the lamp's strength counts."""

    @property
    def provides(self) -> frozenset[str]:
        """The picture, its two lights apart, albedo, shading and geometry.

        ``shading`` only of a fit in linear space: there it is what albedo is multiplied with.
        """
        always = {"radiance", f"radiance.{LAMP}", f"radiance.{STAYS}", "base_color", "normal", "depth"}
        return frozenset(always | ({"shading"} if self.settings.space == "linear" else set()))

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
        drawn = draw(values, camera, self.settings)
        picture = picture_of(drawn, values, camera, lens_of(camera), self.settings)
        makers = self._makers(drawn, picture, camera)
        return {name: makers[name]() for name in layers}

    def _makers(self, drawn: Maps, picture: Picture, camera: Camera) -> dict[str, Callable[[], np.ndarray]]:
        whole = picture.whole
        return {
            "radiance": partial(self._radiance, whole),
            f"radiance.{LAMP}": lambda: self._radiance(whole) - self._radiance(picture.unlit),
            f"radiance.{STAYS}": partial(self._radiance, picture.unlit),
            "base_color": lambda: self._linear(picture.albedo).numpy(),
            "shading": lambda: (whole / picture.albedo.clamp(min=1e-4) / self.exposure).numpy(),
            "normal": lambda: normal_layer(drawn, camera),
            "depth": lambda: depth_layer(drawn),
        }

    def _linear(self, picture: torch.Tensor) -> torch.Tensor:
        """Linear values of those in the space of the fit."""
        return picture if self.settings.space == "linear" else decode(picture)

    def _radiance(self, picture: torch.Tensor) -> np.ndarray:
        return (self._linear(picture).clamp(min=0) / self.exposure).numpy()

    @torch.no_grad()
    def lights(self) -> tuple[Light, ...] | None:
        """The lamp, as a point light: its position in camera axes and its strength along the optical axis.

        The model gives what arrives over albedo, ``i``; a point light of the intensity I sends
        ``I / (pi d^2)`` to a matte surface at the distance d that faces it. So I is ``i pi d^2``, at the
        distance in ``reach``. The lamp of a fit in sRGB has no strength in W/sr: it gets that of the
        decoded ``i``. The light that stays has no place, and is none of these.
        """
        values = self.parameters.all
        ahead = torch.tensor([0.0, 0.0, self.reach])
        sent = self._linear(lamp_intensity(values, ahead)).double() / self.exposure
        distance = float((ahead - values[POSITION]).norm())
        red, green, blue = (sent * np.pi * distance**2).tolist()
        x, y, z = values[POSITION].double().tolist()
        return (PointLight(LAMP, (x, y, z), (red, green, blue), "camera"),)

    def counts(self, camera: Camera) -> Mapping[str, float]:
        """How often the lamp's network is asked for a picture: once a tile, or once a surfel."""
        if self.settings.shading == "surfel":
            return {"light evaluations": len(self.parameters.surfels[ALBEDO])}
        side = tile_side(camera.width, self.settings.tile)
        found = light_evaluations(camera.width, camera.height, side, self.settings.light_map)
        return {"light evaluations": found}

    def save(self, folder: Path) -> None:
        """Write as safetensors and JSON, and the albedo as a PLY that viewers of Gaussian splats read.

        Raises:
            OutputError: The folder cannot be written to, or the disk is full.
        """
        facts = {"exposure": self.exposure, "reach": self.reach, "settings": encode(self.settings)}
        store(folder, METHOD, facts, arrays_of(self.parameters))
        albedo = self.parameters.surfels[ALBEDO].clamp(0, 1)
        albedo = show(albedo) if self.settings.space == "linear" else albedo
        export_ply(Path(folder) / "surfels.ply", surfels_of(self.parameters.surfels), albedo)


def load_scene(folder: Path) -> SunFadedScene:
    """A scene that was saved.

    Raises:
        MethodError: It is missing, damaged, or of another method.
    """
    facts, arrays = restore(folder, METHOD)
    settings = decode_json(SunFadedSettings, facts["settings"], MethodError, "settings")
    return SunFadedScene(parameters_from(arrays), settings, float(facts["exposure"]), float(facts["reach"]))
