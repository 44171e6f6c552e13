# SPDX-License-Identifier: Apache-2.0
"""How a picture comes about: surfels are drawn as layers, and pixels are shaded (deferred shading)."""

from collections.abc import Mapping
from dataclasses import dataclass

import torch
from torch.nn.functional import normalize

from graycard import Camera
from graycard.methods.gsid._settings import Visibility
from graycard.methods.gsid._visibility import vector_visibility
from graycard.methods.shading import (
    Material,
    Shining,
    Surroundings,
    arriving,
    lit_by_lamps,
    lit_by_surroundings,
    look_up,
)
from graycard.methods.splat import Maps, Surfels, rasterize, rasterize_features, rotation_matrices, surfels_of

BASE_COLOR, ROUGHNESS, METALLIC, SHADOW = "base colour", "roughness", "metallic", "shadow vector"
"""Names of the parameters of surfels: logits of shapes ``(N, 3)``, ``(N, 1)`` and ``(N, 1)``, and a vector of
any length ``(N, 3)``, world."""
OPEN = "open sky"
"""Of each surfel, ``(N,)``: share of the sky's light that arrives, were it even. It is found once."""
SIDE = "lit side"
"""Of each surfel, ``(N,)``: 1 if its third axis points to the side that is lit, else -1. It is found once."""
LEAST_COVER = 1e-3
"""Of a pixel, by surfels: with less its layers are no longer divided by it."""
SOFTEN = 0.02
"""Shares of the extent, see :func:`graycard.methods.shading.arriving`."""


@dataclass(frozen=True, eq=False)
class Ground:
    """What a camera sees of surfels that stand still; no gradient."""

    camera: Camera
    drawn: Maps
    points: torch.Tensor
    """Shape ``(H, W, 3)``, world, metres."""
    normal: torch.Tensor
    """Shape ``(H, W, 3)``, world, unit."""
    eye: torch.Tensor
    """Shape ``(H, W, 3)``, world, unit, to the camera."""
    open: torch.Tensor
    """Shape ``(H, W)``: share of the sky's light that arrives."""


@dataclass(frozen=True, eq=False)
class Pixels:
    """What light falls on: pixels of a view, in any arrangement ``(...)``; the material is differentiable."""

    material: Material
    shadow: torch.Tensor
    """Drawn vectors of shape ``(..., 3)``, of any length."""
    points: torch.Tensor
    normal: torch.Tensor
    eye: torch.Tensor
    open: torch.Tensor
    """As in :class:`Ground`."""
    cover: torch.Tensor
    """Shape ``(...)``: share of the pixel that surfels cover."""

    def at(self, rows: torch.Tensor) -> "Pixels":
        """Some of them, by their numbers row by row; shape ``(R,)``."""
        flat = {
            name: getattr(self, name).flatten(0, 1)[rows]
            for name in ("shadow", "points", "normal", "eye", "open", "cover")
        }
        m = self.material
        material = Material(
            m.base_color.flatten(0, 1)[rows], *(x.flatten()[rows] for x in (m.roughness, m.metallic))
        )
        return Pixels(material, **flat)


@torch.no_grad()
def ground_of(surfels: Surfels, camera: Camera, occlusion: torch.Tensor) -> Ground:
    """Geometry of a view.

    Args:
        surfels: N of them.
        camera: Any.
        occlusion: Shape ``(N,)``: share of the sky's light that arrives at each surfel.
    """
    drawn = rasterize(surfels, camera, features=occlusion[:, None])
    rays = torch.tensor(camera.rays())
    along = rays / (rays @ torch.tensor(camera.forward))[..., None]
    depth = torch.where(drawn.alpha > 0, drawn.depth, 1.0).double()
    points = torch.tensor(camera.position) + along * depth[..., None]
    eye = -rays.float()
    normal = torch.where(drawn.alpha[..., None] > LEAST_COVER, drawn.normal, eye)
    return Ground(
        camera, drawn, points.float(), normalize(normal, dim=-1), eye, _covered(drawn.features, drawn)[..., 0]
    )


def pixels_of(values: Mapping[str, torch.Tensor], ground: Ground) -> Pixels:
    """Draw the material of the surfels, shape ``(H, W)``."""
    colors = [values[name].sigmoid() for name in (BASE_COLOR, ROUGHNESS, METALLIC)]
    features = torch.cat([*colors, values[SHADOW]], dim=1)
    drawn = rasterize_features(surfels_of(values, features), ground.camera)
    base, roughness, metallic, shadow = _covered(drawn.features, ground.drawn).split([3, 1, 1, 3], dim=-1)
    material = Material(base, roughness[..., 0], metallic[..., 0])
    return Pixels(material, shadow, ground.points, ground.normal, ground.eye, ground.open, ground.drawn.alpha)


@torch.no_grad()
def matte_of(values: Mapping[str, torch.Tensor]) -> torch.Tensor:
    """Albedo of what is matte of each surfel, shape ``(N, 3)``, without gradient."""
    return values[BASE_COLOR].sigmoid() * (1 - values[METALLIC].sigmoid())


def lit_side(surfels: Surfels, normals: torch.Tensor) -> torch.Tensor:
    """The parameter :data:`SIDE` of normals ``(N, 3)`` to the side that is lit."""
    axis = rotation_matrices(surfels.rotations)[:, :, 2]
    return torch.where((axis * normals).sum(dim=-1) < 0, -1.0, 1.0)


