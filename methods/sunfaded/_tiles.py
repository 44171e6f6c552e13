# SPDX-License-Identifier: Apache-2.0
"""Light for tiles of a picture instead of for its pixels: a network is dear, and light is smooth."""

from collections.abc import Mapping
from functools import cache

import numpy as np
import torch

from graycard import Camera
from graycard.methods.sunfaded._light import lamp_intensity
from graycard.methods.sunfaded._settings import LightMap


def tile_side(width: int, share: float) -> int:
    """Pixels on a side of a tile that is a share of the picture's width; 1 or more."""
    return max(1, round(share * width))


def lens_of(camera: Camera) -> torch.Tensor:
    """Points at a depth of one metre behind each pixel's centre, camera axes, shape ``(H, W, 3)``."""
    rays = camera.rays() @ camera.camera_to_world[:3, :3]
    return torch.from_numpy((rays / rays[..., 2:]).astype(np.float32))


def points_of(depth: torch.Tensor, lens: torch.Tensor) -> torch.Tensor:
    """Points that are seen, camera axes, shape ``(H, W, 3)``, metres; no gradient, as in the released code.

    Args:
        depth: Shape ``(H, W)``, z-depth, metres.
        lens: What :func:`lens_of` gives.
    """
    return lens * depth.detach()[..., None]


def lamp_map(
    values: Mapping[str, torch.Tensor], points: torch.Tensor, side: int, kind: LightMap
) -> torch.Tensor:
    """Return the lamp's light at each pixel, found at the middle of each tile.

    Args:
        values: The lamp's parameters.
        points: Shape ``(H, W, 3)``, camera axes, metres.
        side: Of a tile, pixels.
        kind: ``nearest``: the light of its tile; ``bilinear``: between the middles of tiles.

    Returns:
        Shape ``(H, W, 3)``, positive.
    """
    if side == 1:
        return lamp_intensity(values, points)
    height, width, _ = points.shape
    light = lamp_intensity(values, _at_middles(_at_middles(points, side, 0), side, 1))
    spread = _repeated if kind == "nearest" else _between
    return spread(spread(light, height, side, 0), width, side, 1)


def light_evaluations(width: int, height: int, side: int) -> int:
    """Return how often :func:`lamp_map` evaluates the lamp's network for a picture: once a tile.

    Examples:
        >>> light_evaluations(112, 112, 2), light_evaluations(112, 112, 3)
        (3136, 1444)
    """
    return len(tile_middles(height, side)) * len(tile_middles(width, side))


@cache
def tile_middles(length: int, side: int) -> torch.Tensor:
    """Middles of the tiles along an axis, in pixels from the centre of the first pixel.

    Args:
        length: Of the axis, pixels.
        side: Of a tile; the border may cut the last one, whose middle is that of what is left.

    Returns:
        Shape ``(ceil(length / side),)``, rising; halves where a tile has an even number of pixels.

    Examples:
        >>> tile_middles(7, 2), tile_middles(7, 3)
        (tensor([0.5000, 2.5000, 4.5000, 6.0000]), tensor([1., 4., 6.]))
    """
    first = torch.arange(0, length, side)
    last = (first + side - 1).clamp(max=length - 1)
    return (first + last) / 2


def _at_middles(points: torch.Tensor, side: int, axis: int) -> torch.Tensor:
    """Points at the middles of tiles along an axis: between two pixels the mean of both.

    At edges of depth that mixes what is in front with what is behind, as in the released code.
    """
    middles = tile_middles(points.shape[axis], side).to(points.device)
    before, after = (points.index_select(axis, end.long()) for end in (middles.floor(), middles.ceil()))
    return (before + after) / 2


def _repeated(light: torch.Tensor, length: int, side: int, axis: int) -> torch.Tensor:
    """All pixels of a tile have its light."""
    return light.repeat_interleave(side, dim=axis).narrow(axis, 0, length)


def _between(light: torch.Tensor, length: int, side: int, axis: int) -> torch.Tensor:
    """Pixels have the light between the middles of tiles around them; beyond the outermost it is even."""
    before, after, share = (part.to(light.device) for part in _neighbours(length, side))
    weight = share.reshape(-1, *(1,) * (light.ndim - 1 - axis))
    return torch.lerp(light.index_select(axis, before), light.index_select(axis, after), weight)


@cache
def _neighbours(length: int, side: int) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
    """Return for each pixel the tiles whose middles are before and after it, and its share of the way
    between.
    """
    middles, pixels = tile_middles(length, side), torch.arange(length, dtype=torch.float32)
    after = torch.searchsorted(middles, pixels).clamp(max=len(middles) - 1)
    before = (after - 1).clamp(min=0)
    gap = (middles[after] - middles[before]).clamp(min=1.0)
    return before, after, ((pixels - middles[before]) / gap).clamp(0, 1)
