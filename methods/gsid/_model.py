# SPDX-License-Identifier: Apache-2.0
"""Shading: surfels are drawn as layers, and pixels are shaded (deferred shading)."""

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import NamedTuple

import torch
from torch.nn.functional import normalize

from graycard import Camera
from graycard.methods.gsid._settings import Visibility
from graycard.methods.gsid._visibility import vector_visibility
from graycard.methods.shading import (
    InTheWay,
    Lamps,
    Material,
    Shining,
    Surroundings,
    arriving,
    light_of_lamps,
    lit_by_lamps,
    lit_by_surroundings,
    look_up,
)
from graycard.methods.splat import (
    FeatureMaps,
    Maps,
    Surfels,
    Window,
    rasterize,
    rasterize_features,
    rotation_matrices,
    surfels_of,
)

BASE_COLOR, ROUGHNESS, METALLIC, SHADOW = "base colour", "roughness", "metallic", "shadow vector"
"""Names of the parameters of surfels: logits of shapes ``(N, 3)``, ``(N, 1)`` and ``(N, 1)``, and a vector of
any length ``(N, 3)``, world."""
OPEN = "open sky"
"""Occlusion of each surfel, ``(N,)``: share of the sky's light that arrives, were it even. It is found
once."""
SIDE = "lit side"
"""Side of each surfel, ``(N,)``: 1 if its third axis points to the side that is lit, else -1. It is found
once."""
LEAST_COVER = 1e-3
"""Least cover of a pixel, by surfels: with less its layers are no longer divided by it."""
SOFTEN = 0.02
"""Shares of the extent, see :func:`graycard.methods.shading.arriving`."""


@dataclass(frozen=True, eq=False)
class Ground:
    """View of surfels."""

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

    def at(self, window: Window) -> "Ground":
        """Return a part of the view."""
        drawn = Maps(*(window.of(getattr(self.drawn, field.name)) for field in fields(Maps)))
        layers = (window.of(layer) for layer in (self.points, self.normal, self.eye, self.open))
        return Ground(window.camera(self.camera), drawn, *layers)


@dataclass(frozen=True, eq=False)
class Pixels:
    """Ground: pixels of a view, in any arrangement ``(...)``; differentiable."""

    material: Material
    shadow: torch.Tensor
    """Drawn vectors of shape ``(..., 3)``, of any length."""
    points: torch.Tensor
    normal: torch.Tensor
    eye: torch.Tensor
    open: torch.Tensor
    """See :class:`Ground`."""
    cover: torch.Tensor
    """Shape ``(...)``: share of the pixel that surfels cover."""


@torch.no_grad()
def ground_of(surfels: Surfels, camera: Camera, occlusion: torch.Tensor) -> Ground:
    """Geometry of a view, without gradient.

    Args:
        surfels: N of them.
        camera: Any.
        occlusion: Shape ``(N,)``: share of the sky's light that arrives at each surfel.
    """
    drawn = rasterize(surfels, camera, features=occlusion[:, None])
    return _ground(camera, drawn, _covered(drawn.features, drawn)[..., 0])


def pixels_of(values: Mapping[str, torch.Tensor], ground: Ground) -> Pixels:
    """Draw the material of the surfels, shape ``(H, W)``, on geometry that stands still."""
    drawn = rasterize_features(surfels_of(values, _features(values)), ground.camera)
    return _pixels(ground, _covered(drawn.features, ground.drawn))


def seen_anew(values: Mapping[str, torch.Tensor], camera: Camera) -> tuple[Ground, Pixels]:
    """Draw geometry and material of the surfels, ``(H, W)``: differentiable, but for the points."""
    features = torch.cat([_features(values), values[OPEN][:, None]], dim=1)
    drawn = rasterize(surfels_of(values), camera, features=features)
    layers = _covered(drawn.features, drawn)
    ground = _ground(camera, drawn, layers[..., -1])
    return ground, _pixels(ground, layers[..., :-1])


