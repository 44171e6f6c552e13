# SPDX-License-Identifier: Apache-2.0
"""Footprints for gsplat's kernels: projected by our own equations, listed by its kernels."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import torch

from graycard import Camera
from graycard.methods.splat._geometry import box_centres, disc_to_image, see
from graycard.methods.splat._maps import ALPHA_MIN, NEAR
from graycard.methods.splat._surfels import Surfels

TILE = 16
"""Pixels on the side of a tile, the only size that gsplat tests."""


class Kernels(NamedTuple):
    """The functions of gsplat 1.5 that are used here, under its own names."""

    isect_tiles: Callable[..., Any]
    isect_offset_encode: Callable[..., Any]
    rasterize_to_pixels_2dgs: Callable[..., Any]
    rasterize_to_indices_in_range_2dgs: Callable[..., Any]


@dataclass(frozen=True)
class Footprints:
    """The n surfels that can reach ``ALPHA_MIN`` at a pixel, nearest centre first."""

    kept: torch.Tensor
    """Shape ``(n,)``: their indices among the given."""
    depths: torch.Tensor
    """Shape ``(n,)``, float64: z-depth of the centres, metres."""
    normals: torch.Tensor
    """Shape ``(n, 3)``, float64, unit length, world, facing the camera."""
    to_image: torch.Tensor
    """Shape ``(n, 3, 3)``, float64: M = K [s_u t_u, s_v t_v, mu], moved by the offsets; gsplat's
    ``ray_transforms``."""
    boxes: torch.Tensor
    """Shape ``(n, 2)``, float64, pixels: centres of the boxes of the projected discs, moved by the
    offsets; gsplat's ``means2d``."""
    crosses: bool
    """True if a disc reaches behind the camera's plane before its alpha falls below ``ALPHA_MIN``."""
    tile_starts: torch.Tensor
    """Shape ``(1, rows, columns)``, int32: where each tile's list begins."""
    listed: torch.Tensor
    """Shape ``(pairs,)``, int32: rows of this footprint, tile after tile."""


class _Reach(NamedTuple):
    """Boxes of what surfels can touch, in pixels, cut to the image; empty where low >= high."""

    low: torch.Tensor
    high: torch.Tensor
    crosses: torch.Tensor


def footprints(kernels: Kernels, surfels: Surfels, camera: Camera, offsets: torch.Tensor) -> Footprints:
    """Project, cull, sort and list surfels.

    The projection is ours and in float64: that of gsplat loses digits where discs are seen edge-on, knows no
    skew, moves nothing by offsets, and its boxes of 3.33 standard deviations, symmetric about the centre,
    cut off a part of discs that are near.

    Args:
        kernels: Of gsplat, or what stands for them.
        surfels: N surfels.
        camera: The pinhole camera.
        offsets: shape ``(N, 2)``, float64, pixels.
    """
    seen = see(in_float64(surfels), camera)
    M, boxes = disc_to_image(seen, camera).mT, box_centres(seen, camera) + offsets
    reach = _reach(M.detach(), boxes.detach(), surfels.opacities.detach().double(), offsets.detach(), camera)
    shown = (reach.low < reach.high).all(dim=1) & (seen.centres[:, 2] > NEAR)
    shown = (shown & (surfels.opacities >= ALPHA_MIN)).nonzero()[:, 0]
    kept = shown[seen.centres[shown, 2].argsort(stable=True)]
    moved = M + torch.nn.functional.pad(offsets, (0, 1))[:, :, None] * M[:, 2:]
    return Footprints(
        kept,
        seen.centres[kept, 2],
        seen.normals[kept] @ M.new_tensor(camera.camera_to_world[:3, :3]).T,
        moved[kept],
        boxes[kept],
        bool(reach.crosses[kept].any()),
        *_tile_lists(kernels, reach.low[kept], reach.high[kept], camera),
    )


def in_float64(surfels: Surfels) -> Surfels:
    """Return the projection cancels digits where discs are seen edge-on; float32 would lose them."""
    return Surfels(
        surfels.centres.double(),
        surfels.rotations.double(),
        surfels.scales.double(),
        surfels.opacities.double(),
        surfels.features.double(),
    )


def _reach(
    M: torch.Tensor, boxes: torch.Tensor, opacities: torch.Tensor, offsets: torch.Tensor, camera: Camera
) -> _Reach:
    """Boxes of the discs, cut where alpha falls below ``ALPHA_MIN``, and of their low-passes.

    The rim of the disc of r standard deviations, projected, is a conic; with f = (r^2, r^2, -1) its box has
    the centre c = ``f m1 m3 / f m3 m3`` and half the width ``sqrt(c^2 - f m1 m1 / f m3 m3)``.
    """
    square = 2 * torch.log(opacities / ALPHA_MIN).clamp(min=0)
    f = torch.stack([square, square, -torch.ones_like(square)], dim=1)[:, None]
    norm = (f * M[:, 2:] ** 2).sum(dim=2)
    whole = norm < 0
    norm = torch.where(whole, norm, -1.0)
    middle = (f * M[:, :2] * M[:, 2:]).sum(dim=2) / norm
    half = (middle**2 - (f * M[:, :2] ** 2).sum(dim=2) / norm).clamp(min=0).sqrt()
    middle, radius = middle + offsets, (square / 2).sqrt()[:, None]
    low = torch.where(whole, torch.minimum(middle - half, boxes - radius), -torch.inf)
    high = torch.where(whole, torch.maximum(middle + half, boxes + radius), torch.inf)
    size = low.new_tensor([camera.width, camera.height])
    return _Reach(low.clamp(min=0).minimum(size), high.clamp(min=0).minimum(size), ~whole[:, 0])


def _tile_lists(
    kernels: Kernels, low: torch.Tensor, high: torch.Tensor, camera: Camera
) -> tuple[torch.Tensor, torch.Tensor]:
    """Ranks: gsplat sorts by the bits of a positive float32, and we by float64."""
    columns, rows = -(-camera.width // TILE), -(-camera.height // TILE)
    if len(low) == 0:  # on which gsplat's kernels divide by zero
        empty = torch.zeros(0, dtype=torch.int32, device=low.device)
        return torch.zeros(1, rows, columns, dtype=torch.int32, device=low.device), empty
    ranks = torch.arange(1, len(low) + 1, dtype=torch.float32, device=low.device)
    radii = torch.ceil((high - low) / 2 + 1).to(torch.int32)
    boxes = ((low + high) / 2).float()
    _, keys, listed = kernels.isect_tiles(boxes[None], radii[None], ranks[None], TILE, columns, rows)
    return kernels.isect_offset_encode(keys, 1, columns, rows), listed
