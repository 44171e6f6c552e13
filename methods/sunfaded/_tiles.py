# SPDX-License-Identifier: Apache-2.0
"""Light for tiles of a picture instead of for its pixels: a network is dear, and light is smooth."""

from collections.abc import Mapping

import numpy as np
import torch
from torch.nn.functional import interpolate

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
    """What the lamp sends to each pixel, found once a tile.

    Args:
        values: The lamp's parameters.
        points: Shape ``(H, W, 3)``, camera axes, metres.
        side: Of a tile, pixels.
        kind: How tiles become pixels.

    Returns:
        Shape ``(H, W, 3)``, positive.
    """
    if side == 1:
        return lamp_intensity(values, points)
    return _nearest(values, points, side) if kind == "nearest" else _bilinear(values, points, side)


def light_evaluations(width: int, height: int, side: int, kind: LightMap) -> int:
    """How often :func:`lamp_map` asks the lamp's network for a picture.

    Example:
        >>> light_evaluations(112, 112, 2, "nearest"), light_evaluations(112, 112, 3, "nearest")
        (3136, 1444)
    """
    if side > 1 and kind == "bilinear":
        return max(1, height // side) * max(1, width // side)
    return len(_middles(height, side)) * len(_middles(width, side))


def _nearest(values: Mapping[str, torch.Tensor], points: torch.Tensor, side: int) -> torch.Tensor:
    """Each tile has the light of its middle; the last ones of a row may be cut off by the border."""
    height, width, _ = points.shape
    rows, columns = _middles(height, side), _middles(width, side)
    light = lamp_intensity(values, points[rows][:, columns])
    spread = light.repeat_interleave(side, dim=0).repeat_interleave(side, dim=1)
    return spread[:height, :width]


def _middles(length: int, side: int) -> torch.Tensor:
    return (torch.arange(0, length, side) + side // 2).clamp(max=length - 1)


def _bilinear(values: Mapping[str, torch.Tensor], points: torch.Tensor, side: int) -> torch.Tensor:
    """Points resampled to the tiles, their light to the pixels; at edges of depth points are mixed."""
    height, width, _ = points.shape
    tiles = max(1, height // side), max(1, width // side)
    light = lamp_intensity(values, _resampled(points, tiles))
    return _resampled(light, (height, width))


def _resampled(image: torch.Tensor, size: tuple[int, int]) -> torch.Tensor:
    channels_first = image.movedim(-1, 0)[None]
    return interpolate(channels_first, size, mode="bilinear", align_corners=False)[0].movedim(0, -1)
