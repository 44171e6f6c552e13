# SPDX-License-Identifier: Apache-2.0
"""Layers of what was drawn, under the lights that were found or under given ones."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
import torch

from graycard import Camera, EnvironmentLight, Light, LocalLight, PointLight
from graycard.methods.shading import light_at
from graycard.methods.splat import Maps
from graycard.methods.sunfaded._light import POSITION, lamp_intensity
from graycard.methods.sunfaded._model import picture_of
from graycard.methods.sunfaded._settings import Space, SunFadedSettings
from graycard.methods.sunfaded._tiles import lens_of
from graycard.methods.surfels import depth_layer, normal_layer, srgb_decode_tensor

LAMP, STAYS = "lamp", "ambient"
"""Names of the two lights."""
Makers = dict[str, Callable[[], np.ndarray]]
"""By layer, what makes it."""


@dataclass(frozen=True, eq=False)
class Lighting:
    """The lights of a decomposition, and the units that its pictures are in."""

    settings: SunFadedSettings
    exposure: float
    """Factor from radiance to the range of the fit, 1/(W/m²/sr)."""
    reach: float
    """Metres: the middle distance of what training views see ahead; there the lamp's strength counts."""
    given: tuple[LocalLight, ...] | None = None
    """Lights that shine in place of those that were found; None: those that were found."""

    @property
    def provides(self) -> frozenset[str]:
        """The picture, its two lights apart, albedo, shading and geometry.

        ``shading`` only of a fit in linear space: there it is what albedo is multiplied with. The lights are
        apart only where they are those that were found.
        """
        always = {"radiance", "base_color", "normal", "depth"}
        if self.given is not None:
            return frozenset(always | {"shading"})
        product = {"shading"} if self.settings.space == "linear" else set()
        return frozenset(always | {f"radiance.{LAMP}", f"radiance.{STAYS}"} | product)

    def layers(
        self, names: Sequence[str], drawn: Maps, values: Mapping[str, torch.Tensor], camera: Camera
    ) -> dict[str, np.ndarray]:
        """Layers of what was drawn.

        Args:
            names: Out of ``provides``.
            drawn: By :func:`draw`, with these settings.
            values: Parameters of both lights by name.
            camera: The camera that it was drawn for.
        """
        makers: Makers = {
            "base_color": lambda: _linear(drawn.features[..., :3], self.settings.space).numpy(),
            "normal": lambda: normal_layer(drawn, camera),
            "depth": lambda: depth_layer(drawn),
        }
        lit = self._found(drawn, values, camera) if self.given is None else self._relit(drawn, camera)
        return {name: (makers | lit)[name]() for name in names}

    def _found(self, drawn: Maps, values: Mapping[str, torch.Tensor], camera: Camera) -> Makers:
        """Layers with light, under the lights that were found."""
        picture = picture_of(drawn, values, camera, lens_of(camera), self.settings)
        whole = picture.whole
        return {
            "radiance": partial(self._radiance, whole),
            f"radiance.{LAMP}": lambda: self._radiance(whole) - self._radiance(picture.unlit),
            f"radiance.{STAYS}": partial(self._radiance, picture.unlit),
            "shading": lambda: (whole / picture.albedo.clamp(min=1e-4) / self.exposure).numpy(),
        }

    def _relit(self, drawn: Maps, camera: Camera) -> Makers:
        """Layers with light, under the given lights: the paper's product with what is known of them."""
        rays = camera.rays()
        points = camera.position + rays * (depth_layer(drawn) / (rays @ camera.forward))[..., None]
        light = light_at(self.given or (), points, normal_layer(drawn, camera), camera).astype(np.float32)
        albedo = _linear(drawn.features[..., :3], self.settings.space).numpy()
        return {"radiance": lambda: albedo * light, "shading": lambda: light}

    def _radiance(self, picture: torch.Tensor) -> np.ndarray:
        return (_linear(picture, self.settings.space).clamp(min=0) / self.exposure).numpy()

    def lights(self, values: Mapping[str, torch.Tensor]) -> tuple[Light, ...]:
        """Return the given lights, or the lamp as a point light.

        It is at its place in camera axes, as strong as along the optical axis. The model gives what arrives
        over albedo, ``i``; a point light of the intensity I sends ``I / (pi d^2)`` to a matte surface at the
        distance d that faces it. So I is ``i pi d^2``, at the distance in ``reach``. The lamp of a fit in
        sRGB has no strength in W/sr: it gets that of the decoded ``i``. The light that stays has no place,
        and is none of these.
        """
        if self.given is not None:
            return self.given
        ahead = torch.tensor([0.0, 0.0, self.reach])
        sent = _linear(lamp_intensity(values, ahead), self.settings.space).double() / self.exposure
        distance = float((ahead - values[POSITION]).norm())
        red, green, blue = (sent * np.pi * distance**2).tolist()
        x, y, z = values[POSITION].double().tolist()
        return (PointLight(LAMP, (x, y, z), (red, green, blue), "camera"),)


def local_lights(lights: Sequence[Light]) -> tuple[LocalLight, ...] | None:
    """Return the lights, if each has a place.

    Else None: of a whole environment this model knows one colour.
    """
    local = tuple(light for light in lights if not isinstance(light, EnvironmentLight))
    return local if len(local) == len(lights) else None


def _linear(picture: torch.Tensor, space: Space) -> torch.Tensor:
    """Linear values of those in the space of the fit."""
    return picture if space == "linear" else srgb_decode_tensor(picture)
