# SPDX-License-Identifier: Apache-2.0
"""The image formation: surfels are rasterised into a G-buffer, and glossy pixels reflect traced radiance."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import torch
from torch.nn.functional import adaptive_avg_pool2d, normalize

from graycard import Camera
from graycard.methods.goris._filter import filtered, pyramid, translated
from graycard.methods.goris._settings import GorisSettings
from graycard.methods.shading import prefiltered_skies, reflected_sky
from graycard.methods.splat import (
    CENTRES,
    GEOMETRY,
    FeatureMaps,
    Maps,
    Rays,
    Surfels,
    rasterize,
    rasterize_features,
    spherical_harmonics_colours,
    surfels_of,
    trace_rays,
)
from graycard.methods.surfels import (
    COEFFICIENTS,
    DETAIL,
    colours,
    composed,
    srgb_decode_tensor,
    srgb_encode_tensor,
)

DIFFUSE, FRESNEL, ROUGHNESS, REGION, LABEL = "diffuse", "f0", "roughness", "region", "label"
"""Names of the parameters of surfels, all logits: of diffuse radiance over :data:`BRIGHTEST`, encoded,
``(N, 3)``; of reflectance at normal incidence ``(N, 3)``; of roughness ``(N, 1)``; of the region ``(N, 1)``,
1 where a surface is rough and 0 where it is glossy; and of the object's label ``(N, 1)``."""
RESIDUAL = "residual"
"""Name of the harmonics of degree 1 and more of radiance that is added to what glossy surfels reflect, linear
and exposed, ``(N, K - 1, 3)``; only where settings ask for it."""
SURROUNDINGS = "surroundings"
"""Name of the environment map: logarithm of exposed radiance, cubemap ``(6, N, N, 3)``."""
BRIGHTEST = 1.5
"""Greatest diffuse radiance of a surfel, encoded: the released code divides photographs by it."""
LEAST_COVER = 1e-3
"""Coverage of a pixel by surfels: layers are divided by no less."""
LARGEST_FILTERED = 16
"""Texels along the side of a face of the environment map from which it is filtered for rough surfaces: their
lobes are wider than a texel, and the cost grows with the fourth power."""
LEAST_GLOSS = 0.02
"""Share of a pixel that has to be glossy for a ray to be traced."""


@dataclass(frozen=True, eq=False)
class Buffers:
    """The G-buffer of a view; H x W pixels."""

    camera: Camera
    rays: torch.Tensor
    """Shape ``(H, W, 3)``, float64, world, unit: from the camera through the middles of the pixels."""
    drawn: Maps
    """Geometry; of its features the first three are encoded colours, the others encoded diffuse radiance."""
    rough: torch.Tensor
    """Shape ``(H, W, 3)``, encoded: radiance of spherical harmonics over the sky, as if all were rough."""
    diffuse: torch.Tensor
    """Shape ``(H, W, 3)``, linear, exposed: diffuse radiance, which does not depend on the view."""
    f0: torch.Tensor
    """Shape ``(H, W, 3)``."""
    roughness: torch.Tensor
    """Shape ``(H, W)``."""
    glossy: torch.Tensor
    """Shape ``(H, W)``: share of the pixel that is glossy; what surfels do not cover is not."""
    label: torch.Tensor
    """Shape ``(H, W)``: share of the pixel that the object covers."""
    normal: torch.Tensor
    """Shape ``(H, W, 3)``, world, unit."""
    points: torch.Tensor
    """Shape ``(H, W, 3)``, world, metres."""
    residual: torch.Tensor | None = None
    """Shape ``(H, W, 3)``, linear, exposed, of either sign: what is added to the reflected light; None:
    nothing."""


