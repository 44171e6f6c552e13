# SPDX-License-Identifier: Apache-2.0
"""Light from far away on surfaces: a cubemap filtered once for all, and the split sum (Karis 2013).

The diffuse part is the irradiance at the normal. The specular part is the mean of the sky over the lobe
around the mirror direction, as if it were seen from there, times what the GGX lobe returns of an even sky.
Nothing stands in the way of the light. In an even sky both are exact; else the specular part neglects
that a lobe becomes long and is cut off by the horizon at grazing angles.
"""

from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple

import torch
from torch.nn.functional import avg_pool2d, normalize

from graycard.methods.shading._cubemap import (
    look_up,
    look_up_between,
    solid_angles,
    texel_directions,
    turned_texels,
)
from graycard.methods.shading._material import MIN_ALPHA, Lobes, Material, smith_shadowing

ROUGHNESSES = (0.0, 0.2, 0.4, 0.6, 0.8, 1.0)
"""Roughness of the filtered skies; between them it is interpolated. The first is the sky itself."""
_POINTS = 32
_SIZES = ((16, 2 * _POINTS), (16, _POINTS), (8, _POINTS), (8, _POINTS), (8, _POINTS))
"""Sizes of the others: texels along the side of a face, and points along it over which kernels are
integrated, as their lobes need."""
_IRRADIANCE_SIZE = 16
_AT_ONCE = 2**20
"""Values of a kernel that are held at once while it is made."""


class Surroundings(NamedTuple):
    """A sky, filtered."""

    irradiance: torch.Tensor
    """Cubemap over normals, W/m²."""
    skies: tuple[torch.Tensor, ...]
    """One cubemap for each of the :data:`ROUGHNESSES`, over mirror directions, W/m²/sr."""


def surroundings_of(sky: torch.Tensor) -> Surroundings:
    """Filter a sky.

    Args:
        sky: Cubemap ``(6, N, N, 3)``, W/m²/sr. The kernels of a new size N are made when it is first used.

    Returns:
        Linear in the sky, and differentiable.
    """
    return Surroundings(_filtered(_from_each_face(sky), _matte_kernel(sky.shape[1])), prefiltered_skies(sky))


def prefiltered_skies(sky: torch.Tensor) -> tuple[torch.Tensor, ...]:
    """Subset that :class:`Surroundings` holds for glossy surfaces, where no matte one is lit.

    Args:
        sky: As for :func:`surroundings_of`.

    Returns:
        One cubemap for each of the :data:`ROUGHNESSES`.
    """
    around = _from_each_face(sky)
    return (sky, *(_filtered(around, kernel) for kernel in _glossy_kernels(sky.shape[1])))


def _from_each_face(sky: torch.Tensor) -> torch.Tensor:
    """Return the texels of a sky with the cube turned so that each face in its turn is the first, ``(T, 6,
    3)``.
    """
    channels = sky.shape[-1]
    texels = sky.reshape(-1, channels).index_select(0, _order_from_each_face(sky.shape[1]).to(sky.device))
    return texels.reshape(-1, 6, channels)


@lru_cache(maxsize=8)
def _order_from_each_face(size: int) -> torch.Tensor:
    return turned_texels(size).argsort(dim=1).T.reshape(-1)


def _filtered(around: torch.Tensor, kernel: torch.Tensor) -> torch.Tensor:
    """Return a cubemap of which each face is filtered by the kernel of the first.

    Args:
        around: Of :func:`_from_each_face`.
        kernel: Shape ``(N², T)``, of :func:`_kernel`.

    Returns:
        Shape ``(6, N, N, 3)``.
    """
    size = round(len(kernel) ** 0.5)
    faces = kernel.to(around) @ around.flatten(1)
    return faces.reshape(size, size, *around.shape[1:]).permute(2, 0, 1, 3)


def lit_by_surroundings(
    material: Material, normal: torch.Tensor, eye: torch.Tensor, surroundings: Surroundings
) -> Lobes:
    """Radiance that surfaces return of the surroundings, nothing in the way, each lobe of ``(..., 3)``.

    Args:
        material: Of surfaces of shape ``(...)``.
        normal: Shape ``(..., 3)``, unit.
        eye: Shape ``(..., 3)``, unit, from the surface to the eye.
        surroundings: Light.
    """
    cosine = (normal * eye).sum(dim=-1)
    mirrored = 2 * cosine[..., None] * normal - eye
    sky = reflected_sky(surroundings.skies, mirrored, material.roughness)
    scale, offset = even_sky(material.roughness, cosine).unbind(dim=-1)
    returned = material.f0 * scale[..., None] + offset[..., None]
    diffuse = material.diffuse / torch.pi * look_up(surroundings.irradiance, normal)
    return Lobes(diffuse, returned * sky)


def reflected_sky(
    skies: Sequence[torch.Tensor], directions: torch.Tensor, roughness: torch.Tensor
) -> torch.Tensor:
    """Return what surfaces of a roughness mirror: linear between the two filtered skies that are nearest to
    it.

    Args:
        skies: Of :func:`prefiltered_skies`.
        directions: Shape ``(..., 3)``, world, unit: of mirrored rays.
        roughness: Shape ``(...)``, 0 to 1.

    Returns:
        Shape ``(..., 3)``, of the unit of the sky; differentiable in all three.
    """
    return look_up_between(skies, directions, roughness * (len(skies) - 1))