def lit_normals(values: Mapping[str, torch.Tensor]) -> torch.Tensor:
    """Normals to the side that is lit, shape ``(N, 3)``, world, unit."""
    return rotation_matrices(surfels_of(values).rotations)[:, :, 2] * values[SIDE][:, None]


def _covered(features: torch.Tensor, drawn: Maps) -> torch.Tensor:
    """Means over what surfels cover of each pixel."""
    return features / drawn.alpha[..., None].clamp(min=LEAST_COVER)


@dataclass(frozen=True, eq=False)
class Reach:
    """What gets to pixels ``(...)`` of a view while lights stand still; no gradient."""

    shadows: torch.Tensor | None = None
    """Shape ``(..., K)``: share of each lamp's light that arrives; None: as vectors say."""
    bounced: torch.Tensor | None = None
    """Shape ``(..., B, 3)``: irradiance by way of other surfaces, of all lights or of some at a time; None:
    none."""

    def at(self, rows: torch.Tensor) -> "Reach":
        """Some pixels, by their numbers row by row."""
        parts = (self.shadows, self.bounced)
        return Reach(*(None if part is None else part.flatten(0, 1)[rows] for part in parts))


@torch.no_grad()
def reach_of(
    surfels: Surfels, ground: Ground, shadows: torch.Tensor | None, bounced: torch.Tensor | None
) -> Reach:
    """Draw what surfels receive, ``(N, K)`` and ``(N, B, 3)``; see :class:`Reach`."""
    drawn = None if shadows is None else shadows_of(surfels, ground.camera, shadows, ground)
    if bounced is None:
        return Reach(drawn)
    spread = _drawn(surfels, bounced.flatten(1), ground).clamp(min=0)
    return Reach(drawn, spread.unflatten(-1, bounced.shape[1:]))


@torch.no_grad()
def shadows_of(surfels: Surfels, camera: Camera, reached: torch.Tensor, ground: Ground) -> torch.Tensor:
    """Draw what surfels receive of each lamp, ``(N, K)``, as shares of pixels ``(H, W, K)``."""
    return _drawn(surfels, reached, ground).clamp(0, 1)


def _drawn(surfels: Surfels, values: torch.Tensor, ground: Ground) -> torch.Tensor:
    return _covered(rasterize_features(surfels, ground.camera, features=values).features, ground.drawn)


@dataclass(frozen=True, eq=False)
class LitPicture:
    """Exposed radiance of pixels, each of shape ``(..., 3)``, or ``(..., K, 3)`` by lamp."""

    by_lamp: torch.Tensor
    """What surfaces return of each lamp."""
    by_sky: torch.Tensor
    """What they return of the surroundings, and the surroundings where nothing is in front."""
    by_way: torch.Tensor
    """What they return of light that came by way of other surfaces, ``(..., B, 3)``."""
    irradiance: torch.Tensor
    """Of the lamps on surfaces that face them, blocked light left out."""

    def at(self, rows: torch.Tensor) -> "LitPicture":
        """Some pixels of a view, by their numbers row by row."""
        parts = (self.by_lamp, self.by_sky, self.by_way, self.irradiance)
        return LitPicture(*(part.flatten(0, 1)[rows] for part in parts))

    def merged(self) -> "LitPicture":
        """With all lamps as one."""
        lamps = (part.sum(dim=-2, keepdim=True) for part in (self.by_lamp, self.irradiance))
        by_lamp, irradiance = lamps
        return LitPicture(by_lamp, self.by_sky, self.by_way, irradiance)

    @property
    def whole(self) -> torch.Tensor:
        """What a photograph shows."""
        return self.by_lamp.sum(dim=-2) + self.by_sky + self.by_way.sum(dim=-2)


def picture_of(
    pixels: Pixels,
    lamps: Shining,
    surroundings: Surroundings,
    reach: Reach,
    form: Visibility,
    extent: float,
) -> LitPicture:
    """Light on pixels.

    Args:
        pixels: Of shape ``(...)``.
        lamps: K of them, as bright as ``surroundings``.
        surroundings: Of the whole scene.
        reach: What arrives; of lamps, without shadows, as ``form`` reads the vectors.
        form: How.
        extent: Of the scene, metres.
    """
    material, normal, eye = pixels.material, pixels.normal, pixels.eye
    cover = pixels.cover[..., None]
    arrival = arriving(lamps, pixels.points, SOFTEN * extent)
    shadows = reach.shadows
    if shadows is None:
        one = torch.ones_like(arrival.distance)
        shadows = one if form == "none" else vector_visibility(form, pixels.shadow, arrival.toward)
    arrival = arrival._replace(facing=arrival.facing * shadows[..., None])
    by_lamp = lit_by_lamps(material, normal, eye, arrival).whole
    by_sky = lit_by_surroundings(material, normal, eye, surroundings).whole
    behind = look_up(surroundings.skies[0], -eye)
    by_sky = cover * pixels.open[..., None] * by_sky + (1 - cover) * behind
    by_way = by_sky.new_zeros(*by_sky.shape[:-1], 0, 3)
    if reach.bounced is not None:
        by_way = (cover * material.diffuse / torch.pi)[..., None, :] * reach.bounced
    return LitPicture(cover[..., None] * by_lamp, by_sky, by_way, arrival.facing)