def drawn_buffers(
    values: Mapping[str, torch.Tensor],
    camera: Camera,
    sky: torch.Tensor,
    settings: GorisSettings,
    offsets: torch.Tensor | None = None,
) -> Buffers:
    """Rasterise surfels into a G-buffer.

    Colours and diffuse radiance have gradients with respect to geometry, other attributes do not (in the
    released code f0 has them, too).

    Args:
        values: Parameters by name.
        camera: Any.
        sky: Shape ``(H, W, K)``: harmonics of the direction of each pixel.
        settings: Of the method.
        offsets: See :func:`graycard.methods.splat.rasterize`.
    """
    seen, matte = colours(values, camera.position, settings.degree), BRIGHTEST * values[DIFFUSE].sigmoid()
    if settings.composite == "paper" and settings.transport:
        region = values[REGION].sigmoid()
        seen = region * seen + (1 - region) * matte
    drawn = rasterize(surfels_of(values, torch.cat([seen, matte], dim=1)), camera, offsets=offsets)
    still = {name: values[name].detach() for name in GEOMETRY}
    gloss = 1 - values[REGION].sigmoid()
    others = [values[FRESNEL].sigmoid(), values[ROUGHNESS].sigmoid(), gloss, values[LABEL].sigmoid()]
    others += [residual_radiance(values, camera.position)] if RESIDUAL in values else []
    soft = rasterize_features(surfels_of(still, torch.cat(others, dim=1)), camera)
    cover = soft.alpha[..., None].clamp(min=LEAST_COVER)
    f0, roughness, glossy, label, *added = soft.features.split([part.shape[1] for part in others], dim=-1)
    encoded = drawn.features[..., 3:] / drawn.alpha[..., None].clamp(min=LEAST_COVER)
    rays = torch.from_numpy(camera.rays()).to(drawn.alpha.device)
    return Buffers(
        camera,
        rays,
        drawn,
        composed(FeatureMaps(drawn.features[..., :3], drawn.alpha), sky, values),
        srgb_decode_tensor(encoded),
        f0 / cover,
        (roughness / cover)[..., 0],
        glossy[..., 0] if settings.transport else torch.zeros_like(drawn.alpha),
        label[..., 0],
        _unit_normals(drawn, rays),
        _points(drawn, camera, rays),
        added[0] / cover if added else None,
    )


def residual_radiance(values: Mapping[str, torch.Tensor], eye: np.ndarray) -> torch.Tensor:
    """Radiance that glossy surfels add to what they reflect, as an eye sees it, shape ``(N, 3)``.

    Linear, exposed, of either sign. It is 0 in the mean over directions: what is the same in all is diffuse.
    Positions get no gradient, or surfaces would move to where a wrong reflection is explained best.
    """
    harmonics = values[RESIDUAL]
    degree = round((1 + harmonics.shape[1]) ** 0.5) - 1
    coefficients = torch.cat([torch.zeros_like(harmonics[:, :1]), harmonics], dim=1)
    return spherical_harmonics_colours(coefficients, values[CENTRES].detach(), eye, degree)


def _unit_normals(drawn: Maps, rays: torch.Tensor) -> torch.Tensor:
    """Those that face the camera where no surfel is."""
    return normalize(torch.where(drawn.alpha[..., None] > LEAST_COVER, drawn.normal, -rays.float()), dim=-1)


def _points(drawn: Maps, camera: Camera, rays: torch.Tensor) -> torch.Tensor:
    along = (rays / (rays @ rays.new_tensor(camera.forward))[..., None]).float()
    depth = torch.where(drawn.alpha > 0, drawn.depth, 1.0)
    return depth.new_tensor(camera.position, dtype=torch.float32) + along * depth[..., None]


@dataclass(frozen=True, eq=False)
class Reflection:
    """Sources that the reflected rays of R glossy pixels meet."""

    rows: torch.Tensor
    """Shape ``(R,)``: numbers of the pixels, row by row."""
    directions: torch.Tensor
    """Shape ``(R, 3)``, world, unit, away from the surface."""
    radiance: torch.Tensor
    """Shape ``(R, C)``: linear and exposed, or any feature, premultiplied by coverage."""
    passed: torch.Tensor
    """Shape ``(R, 1)``: transmittance."""
    depth: torch.Tensor
    """Shape ``(R, 1)``: distance that rays go, metres; 0 where they meet nothing."""


