# SPDX-License-Identifier: Apache-2.0
"""Stand in for gsplat's kernels without a GPU, by its own PyTorch code and its rules for pixels.

It is written from the CUDA sources of gsplat 1.5.3, its rules for ending a pixel included.
"""

from typing import Any
from unittest.mock import patch

import torch

from graycard.benchmarks.speed import _gsplat as peer
from graycard.methods.splat.cuda._footprints import Kernels

ALPHA_MIN, ALPHA_MAX, TRANSMITTANCE_MIN = 1 / 255, 0.999, 1e-4
"""Limits of gsplat's kernels."""


def indices_in_range(
    start: int,
    end: int,
    transmittances: torch.Tensor,
    means2d: torch.Tensor,
    ray_transforms: torch.Tensor,
    opacities: torch.Tensor,
    width: int,
    height: int,
    tile: int,
    offsets: torch.Tensor,
    listed: torch.Tensor,
) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
    """``rasterize_to_indices_in_range_2dgs`` for one image, pixel by pixel, in float32."""
    assert means2d.dtype == ray_transforms.dtype == opacities.dtype == transmittances.dtype == torch.float32
    assert means2d.shape[1] > 0, "the kernel divides by it"
    bounds = [*offsets.flatten().tolist(), len(listed)]
    columns, found = offsets.shape[2], []
    for pixel in range(width * height):
        x, y = pixel % width, pixel // width
        place = y // tile * columns + x // tile
        ids = listed[bounds[place] : bounds[place + 1]].long()[start * tile**2 : end * tile**2]
        alpha = _alpha(x + 0.5, y + 0.5, means2d[0, ids], ray_transforms[0, ids], opacities[0, ids])
        ids, alpha = ids[alpha >= ALPHA_MIN], alpha[alpha >= ALPHA_MIN]
        after = transmittances[0, y, x] * torch.cumprod(1 - alpha, dim=0)
        ids = ids[after > TRANSMITTANCE_MIN]
        found.append(torch.stack([ids, torch.full_like(ids, pixel)]))
    surfels, pixels = torch.cat(found, dim=1)
    return surfels, pixels, torch.zeros_like(pixels)


def _alpha(
    x: float, y: float, means2d: torch.Tensor, M: torch.Tensor, opacities: torch.Tensor
) -> torch.Tensor:
    cross = torch.linalg.cross(x * M[:, 2] - M[:, 0], y * M[:, 2] - M[:, 1])
    disc = ((cross[:, :2] / cross[:, 2:]) ** 2).sum(dim=1)
    low_pass = 2 * ((means2d - means2d.new_tensor([x, y])) ** 2).sum(dim=1)
    alpha = (opacities * torch.exp(-0.5 * torch.minimum(disc, low_pass))).clamp(max=ALPHA_MAX)
    return torch.where(cross[:, 2] == 0, 0.0, alpha)


def pixels_2dgs(
    means2d: torch.Tensor,
    ray_transforms: torch.Tensor,
    colors: torch.Tensor,
    opacities: torch.Tensor,
    normals: torch.Tensor,
    densify: torch.Tensor,
    *rest: Any,
) -> tuple[torch.Tensor | None, ...]:
    """``rasterize_to_pixels_2dgs`` by gsplat's own PyTorch code."""
    from gsplat.cuda import _torch_impl_2dgs, _wrapper

    assert colors.shape[2] in (1, 2, 3, 4, 8, 16, 32), "compiled for no other, padded with what memory holds"
    assert densify.shape == means2d.shape
    with (
        peer.nerfacc_on_cpu(),
        patch.object(_wrapper, "rasterize_to_indices_in_range_2dgs", indices_in_range),
    ):
        drawn = _torch_impl_2dgs._rasterize_to_pixels_2dgs(
            means2d, ray_transforms, colors, normals, opacities, *rest
        )
    connected = 0 * means2d.sum()  # as a kernel is, also where it draws nothing
    return *(image + connected for image in drawn), None, None


def stand_ins() -> Kernels:
    from gsplat.cuda import _torch_impl

    return Kernels(_torch_impl._isect_tiles, _torch_impl._isect_offset_encode, pixels_2dgs, indices_in_range)
