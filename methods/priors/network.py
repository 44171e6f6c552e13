# SPDX-License-Identifier: Apache-2.0
"""A small U-Net that tells geometry and material from one picture: what graycard's own weights are for."""

from itertools import pairwise

import numpy as np
import torch
from torch import nn
from torch.nn.functional import interpolate, pixel_shuffle, pixel_unshuffle, relu

from graycard.methods._tensors import float_tensor

WIDTHS = (48, 96, 144, 160)
"""Channels at half, a quarter, an eighth and a sixteenth of the picture's sides."""
HEADS = {"normal": 3, "depth": 1, "base_color": 3, "roughness": 1, "metallic": 1, "seen": 1}
"""Channels of what is told, in the order of the last layer."""
CONTRAST = 500.0
"""Steepness of the curve that compresses pictures: a flash leaves corners at a thousandth of white."""
SIDE = 112
"""Pixels along the side of a picture that the network knows."""
STEP = 16
"""Pixels that the sides of a picture are a multiple of."""
_GROUPS = 8


class _Unit(nn.Module):
    """Two convolutions, around which the input goes past."""

    def __init__(self, width: int) -> None:
        super().__init__()
        self.first = nn.Conv2d(width, width, 3, padding=1, bias=False)
        self.second = nn.Conv2d(width, width, 3, padding=1, bias=False)
        self.norms = nn.ModuleList(nn.GroupNorm(_GROUPS, width) for _ in range(2))

    def forward(self, given: torch.Tensor) -> torch.Tensor:
        """Return values of the input's shape."""
        inside = self.first(relu(self.norms[0](given)))
        return given + self.second(relu(self.norms[1](inside)))


class GeometryNet(nn.Module):
    """From a picture and the rays of its pixels to normals, depth and material.

    Works at half the picture's size: 2 by 2 pixels are folded into channels, and out of them at the end.
    """

    def __init__(self) -> None:
        super().__init__()
        self.stem = nn.Conv2d(5 * 4, WIDTHS[0], 3, padding=1)
        self.down = nn.ModuleList(
            nn.Conv2d(fine, coarse, 3, stride=2, padding=1) for fine, coarse in pairwise(WIDTHS)
        )
        self.units = nn.ModuleList(_Unit(width) for width in WIDTHS)
        self.up = nn.ModuleList(
            nn.Conv2d(coarse + fine, fine, 3, padding=1) for fine, coarse in pairwise(WIDTHS)
        )
        self.again = nn.ModuleList(_Unit(width) for width in WIDTHS[:-1])
        self.last = nn.GroupNorm(_GROUPS, WIDTHS[0])
        self.head = nn.Conv2d(WIDTHS[0], 4 * sum(HEADS.values()), 3, padding=1)

    def forward(self, given: torch.Tensor) -> dict[str, torch.Tensor]:
        """Return what is told, by name in :data:`HEADS`.

        Args:
            given: Shape ``(N, 5, H, W)``, of :func:`inputs_of`; sides are multiples of 16.

        Returns:
            Each ``(N, C, H, W)``, float32: ``normal`` in camera axes, unit length; ``depth`` as its natural
            log, metres; ``base_color`` encoded for display, ``roughness`` and ``metallic`` in [0, 1];
            ``seen`` as the log-odds that there is a surface.
        """
        now, fine = self.stem(pixel_unshuffle(given, 2)), []
        for level, unit in enumerate(self.units):
            now = unit(now if level == 0 else self.down[level - 1](now))
            fine.append(now)
        for level in reversed(range(len(self.up))):
            larger = interpolate(now, scale_factor=2.0, mode="nearest")
            now = self.again[level](self.up[level](torch.cat([larger, fine[level]], dim=1)))
        told = pixel_shuffle(self.head(relu(self.last(now))), 2).float()
        parts = dict(zip(HEADS, told.split(list(HEADS.values()), dim=1), strict=True))
        parts["normal"] = parts["normal"] / parts["normal"].norm(dim=1, keepdim=True).clamp_min(1e-6)
        for name in ("base_color", "roughness", "metallic"):
            parts[name] = torch.sigmoid(parts[name])
        return parts


def inputs_of(image: torch.Tensor, rays: torch.Tensor) -> torch.Tensor:
    """Return what the network sees, ``(N, 5, H, W)``: the picture compressed to [0, 1], then the rays.

    Args:
        image: Shape ``(N, 3, H, W)``, linear, display range; what is beyond white is cut off.
        rays: Shape ``(N, 2, H, W)``: x and y of each pixel's ray where its z is 1, in camera axes.
    """
    shown = torch.log1p(CONTRAST * image.clamp(0, 1)) / float(np.log1p(CONTRAST))
    return torch.cat([shown, rays], dim=1)


def rays_of(K: np.ndarray, height: int, width: int) -> torch.Tensor:
    """Return x and y of the rays through pixel centres where z is 1, ``(2, H, W)``, float32."""
    across = (np.arange(width) + 0.5 - K[0, 2]) / K[0, 0]
    down = (np.arange(height) + 0.5 - K[1, 2]) / K[1, 1]
    return float_tensor(np.stack(np.meshgrid(across, down)))