def reflected_rays(buffers: Buffers) -> tuple[torch.Tensor, Rays]:
    """Return indices of the glossy pixels, and the rays that start there in mirror direction.

    ``w - 2 (w . n) n`` with the view ray w; differentiable in points and normals.
    """
    (rows,) = (buffers.glossy.detach().flatten() > LEAST_GLOSS).nonzero(as_tuple=True)
    view = buffers.rays.float().reshape(-1, 3)[rows]
    normal = buffers.normal.reshape(-1, 3)[rows]
    away = view - 2 * (view * normal).sum(dim=-1, keepdim=True) * normal
    return rows, Rays(buffers.points.reshape(-1, 3)[rows], normalize(away, dim=-1))


def reflected_radiance(
    values: Mapping[str, torch.Tensor], buffers: Buffers, settings: GorisSettings, extent: float
) -> Reflection:
    """Radiance along reflected rays.

    Coefficients of spherical harmonics are blended along the ray and evaluated in its direction afterwards,
    which is the same, as both are linear.

    Args:
        values: Parameters by name.
        buffers: Of a view.
        settings: Of the method.
        extent: Of the scene, metres.
    """
    count = (settings.traced_degree + 1) ** 2
    met_by = traced_surfels(values, settings)
    coefficients = torch.cat([met_by[COEFFICIENTS], met_by[DETAIL]], dim=1)[:, :count]
    rows, rays = reflected_rays(buffers)
    met = trace_rays(surfels_of(met_by), rays, coefficients.flatten(1), near=settings.near * extent)
    blended = met.features.unflatten(-1, (count, 3))
    encoded = spherical_harmonics_colours(blended, rays.directions, np.zeros(3), settings.traced_degree)
    cover = (1 - met.transmittance)[:, None]
    mean = encoded / cover.clamp(min=LEAST_COVER) + 0.5
    radiance = cover * srgb_decode_tensor(mean).clamp(min=0)
    return Reflection(rows, rays.directions, radiance, met.transmittance[:, None], met.depth[:, None])


def traced_surfels(values: Mapping[str, torch.Tensor], settings: GorisSettings) -> dict[str, torch.Tensor]:
    """Parameters of the surfels that reflected rays meet, by name."""
    names = (*GEOMETRY, COEFFICIENTS, DETAIL, REGION, LABEL)
    if settings.traced == "all":
        return {name: values[name] for name in names}
    (rough,) = (values[REGION].detach()[:, 0] > 0).nonzero(as_tuple=True)
    return {name: values[name][rough] for name in names}


def reflected_features(surfels: Surfels, features: torch.Tensor, buffers: Buffers, near: float) -> Reflection:
    """Features ``(N, C)`` of surfels, blended along reflected rays from ``near`` metres on."""
    rows, rays = reflected_rays(buffers)
    met = trace_rays(surfels, rays, features, near=near)
    return Reflection(rows, rays.directions, met.features, met.transmittance[:, None], met.depth[:, None])


def fresnel(buffers: Buffers, reflection: Reflection) -> torch.Tensor:
    """Schlick's Fresnel term of the glossy pixels, shape ``(R, 3)``; the cosine gets no gradient."""
    normal = buffers.normal.detach().reshape(-1, 3)[reflection.rows]
    cosine = (normal * reflection.directions.detach()).sum(dim=-1, keepdim=True).clamp(0, 1)
    f0 = buffers.f0.reshape(-1, 3)[reflection.rows]
    return f0 + (1 - f0) * (1 - cosine) ** 5


def blurred(
    values: Mapping[str, torch.Tensor],
    buffers: Buffers,
    reflection: Reflection,
    settings: GorisSettings,
    extent: float,
) -> torch.Tensor:
    """Radiance and transmittance, blurred in screen space by roughness, shape ``(R, C + 1)``.

    Blurred images are normalised by the blurred mask of pixels with a ray.
    """
    sharp = torch.cat([reflection.radiance, reflection.passed], dim=-1)
    if settings.filter == "none" or len(reflection.rows) == 0:
        return sharp
    height, width = buffers.roughness.shape
    counted = torch.cat([sharp, sharp.new_ones(len(sharp), 1)], dim=-1)
    levels = pyramid(_image(counted, reflection.rows, height, width), settings.filter, buffers.normal)
    blur = translated(values, buffers.roughness, _distances(buffers, reflection, settings, extent))
    soft = filtered(levels, blur).flatten(0, 1)[reflection.rows]
    return soft[:, :-1] / soft[:, -1:].clamp(min=LEAST_COVER)