def even_sky(roughness: torch.Tensor, cosine: torch.Tensor) -> torch.Tensor:
    """Factor of f0 and offset in what the GGX lobe returns of an even sky of radiance 1.

    Interpolated in a table over roughness and the root of the cosine, to about 1e-3.

    Args:
        roughness: Shape ``(...)``, 0 to 1.
        cosine: Shape ``(...)``, between the normal and the eye; below 0 counts as 0.

    Returns:
        Shape ``(..., 2)``; differentiable in both.
    """
    table = _table().to(roughness)
    rows, columns = table.shape[0] - 1, table.shape[1] - 1
    y = (roughness * rows).clamp(0, rows)
    x = (cosine.clamp(min=1e-6).sqrt() * columns).clamp(max=columns)
    top, left = y.detach().floor().clamp(max=rows - 1), x.detach().floor().clamp(max=columns - 1)
    down, across = (y - top)[..., None], (x - left)[..., None]
    i, j = top.long(), left.long()
    upper = table[i, j] * (1 - across) + table[i, j + 1] * across
    lower = table[i + 1, j] * (1 - across) + table[i + 1, j + 1] * across
    return upper * (1 - down) + lower * down


@lru_cache(maxsize=4)
def _matte_kernel(size: int) -> torch.Tensor:
    """Return what each texel of a sky adds to irradiance."""
    return _kernel(size, _IRRADIANCE_SIZE, _POINTS, None)


@lru_cache(maxsize=4)
def _glossy_kernels(size: int) -> tuple[torch.Tensor, ...]:
    """Return what each texel of a sky adds to each filtered one, but for the first."""
    found = []
    for roughness, (own, points) in zip(ROUGHNESSES[1:], _SIZES, strict=True):
        kernel = _kernel(size, own, points, max(roughness**2, MIN_ALPHA))
        found.append(kernel / kernel.sum(dim=1, keepdim=True))
    return tuple(found)


def _kernel(size: int, own: int, points: int, alpha: float | None) -> torch.Tensor:
    """Integrals over texels of the sky of what a surface returns along its normal, up to a factor.

    Shape ``(own², 6 size²)``, float32, for normals through the texels of the first face; of a matte surface
    without ``alpha``.
    """
    per_side = max(1, points // size)
    axes, directions = (
        torch.from_numpy(found.reshape(-1, 3)).float()
        for found in (texel_directions(own)[0], texel_directions(size, per_side))
    )
    angles = torch.from_numpy(solid_angles(size * per_side)).float().repeat(6, 1).ravel()
    faces = (-1, 6, size * per_side, size * per_side)
    parts = [
        avg_pool2d((_lobe(some @ directions.T, alpha) * angles).reshape(faces), per_side).flatten(1)
        for some in axes.split(max(1, _AT_ONCE // len(directions)))
    ]
    return torch.cat(parts) * per_side**2


def _lobe(cosine: torch.Tensor, alpha: float | None) -> torch.Tensor:
    """``max(0, n.l)``, or GGX's ``D(h) G(l)`` up to a factor; on the normal ``n.h² = (1 + n.l) / 2``."""
    above = cosine.relu()
    if alpha is None:
        return above
    squared = (1 + above) / 2
    return smith_shadowing(above, above.new_tensor(alpha)) / (1 - squared + alpha**2 * squared).square()


@lru_cache(maxsize=1)
def _table(rows: int = 33, columns: int = 33, samples: int = 64) -> torch.Tensor:
    """Return the table of :func:`even_sky`, shape ``(rows, columns, 2)``, float64.

    Microfacets are taken as the eye sees them (Heitz 2018), each then returns its Fresnel term times the
    shadowing of the light.
    """
    roughness, root = torch.meshgrid(
        torch.linspace(0, 1, rows, dtype=torch.float64),
        torch.linspace(0, 1, columns, dtype=torch.float64),
        indexing="ij",
    )
    alpha = roughness.square().clamp(min=MIN_ALPHA)[..., None, None]
    cos_v = root.square().clamp(min=1e-6)[..., None, None]
    steps = (torch.arange(samples, dtype=torch.float64) + 0.5) / samples
    radius, weights = (
        (1 - steps**4).sqrt()[:, None],
        (4 * steps**3)[:, None],
    )  # dense at the rim, as steep facets are
    middle = _seen_facets(alpha, cos_v, radius, 2 * torch.pi * steps[None, :])
    eye = torch.stack([(1 - cos_v**2).sqrt(), torch.zeros_like(cos_v), cos_v], dim=-1)
    cos_h = (middle * eye).sum(dim=-1)
    cos_l = 2 * cos_h * middle[..., 2] - cos_v
    returned = weights * torch.where(cos_l > 0, smith_shadowing(cos_l.clamp(min=0), alpha), 0.0)
    grazing = (1 - cos_h.clamp(0, 1)) ** 5
    parts = (returned * (1 - grazing)).mean(dim=(2, 3)), (returned * grazing).mean(dim=(2, 3))
    return torch.stack(parts, dim=-1)


def _seen_facets(
    alpha: torch.Tensor, cos_v: torch.Tensor, radius: torch.Tensor, angle: torch.Tensor
) -> torch.Tensor:
    """Return normals of the microfacets that an eye in the xz plane sees, of the shapes broadcast and
    ``(3,)``.

    ``radius`` and ``angle`` are places on a disc, which they fill as evenly as the eye sees their facets.
    """
    stretched_x = alpha * (1 - cos_v**2).sqrt()
    length = (stretched_x**2 + cos_v**2).sqrt()
    sine, cosine = stretched_x / length, cos_v / length
    first, second = radius * angle.cos(), radius * angle.sin()
    share = (1 + cosine) / 2
    second = (1 - share) * (1 - first**2).sqrt() + share * second
    third = (1 - first**2 - second**2).clamp(min=0).sqrt()
    # axes of the projected half disc: y, (-cosine, 0, sine) and the stretched eye
    x, z = -cosine * second + sine * third, sine * second + cosine * third
    middle = torch.stack([alpha * x, (alpha * first).expand_as(x), z.clamp(min=0)], dim=-1)
    return normalize(middle, dim=-1)