def _ground(camera: Camera, drawn: Maps, opened: torch.Tensor) -> Ground:
    rays = torch.tensor(camera.rays())
    along = rays / (rays @ torch.tensor(camera.forward))[..., None]
    depth = torch.where(drawn.alpha > 0, drawn.depth, 1.0).detach().double()
    points = torch.tensor(camera.position) + along * depth[..., None]
    eye = -rays.float()
    normal = torch.where(drawn.alpha[..., None] > LEAST_COVER, drawn.normal, eye)
    return Ground(camera, drawn, points.float(), normalize(normal, dim=-1, eps=1e-6), eye, opened)


def _features(values: Mapping[str, torch.Tensor]) -> torch.Tensor:
    """Return base colour, roughness, metallic and shadow vector of the surfels, shape ``(N, 8)``."""
    colors = [values[name].sigmoid() for name in (BASE_COLOR, ROUGHNESS, METALLIC)]
    return torch.cat([*colors, values[SHADOW]], dim=1)


def _pixels(ground: Ground, layers: torch.Tensor) -> Pixels:
    base, roughness, metallic, shadow = layers.split([3, 1, 1, 3], dim=-1)
    material = Material(base, roughness[..., 0], metallic[..., 0])
    return Pixels(material, shadow, ground.points, ground.normal, ground.eye, ground.open, ground.drawn.alpha)


@torch.no_grad()
def matte_of(values: Mapping[str, torch.Tensor]) -> torch.Tensor:
    """Albedo of what is matte of each surfel, shape ``(N, 3)``, without gradient."""
    return values[BASE_COLOR].sigmoid() * (1 - values[METALLIC].sigmoid())


def lit_side(surfels: Surfels, normals: torch.Tensor) -> torch.Tensor:
    """Return the parameter :data:`SIDE` of normals ``(N, 3)`` to the side that is lit."""
    axis = rotation_matrices(surfels.rotations)[:, :, 2]
    return torch.where((axis * normals).sum(dim=-1) < 0, -1.0, 1.0)


def lit_normals(values: Mapping[str, torch.Tensor]) -> torch.Tensor:
    """Return normals to the side that is lit, shape ``(N, 3)``, world, unit."""
    return rotation_matrices(surfels_of(values).rotations)[:, :, 2] * values[SIDE][:, None]


def _covered(features: torch.Tensor, drawn: Maps | FeatureMaps) -> torch.Tensor:
    """Means over what surfels cover of each pixel."""
    return features / drawn.alpha[..., None].clamp(min=LEAST_COVER)


@dataclass(frozen=True, eq=False)
class Reach:
    """Light that to pixels ``(...)`` of a view while lights stand still; no gradient."""

    shadows: torch.Tensor | None = None
    """Shape ``(..., K)``: share of each lamp's light that arrives along rays; None: all of it."""
    bounced: torch.Tensor | None = None
    """Shape ``(..., B, 3)``: irradiance by way of other surfaces, of all lights or of some at a time; None:
    none."""
    known: torch.Tensor | None = None
    """Shape ``(K,)``, bool: the lamps that vectors know; None: all."""

    def at(self, window: Window) -> "Reach":
        """Light on a part of the view."""
        shadows, bounced = (None if x is None else window.of(x) for x in (self.shadows, self.bounced))
        return Reach(shadows, bounced, self.known)


@torch.no_grad()
def reach_of(surfels: Surfels, camera: Camera, arrived: Reach) -> Reach:
    """Draw what surfels receive, ``(N, K)`` and ``(N, B, 3)``; see :class:`Reach`."""
    shadows, bounced = arrived.shadows, arrived.bounced
    drawn = None if shadows is None else shadows_of(surfels, camera, shadows)
    if bounced is not None:
        bounced = _drawn(surfels, bounced.flatten(1), camera).clamp(min=0).unflatten(-1, bounced.shape[1:])
    return Reach(drawn, bounced, arrived.known)


@torch.no_grad()
def shadows_of(surfels: Surfels, camera: Camera, reached: torch.Tensor) -> torch.Tensor:
    """Draw what surfels receive of each lamp, ``(N, K)``, as shares of pixels ``(H, W, K)``."""
    return _drawn(surfels, reached, camera).clamp(0, 1)


def _drawn(surfels: Surfels, values: torch.Tensor, camera: Camera) -> torch.Tensor:
    drawn = rasterize_features(surfels, camera, features=values)
    return _covered(drawn.features, drawn)