def _image(pixels: torch.Tensor, rows: torch.Tensor, height: int, width: int) -> torch.Tensor:
    """Pixels ``(R, C)`` in their places, zero elsewhere, shape ``(H, W, C)``."""
    nothing = pixels.new_zeros(height * width, pixels.shape[1])
    return nothing.index_put((rows,), pixels).reshape(height, width, -1)


@torch.no_grad()
def _distances(
    buffers: Buffers, reflection: Reflection, settings: GorisSettings, extent: float
) -> torch.Tensor:
    """Return inputs of the network beside roughness, see :data:`Reading`: in extents or their inverse."""
    drawn = buffers.drawn
    depth = torch.where(drawn.alpha > 0, drawn.depth, extent)[..., None] / extent
    if settings.filter == "paper":
        return depth
    return torch.cat(
        [_image(reflection.depth / extent, reflection.rows, *drawn.alpha.shape), 1 / depth], dim=-1
    )


@dataclass(frozen=True, eq=False)
class GlossyPicture:
    """A rendered picture and its parts."""

    buffers: Buffers
    encoded: torch.Tensor
    """Shape ``(H, W, 3)``."""
    reflected: torch.Tensor
    """Shape ``(H, W, 3)``, linear, exposed: the specular term and its residual; where nothing is glossy the
    former is 0."""


def picture_of(
    values: Mapping[str, torch.Tensor], buffers: Buffers, settings: GorisSettings, extent: float
) -> GlossyPicture:
    """Transport light along reflected rays, and mix rough and glossy radiance by the region.

    Args:
        values: Parameters by name.
        buffers: Of a view.
        settings: Of the method.
        extent: Of the scene, metres.
    """
    reflected = _reflected(values, buffers, settings, extent)
    reflected = reflected if buffers.residual is None else reflected + buffers.residual
    share = buffers.glossy[..., None]
    rough = srgb_decode_tensor(buffers.rough)
    if settings.composite == "paper":
        linear = rough + share * reflected
    else:
        linear = (1 - share) * rough + share * (buffers.diffuse + reflected)
    return GlossyPicture(buffers, srgb_encode_tensor(linear), reflected)


def _reflected(
    values: Mapping[str, torch.Tensor], buffers: Buffers, settings: GorisSettings, extent: float
) -> torch.Tensor:
    if not settings.transport:
        return torch.zeros_like(buffers.diffuse)
    reflection = reflected_radiance(values, buffers, settings, extent)
    light, passed = blurred(values, buffers, reflection, settings, extent).split([3, 1], dim=-1)
    roughness = buffers.roughness.flatten()[reflection.rows]
    sky = reflected_sky(_skies(values[SURROUNDINGS].exp()), reflection.directions, roughness)
    reflected = fresnel(buffers, reflection) * (light + passed * sky)
    return _image(reflected, reflection.rows, *buffers.roughness.shape)


def _skies(surroundings: torch.Tensor) -> tuple[torch.Tensor, ...]:
    """Return the environment as each of the ``ROUGHNESSES`` mirrors it; of a fine one by way of a coarser
    one.
    """
    coarse = surroundings
    if surroundings.shape[1] > LARGEST_FILTERED:
        coarse = adaptive_avg_pool2d(surroundings.movedim(-1, 1), LARGEST_FILTERED).movedim(1, -1)
    return surroundings, *prefiltered_skies(coarse)[1:]


@torch.no_grad()
def effect_of(
    values: Mapping[str, torch.Tensor], buffers: Buffers, settings: GorisSettings, extent: float
) -> torch.Tensor:
    """Share of unit radiance that pixels reflect by way of the object, shape ``(H, W)``, 0 to 1.

    Light transport with labels in place of radiance (the paper's lighting-aware mask).
    """
    met_by = traced_surfels(values, settings)
    reflection = reflected_features(
        surfels_of(met_by), met_by[LABEL].sigmoid(), buffers, settings.near * extent
    )
    soft = blurred(values, buffers, reflection, settings, extent)[:, :1]
    returned = (fresnel(buffers, reflection) * soft).mean(dim=-1, keepdim=True)
    return _image(returned, reflection.rows, *buffers.roughness.shape)[..., 0] * buffers.glossy
