# SPDX-License-Identifier: Apache-2.0
"""All maps on the GPU: gsplat lists which surfel meets which pixel, PyTorch does the rest.

gsplat's own kernel gives every surfel one depth for all pixels, and another distortion (the L1 form), so that
depth, median depth and distortion of the contract cannot be had from it. The cost is memory: about half
a kilobyte, with its gradient, for each pair of a surfel and a pixel.
"""

from dataclasses import dataclass

import torch

from graycard import Camera
from graycard.methods.splat._maps import ALPHA_MAX, ALPHA_MIN, NEAR, TRANSMITTANCE_MIN, ndc_depth
from graycard.methods.splat.cuda._footprints import TILE, Footprints, Kernels

LISTED = 1.001
"""Factor on opacities for the lists, so that rounding leaves out no pair that the contract has."""
PATIENCE = 1e5
"""Initial transmittance of lists. gsplat ends a pixel before 1e-4 is reached, with alpha up to 0.999;
where the contract still draws, two such surfels behind each other leave at least 1e-9."""
FOREVER = 1e30
"""The same, if planes may be met behind the camera: gsplat counts that as absorption too."""


@dataclass(frozen=True)
class _Hits:
    """Pairs of a surfel and a pixel, pixel after pixel, nearest centre first."""

    surfels: torch.Tensor
    """Shape ``(m,)``: rows of the footprints."""
    pixels: torch.Tensor
    """Shape ``(m,)``, row-major."""
    alpha: torch.Tensor
    """Shape ``(m,)``, float64: 0, or from ALPHA_MIN to ALPHA_MAX."""
    depth: torch.Tensor
    """Shape ``(m,)``, float64, metres."""


def draw_pairs(
    kernels: Kernels,
    drawn: Footprints,
    camera: Camera,
    opacities: torch.Tensor,
    features: torch.Tensor,
) -> dict[str, torch.Tensor]:
    """Return the fields of ``Maps``, images of float64.

    Args:
        kernels: Of gsplat, or what stands for them.
        drawn: The n footprints.
        camera: The pinhole camera.
        opacities: shape ``(n,)``.
        features: shape ``(n, C)``.
    """
    hits = _intersect(drawn, camera, opacities, *_pairs(kernels, drawn, camera, opacities))
    values = torch.cat([features.double(), drawn.normals], dim=1)
    maps = _composite(hits, values, camera.width * camera.height)
    size = (camera.height, camera.width)
    return {name: value.reshape(*size, *value.shape[1:]) for name, value in maps.items()}


@torch.no_grad()
def _pairs(
    kernels: Kernels, drawn: Footprints, camera: Camera, opacities: torch.Tensor
) -> tuple[torch.Tensor, torch.Tensor]:
    """Surfel and pixel of each pair: all that the contract draws, and some that it does not."""
    if len(drawn.listed) == 0:
        return drawn.kept[:0], drawn.kept[:0]
    start = torch.full((1, camera.height, camera.width), FOREVER if drawn.crosses else PATIENCE)
    surfels, pixels, _ = kernels.rasterize_to_indices_in_range_2dgs(
        0,
        len(drawn.listed),  # batches, of which there are fewer
        start.to(drawn.boxes.device),
        drawn.boxes[None].float(),
        drawn.to_image[None].float(),
        (LISTED * opacities)[None].float(),
        camera.width,
        camera.height,
        TILE,
        drawn.tile_starts,
        drawn.listed,
    )
    return surfels, pixels


def _intersect(
    drawn: Footprints, camera: Camera, opacities: torch.Tensor, surfels: torch.Tensor, pixels: torch.Tensor
) -> _Hits:
    """Return the equations of the reference: ``M (u, v, 1) = z (x, y, 1)``, solved by cofactors.

    Pixels are taken relative to the centre of the box, far from the image's corner, where the disc is.
    """

    def of_each(values: torch.Tensor) -> torch.Tensor:
        # not values[surfels]: the way back from that sorts all pairs
        return values.index_select(0, surfels)

    cofactors, determinants = _cofactors(drawn.to_image)
    place = torch.nn.functional.pad(drawn.boxes, (0, 1), value=1.0)
    constants = (cofactors * place[:, None]).sum(dim=2)
    middle = torch.stack([pixels % camera.width, pixels // camera.width], dim=1) + 0.5
    p = middle - of_each(drawn.boxes)
    u, v, below = ((of_each(cofactors[:, :, :2]) * p[:, None]).sum(2) + of_each(constants)).unbind(1)
    height = of_each(determinants)
    met = (below > 0) & (height >= NEAR * below)
    below = torch.where(met, below, 1.0)
    disc = torch.where(met, (u**2 + v**2) / below**2, torch.inf)
    low_pass = 2 * (p**2).sum(dim=1)
    alpha = of_each(opacities.double()) * torch.exp(-0.5 * torch.minimum(disc, low_pass))
    alpha = torch.where(alpha >= ALPHA_MIN, alpha.clamp(max=ALPHA_MAX), 0.0)
    depth = torch.where(disc <= low_pass, height / below, of_each(drawn.depths))
    return _Hits(surfels, pixels, alpha, depth)


def _cofactors(M: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
    """Adjugates and determinants of M, both with the sign that makes the determinants positive."""
    first, second, third = M.unbind(dim=2)
    rows = [torch.linalg.cross(second, third), torch.linalg.cross(third, first)]
    adjugates = torch.stack([*rows, torch.linalg.cross(first, second)], dim=1)
    determinants = (adjugates[:, 2] * third).sum(dim=1)
    signs = torch.where(determinants < 0, -1.0, 1.0).to(M.dtype)
    return adjugates * signs[:, None, None], determinants * signs


def _composite(hits: _Hits, values: torch.Tensor, pixels: int) -> dict[str, torch.Tensor]:
    """Return the fields of ``Maps`` with the pixels in one axis."""
    before = _transmittance(hits)
    weight = torch.where(before > TRANSMITTANCE_MIN, before * hits.alpha, 0.0)

    def total(summands: torch.Tensor) -> torch.Tensor:
        return summands.new_zeros(pixels, *summands.shape[1:]).index_add(0, hits.pixels, summands)

    sums = total(weight[:, None] * values.index_select(0, hits.surfels))
    alpha = total(weight)
    covered = torch.where(alpha > 0, alpha, 1.0)
    m = ndc_depth(hits.depth)
    spread = m - (total(weight * m) / covered).index_select(0, hits.pixels)
    return {
        "features": sums[:, :-3],
        "alpha": alpha,
        "depth": total(weight * hits.depth) / covered,
        "median_depth": _median(hits, (weight > 0) & (before > 0.5), pixels),
        "normal": sums[:, -3:],
        "distortion": alpha * total(weight * spread**2),
    }


def _transmittance(hits: _Hits) -> torch.Tensor:
    """Transmittance: what each hit has before it in its pixel, by sums of logarithms over all pixels."""
    fall = torch.log1p(-hits.alpha)
    before = fall.cumsum(dim=0) - fall
    _, which, counts = torch.unique_consecutive(hits.pixels, return_inverse=True, return_counts=True)
    firsts = before.index_select(0, counts.cumsum(dim=0) - counts)
    return torch.exp(before - firsts.index_select(0, which))


def _median(hits: _Hits, eligible: torch.Tensor, pixels: int) -> torch.Tensor:
    """Depth of the last eligible hit of each pixel."""
    rank = torch.arange(1, len(eligible) + 1, device=eligible.device) * eligible
    last = rank.new_zeros(pixels).scatter_reduce(0, hits.pixels, rank, "amax")
    return torch.nn.functional.pad(hits.depth, (1, 0))[last]
