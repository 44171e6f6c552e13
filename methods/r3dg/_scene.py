# SPDX-License-Identifier: Apache-2.0
"""The decomposition of ``r3dg``: surfels with materials, incident light of their own, and an environment."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Self

import numpy as np
import torch

from graycard import Camera, EnvironmentLight, Light, MethodError
from graycard.io import from_builtins as decode_json
from graycard.io import to_builtins
from graycard.methods.r3dg._light import (
    BASE_COLOR,
    ROUGHNESS,
    SKY,
    Directions,
    basis_of,
    facing_eye,
    from_sky,
    in_view,
    own_light,
    returned,
    roughness_from,
)
from graycard.methods.r3dg._objective import drawn_layers
from graycard.methods.r3dg._settings import R3dgSettings
from graycard.methods.shading import (
    GivenLights,
    Material,
    arriving,
    given_from_store,
    given_lights,
    known_lamps,
    lamp_visibility,
    lit_by_lamps,
    look_up,
    to_latitudes,
)
from graycard.methods.splat import arrays_of, export_ply, parameters_from, rasterize, surfels_of
from graycard.methods.surfels import (
    LayeredScene,
    SceneContents,
    depth_layer,
    normal_layer,
    srgb_encode_tensor,
)

METHOD = "r3dg"
OWN_SKY = EnvironmentLight("sky", "environment.exr")
HEIGHT = 64
"""Rows of the image of the surroundings."""
PANEL = 4
"""Points along each side of a given light with an area."""
_COVERED = 1e-3
_DIRECTIONS = ("normals", "toward", "through")


@dataclass(frozen=True, eq=False)
class R3dgScene(LayeredScene):
    """Surfels, each with a material and incident light of its own, under an environment."""

    directions: Directions
    settings: R3dgSettings
    exposure: float
    """Factor from radiance to the range of the fit, 1/(W/m²/sr)."""
    extent: float
    """Extent of the scene, metres."""
    given: GivenLights | None = None
    """None: the light that was found."""

    @property
    def provides(self) -> frozenset[str]:
        """Picture, material but for metals, and geometry."""
        return frozenset({"radiance", "base_color", "roughness", "normal", "depth"})

    def _images(self, camera: Camera, layers: Sequence[str]) -> Mapping[str, np.ndarray]:
        values = self.parameters.all
        eye = torch.tensor(camera.position).float()
        rows = in_view(values, camera)
        drawn = drawn_layers(values, self._sent(rows, eye, camera), rows, camera)
        geometry = rasterize(surfels_of(values), camera)
        behind = look_up(self._sky, torch.tensor(camera.rays()).float())
        base, roughness, picture = drawn.features.split([3, 1, 3], dim=-1)
        cover = drawn.alpha[..., None]
        return {
            "radiance": (picture + (1 - cover) * behind).numpy(),
            "base_color": (base / cover.clamp(min=_COVERED)).numpy(),
            "roughness": (roughness / cover.clamp(min=_COVERED))[..., 0].numpy(),
            "normal": normal_layer(geometry, camera),
            "depth": depth_layer(geometry),
        }

    @property
    def _sky(self) -> torch.Tensor:
        """The surroundings, shape ``(6, N, N, 3)``, W/m²/sr."""
        if self.given is not None:
            return self.given.sky
        return self.parameters.shared[SKY].exp() / self.exposure

    def _sent(self, rows: torch.Tensor, eye: torch.Tensor, camera: Camera) -> torch.Tensor:
        """Radiance of some surfels, W/m²/sr."""
        values = self.parameters.all
        incident = from_sky(self._sky, self.directions, rows)
        if self.given is None:
            incident = incident + own_light(values, self.directions, rows) / self.exposure
            return returned(values, self.directions, incident, rows, eye)
        by_sky = returned(values, self.directions, incident, rows, eye)
        return by_sky + self._by_lamps(self.given, rows, eye, camera)

    def _by_lamps(
        self, given: GivenLights, rows: torch.Tensor, eye: torch.Tensor, camera: Camera
    ) -> torch.Tensor:
        values, surfels = self.parameters.all, surfels_of(self.parameters.surfels)
        lamps, centres = known_lamps(given.local, camera, PANEL), surfels.centres[rows]
        reached = lamp_visibility(surfels, centres, lamps.positions, self.extent)
        arrival = arriving(lamps, centres)
        arrival = arrival._replace(facing=arrival.facing * reached[..., None])
        roughness = roughness_from(values[ROUGHNESS][rows, 0])
        material = Material(values[BASE_COLOR][rows].sigmoid(), roughness, torch.zeros_like(roughness))
        normals = self.directions.normals[rows]
        to_eye = facing_eye(centres, normals, eye)
        return lit_by_lamps(material, normals, to_eye, arrival).whole.sum(dim=-2)

    def lights(self) -> tuple[Light, ...]:
        """Return the surroundings, and lamps where they were given: what surfels have for themselves is no
        light.
        """
        return *(self.given.local if self.given else ()), OWN_SKY

    @torch.no_grad()
    def environment(self, light: EnvironmentLight) -> np.ndarray:
        """Return the surroundings, shape ``(64, 128, 3)``, W/m²/sr."""
        return to_latitudes(self._sky, HEIGHT)

    @torch.no_grad()
    def relight(self, lights: tuple[Light, ...]) -> "R3dgScene":
        """Return the same surfels under other lights, their shadows traced, without the light of their own.

        Args:
            lights: All that shine then, in true units. The ``image`` of surroundings is the full path of its
                file; without any the scene is dark around.

        Raises:
            DatasetError: An image is missing or broken.
        """
        return replace(self, given=given_lights(lights, OWN_SKY, self._sky))

    def counts(self, camera: Camera) -> Mapping[str, float]:
        """Return how often light is found for a picture: once a surfel that may be seen."""
        return {"light evaluations": len(in_view(self.parameters.all, camera))}

    def _contents(self) -> SceneContents:
        facts = {"exposure": self.exposure, "extent": self.extent, "settings": to_builtins(self.settings)}
        given_facts, given_arrays = ({}, {}) if self.given is None else self.given.to_store()
        rays = {name: getattr(self.directions, name).numpy() for name in _DIRECTIONS}
        return SceneContents(METHOD, facts | given_facts, arrays_of(self.parameters) | given_arrays | rays)

    @classmethod
    def _restored(cls, saved: SceneContents, folder: Path) -> Self:
        facts, arrays = saved.facts, dict(saved.arrays)
        settings = decode_json(R3dgSettings, facts["settings"], MethodError, "settings")
        given = given_from_store(facts, arrays)
        if missing := [name for name in _DIRECTIONS if name not in arrays]:
            raise MethodError(f"expected {', '.join(missing)} in {folder}, got none. Fit and save it again")
        normals, toward, through = (torch.from_numpy(arrays.pop(name).copy()) for name in _DIRECTIONS)
        directions = Directions(normals, toward, through, basis_of(toward))
        exposure, extent = float(facts["exposure"]), float(facts["extent"])
        return cls(parameters_from(arrays), directions, settings, exposure, extent, given)

    def _export(self, path: Path) -> None:
        surfels = self.parameters.surfels
        export_ply(path, surfels_of(surfels), srgb_encode_tensor(surfels[BASE_COLOR].sigmoid()))
