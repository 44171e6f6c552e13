# SPDX-License-Identifier: Apache-2.0
"""The decomposition of ``gsid``: surfels with materials, lamps, and surroundings."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Self

import numpy as np
import torch

from graycard import Camera, Composition, EnvironmentLight, Light, MethodError
from graycard.io import from_builtins as decode_json
from graycard.io import to_builtins
from graycard.methods._contract import Guest
from graycard.methods.gsid._bounces import Bounces, bounced_light, bounces_between
from graycard.methods.gsid._draw import draw, light_evaluations, reach_in_view
from graycard.methods.gsid._guest import with_guest
from graycard.methods.gsid._lights import POSITIONS, lamps_from, sky_from
from graycard.methods.gsid._model import (
    BASE_COLOR,
    OPEN,
    SOFTEN,
    Ground,
    LitPicture,
    Pixels,
    Reach,
    ground_of,
    lit_normals,
    matte_of,
    pixels_of,
)
from graycard.methods.gsid._settings import GsidSettings, GsirSettings
from graycard.methods.shading import (
    GivenLights,
    Lamps,
    Shining,
    given_from_store,
    given_lights,
    known_lamps,
    lamp_visibility,
    lights_of,
    surroundings_of,
    to_latitudes,
)
from graycard.methods.splat import CENTRES, arrays_of, export_ply, parameters_from, surfels_of
from graycard.methods.surfels import (
    LayeredScene,
    SceneContents,
    depth_layer,
    normal_layer,
    srgb_encode_tensor,
)

GSID, GSIR = "gsid", "gsir"
_SETTINGS: Mapping[str, type[GsidSettings]] = {GSID: GsidSettings, GSIR: GsirSettings}
SKY_NAME, SKY_FILE = "sky", "environment.exr"
HEIGHT = 64
"""Rows of the image of the surroundings."""
SAME_PLACE = 1e-3
"""Metres: a given lamp that is so near to one that was found is that one."""
PANEL = 4
"""Points along each side of a given light with an area."""
_ALWAYS = frozenset({"radiance", "base_color", "roughness", "metallic", "normal", "depth"})


@dataclass(frozen=True, eq=False)
class GsidScene(LayeredScene):
    """Surfels with materials, lit by lamps with places and by surroundings."""

    settings: GsidSettings
    exposure: float
    """Factor from radiance to the range of the fit, 1/(W/m²/sr)."""
    extent: float
    """Extent of the scene, metres."""
    method: str = GSID
    """Whose it is: what is saved says so."""
    given: GivenLights | None = None
    """None: the lights that were found."""
    hosts: int | None = None
    """Surfels that were fitted here, before those of an object that was put in; None: nothing was."""

    @property
    def provides(self) -> frozenset[str]:
        """Picture, material, geometry, and the picture light by light where the lights are those found."""
        if self.given is not None:
            return _ALWAYS
        return _ALWAYS | {f"radiance.{name}" for name in (*self._names, SKY_NAME)}

    @property
    def _names(self) -> list[str]:
        return [f"lamp-{number}" for number in range(1, len(self.parameters.shared[POSITIONS]) + 1)]

    @property
    def _lamps(self) -> Lamps:
        """The lamps that were found, in W/sr."""
        lamps = lamps_from(self.parameters.all)
        return Lamps(lamps.positions, lamps.axes, lamps.sharpness, lamps.amplitudes / self.exposure)

    def _images(self, camera: Camera, layers: Sequence[str]) -> Mapping[str, np.ndarray]:
        values = self.parameters.all
        ground = ground_of(surfels_of(values), camera, values[OPEN])
        pixels = pixels_of(values, ground)
        return self._surface_layers(ground, pixels) | self._light_layers(self._picture(ground))

    def _picture(self, ground: Ground) -> LitPicture:
        """In W/m²/sr."""
        lamps, surfels = self._shining_at(ground.camera), surfels_of(self.parameters.surfels)
        surroundings, bounced = surroundings_of(self._sky), None
        values = self.parameters.all
        if self._bounces is not None:
            bounced = bounced_light(
                self._bounces, matte_of(values), lamps, surroundings, values[OPEN], SOFTEN * self.extent
            )
        found = self._found(lamps.positions)
        arrived = Reach(self._reached(lamps.positions, found), bounced, found)
        reach = reach_in_view(surfels, ground.camera, arrived, self.settings)
        apart = self.given is None
        return draw(values, ground, (lamps, surroundings), reach, self.settings, self.extent, apart=apart)

    def _found(self, places: torch.Tensor) -> torch.Tensor:
        """Return whether a lamp stands where one was found, bool of shape ``(K,)``: what was fitted knows
        it.
        """
        if self.given is None:
            return torch.ones(len(places), dtype=torch.bool)
        return (torch.cdist(places, self._lamps.positions) < SAME_PLACE).any(dim=1)

    def _reached(self, places: torch.Tensor, found: torch.Tensor) -> torch.Tensor | None:
        """Shares of lamps' light that reach surfels along rays, ``(N, K)``; None: vectors tell all."""
        parameters, form = self.parameters.surfels, self.settings.visibility
        surfels, centres = surfels_of(parameters), parameters[CENTRES]
        if form == "traced":
            return lamp_visibility(surfels, centres, places, self.extent)
        reached = torch.ones(len(centres), len(places))
        reached[:, ~found] = lamp_visibility(surfels, centres, places[~found], self.extent)
        if self.hosts is not None and form != "none":
            put_in = surfels_of({name: values[self.hosts :] for name, values in parameters.items()})
            host, guest = centres[: self.hosts], centres[self.hosts :]
            reached[: self.hosts, found] = lamp_visibility(put_in, host, places[found], self.extent)
            reached[self.hosts :, found] = lamp_visibility(surfels, guest, places[found], self.extent)
        elif found.all():
            return None
        return reached

    @cached_property
    def _bounces(self) -> Bounces | None:
        """Visibility between surfels."""
        if not self.settings.bounces:
            return None
        values = self.parameters.all
        return bounces_between(surfels_of(values), lit_normals(values), self.extent)

    def _shining_at(self, camera: Camera) -> Shining:
        """Return the given lamps, or those that were found, in W/sr."""
        if self.given is not None:
            return known_lamps(self.given.local, camera, PANEL)
        return self._lamps

    @property
    def _sky(self) -> torch.Tensor:
        """The surroundings, shape ``(6, N, N, 3)``, W/m²/sr."""
        if self.given is not None:
            return self.given.sky
        return sky_from(self.parameters.shared) / self.exposure

    def _surface_layers(self, ground: Ground, pixels: Pixels) -> dict[str, np.ndarray]:
        return {
            "base_color": pixels.material.base_color.numpy(),
            "roughness": pixels.material.roughness.numpy(),
            "metallic": pixels.material.metallic.numpy(),
            "normal": normal_layer(ground.drawn, ground.camera),
            "depth": depth_layer(ground.drawn),
        }

    def _light_layers(self, picture: LitPicture) -> dict[str, np.ndarray]:
        whole = {"radiance": picture.whole.numpy()}
        if self.given is not None:
            return whole
        lights = len(self._names) + 1
        by_way = picture.by_way.unbind(dim=-2) or [torch.zeros_like(picture.by_sky)] * lights
        by_lamp = {
            f"radiance.{name}": (picture.by_lamp[..., number, :] + by_way[number]).numpy()
            for number, name in enumerate(self._names)
        }
        return whole | by_lamp | {f"radiance.{SKY_NAME}": (picture.by_sky + by_way[-1]).numpy()}

    @torch.no_grad()
    def lights(self) -> tuple[Light, ...]:
        """Return the given lights, or the lamps that are not out, in W/sr; and the surroundings."""
        sky = EnvironmentLight(SKY_NAME, SKY_FILE)
        if self.given is not None:
            return *self.given.local, sky
        return *lights_of(self._lamps, self._names), sky

    @torch.no_grad()
    def environment(self, light: EnvironmentLight) -> np.ndarray:
        """Return the surroundings, shape ``(64, 128, 3)``, W/m²/sr."""
        return to_latitudes(self._sky, HEIGHT)

    @torch.no_grad()
    def relight(self, lights: tuple[Light, ...]) -> "GsidScene":
        """Return the same surfels under other lights.

        A lamp that stands where one was found is hidden as it was found there; shadows of others are traced.

        A lamp that was found can be switched off, moved or given another colour by handing in
        :meth:`lights` so changed: the surroundings of that tuple are those that were found. A given sphere is
        a point of its strength, a rectangle sixteen points.

        Args:
            lights: All that shine then, in true units. The ``image`` of surroundings is the full path of its
                file; without any the scene is dark around.

        Raises:
            DatasetError: An image is missing or broken.
        """
        own = EnvironmentLight(SKY_NAME, SKY_FILE)
        return replace(self, given=given_lights(lights, own, self._sky))

    @torch.no_grad()
    def compose(self, composition: Composition, guest: Guest | None = None) -> "GsidScene | None":
        """Return the same scene with an object that the same method has found in another one.

        It is lit by the lights of this scene, its own lights stay at home; it sends light on where bounces
        are. Rays find what it hides from the lamps and what hides them from it, unless nothing is in the way
        of lamps here (``visibility = "none"``).

        Args:
            composition: Where it is put.
            guest: The object; without it, and of another method, nothing is provided.
        """
        donor = None if guest is None else guest.decomposition
        if guest is None or not isinstance(donor, GsidScene) or donor.method != self.method:
            return None
        extent = self.extent if self.settings.occlusion else None
        motion = composition.donor_to_host
        parameters = with_guest(self.parameters, donor.parameters, guest, motion, extent)
        return replace(self, parameters=parameters, hosts=len(self.parameters))

    @torch.no_grad()
    def counts(self, camera: Camera) -> Mapping[str, float]:
        """Return how often light is found for a picture: once a pixel, or once a surfel."""
        values = self.parameters.all
        ground = ground_of(surfels_of(values), camera, values[OPEN])
        return {"light evaluations": light_evaluations(values, ground, self.settings)}

    def _contents(self) -> SceneContents:
        facts = {
            "exposure": self.exposure,
            "extent": self.extent,
            "settings": to_builtins(self.settings),
            "hosts": self.hosts,
        }
        given_facts, given_arrays = ({}, {}) if self.given is None else self.given.to_store()
        return SceneContents(self.method, facts | given_facts, arrays_of(self.parameters) | given_arrays)

    @classmethod
    def _restored(cls, saved: SceneContents, folder: Path) -> Self:
        facts, arrays = saved.facts, dict(saved.arrays)
        settings = decode_json(_SETTINGS[saved.method], facts["settings"], MethodError, "settings")
        given = given_from_store(facts, arrays)
        exposure, extent = float(facts["exposure"]), float(facts["extent"])
        return cls(parameters_from(arrays), settings, exposure, extent, saved.method, given, facts["hosts"])

    def _export(self, path: Path) -> None:
        surfels = self.parameters.surfels
        export_ply(path, surfels_of(surfels), srgb_encode_tensor(surfels[BASE_COLOR].sigmoid()))