@dataclass(frozen=True, eq=False)
class LitPicture:
    """Exposed radiance of pixels, each of shape ``(..., 3)``, or ``(..., K, 3)`` by lamp."""

    by_lamp: torch.Tensor
    """Light that surfaces return of each lamp."""
    by_sky: torch.Tensor
    """Light that they return of the surroundings, and the surroundings where nothing is in front."""
    by_way: torch.Tensor
    """Light that they return, which that came by way of other surfaces, ``(..., B, 3)``."""
    irradiance: torch.Tensor
    """Irradiance of the lamps on surfaces that face them, blocked light left out."""

    @property
    def given(self) -> torch.Tensor:
        """Mean irradiance of each lamp, over pixels and channels, shape ``(K,)``."""
        return self.irradiance.flatten(0, -3).mean(dim=(0, 2))

    def merged(self) -> "LitPicture":
        """With all lamps as one."""
        lamps = (part.sum(dim=-2, keepdim=True) for part in (self.by_lamp, self.irradiance))
        by_lamp, irradiance = lamps
        return LitPicture(by_lamp, self.by_sky, self.by_way, irradiance)

    @property
    def whole(self) -> torch.Tensor:
        """Photographed picture."""
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
        reach: What arrives along rays.
        form: How vectors are read, where they tell what is in the way of lamps.
        extent: Of the scene, metres.
    """
    arrival = arriving(lamps, pixels.points, SOFTEN * extent)
    if form.startswith("vector"):
        told = vector_visibility(form, pixels.shadow, arrival.toward)
        told = told if reach.known is None else torch.where(reach.known, told, 1.0)
        arrival = arrival._replace(facing=arrival.facing * told[..., None])
    if reach.shadows is not None:
        arrival = arrival._replace(facing=arrival.facing * reach.shadows[..., None])
    by_lamp = lit_by_lamps(pixels.material, pixels.normal, pixels.eye, arrival).whole
    by_sky, by_way = _besides_lamps(pixels, surroundings, reach)
    return LitPicture(pixels.cover[..., None, None] * by_lamp, by_sky, by_way, arrival.facing)


def _besides_lamps(
    pixels: Pixels, surroundings: Surroundings, reach: Reach
) -> tuple[torch.Tensor, torch.Tensor]:
    """Return radiance from the surroundings, and from light by way of other surfaces, each ``(..., 3)``."""
    material, normal, eye, cover = pixels.material, pixels.normal, pixels.eye, pixels.cover[..., None]
    by_sky = lit_by_surroundings(material, normal, eye, surroundings).whole
    behind = look_up(surroundings.skies[0], -eye)
    by_sky = cover * pixels.open[..., None] * by_sky + (1 - cover) * behind
    by_way = by_sky.new_zeros(*by_sky.shape[:-1], 0, 3)
    if reach.bounced is not None:
        by_way = (cover * material.diffuse / torch.pi)[..., None, :] * reach.bounced
    return by_sky, by_way


class WholePicture(NamedTuple):
    """Radiance and flux that the loss of a fit looks at."""

    whole: torch.Tensor
    """Radiance as in :class:`LitPicture`, shape ``(..., 3)``."""
    given: torch.Tensor
    """Light of each lamp as there, shape ``(K,)``."""


def whole_picture_of(
    pixels: Pixels,
    lamps: Shining,
    surroundings: Surroundings,
    reach: Reach,
    form: Visibility,
    extent: float,
) -> WholePicture:
    """Return the sums of what :func:`picture_of` tells apart, in one sweep over lamps where there are
    kernels.
    """
    if form in ("vector_half", "vector_relu") or not isinstance(lamps, Lamps):
        picture = picture_of(pixels, lamps, surroundings, reach, form, extent)
        return WholePicture(picture.whole, picture.given)
    way = InTheWay(pixels.shadow if form == "vector" else None, reach.known, reach.shadows)
    of_pixels = pixels.material, pixels.normal, pixels.eye, pixels.points
    light = light_of_lamps(*of_pixels, lamps, soften=SOFTEN * extent, in_the_way=way)
    by_sky, by_way = _besides_lamps(pixels, surroundings, reach)
    whole = pixels.cover[..., None] * light.returned + by_sky + by_way.sum(dim=-2)
    return WholePicture(whole, light.given)
