# SPDX-License-Identifier: Apache-2.0
"""The operations in plain PyTorch, differentiated by autograd: for tensors that kernels in Numba cannot read.

They are held to the kernels by tests; the kernels' modules have the sources of the formulas.
"""

from typing import Protocol

import numpy as np
import torch
from torch.nn.functional import conv2d

from graycard.methods.splat.ops._harmonics_basis import harmonics


class PixelFrame(Protocol):
    """Rays of pixels in the world: fields of ``_depth_normal.Frame``."""

    @property
    def rays(self) -> np.ndarray: ...
    @property
    def lens(self) -> np.ndarray: ...
    @property
    def to_camera(self) -> np.ndarray: ...


def compare_images(
    image: torch.Tensor, target: torch.Tensor, terms: tuple[float, float, float]
) -> torch.Tensor:
    """Return ``base + absolute * |x - y| + dissimilar * (1 - SSIM)`` of each pixel and channel.

    Means over windows are taken in float64: variances are differences of squares, which lose the digits of
    float32 on a bright wall.

    Args:
        image: x, shape ``(H, W, C)``, float32.
        target: y, the same, without gradient.
        terms: base, absolute, dissimilar.

    Returns:
        Shape ``(H, W, C)``, float32.
    """
    from graycard.methods.splat.ops._ssim_forward import C1, C2  # Numba takes long to import

    base, absolute, dissimilar = terms
    x, y = image.double(), target.double()
    d = x - y
    mean_x, mean_d, both, square = _windowed(torch.stack([x, d, x * x + y * y, d * d]))
    mean_y = mean_x - mean_d
    means = mean_x**2 + mean_y**2
    a, b = mean_d**2 / (means + C1), (square - mean_d**2) / (both - means + C2)
    return (base + absolute * d.abs() + dissimilar * (a + b - a * b)).to(image.dtype)


def _windowed(layers: torch.Tensor) -> torch.Tensor:
    """Weighted means around pixels of L images ``(L, H, W, C)``, which are zero beyond their border."""
    from graycard.methods.splat.ops._ssim_forward import REACH, window

    weights = layers.new_tensor(window())
    count, height, width, channels = layers.shape
    lines = layers.permute(0, 3, 1, 2).reshape(count * channels, 1, height, width)
    lines = conv2d(lines, weights[None, None, :, None], padding=(REACH, 0))
    lines = conv2d(lines, weights[None, None, None, :], padding=(0, REACH))
    return lines.reshape(count, channels, height, width).permute(0, 2, 3, 1)


def normals_of_depth(depth: torch.Tensor, frame: PixelFrame) -> torch.Tensor:
    """Return the normals of ``depth_to_normals``, shape ``(H, W, 3)``; zero on the border.

    Args:
        depth: Shape ``(H, W)``, metres.
        frame: Of the camera.
    """
    height, width = depth.shape
    if height < 3 or width < 3:
        nothing = torch.where(torch.ones_like(depth, dtype=torch.bool), 0.0, depth)  # a function of the depth
        return nothing[..., None].expand(-1, -1, 3)
    sides = depth[1:-1, :-2], depth[1:-1, 2:], depth[:-2, 1:-1], depth[2:, 1:-1]
    there = torch.stack([~((side <= 0) | (side == torch.inf)) for side in sides]).all(dim=0)
    left, right, above, below = (torch.where(there, side, 1.0) for side in sides)
    rays, lens, to_camera = (depth.new_tensor(part) for part in (frame.rays, frame.lens, frame.to_camera))
    x = rays[0, 1 : width - 1] + rays[1, 1 : height - 1, None]
    y = rays[2, 1 : height - 1, None]
    p = (right - left) / (right + left) * lens[0]
    q = (below - above) / (below + above) * lens[1] - p * lens[2]
    normals = torch.stack([p, q, -(x * p + y * q) - lens[3]], dim=-1)
    normals = normals / normals.norm(dim=-1, keepdim=True)
    normals = torch.where(there[..., None], normals, 0.0) @ to_camera
    return torch.nn.functional.pad(normals, (0, 0, 1, 1, 1, 1))


def normal_mismatch(
    depth: torch.Tensor, normal: torch.Tensor, alpha: torch.Tensor, frame: PixelFrame
) -> torch.Tensor:
    """Return ``1 - alpha N . N_d`` as ``depth_normal_map`` does, shape ``(H, W)``.

    Args:
        depth: Shape ``(H, W)``, metres.
        normal: Shape ``(H, W, 3)``, world.
        alpha: Shape ``(H, W)``, without gradient.
        frame: Of the camera.
    """
    return 1 - alpha * (normals_of_depth(depth, frame) * normal).sum(dim=-1)


def harmonics_sum(
    coefficients: torch.Tensor, centres: torch.Tensor, eye: np.ndarray, used: int
) -> torch.Tensor:
    """Return the sum of coefficients times harmonics, shape ``(N, 3)``; directions are found in float64.

    Args:
        coefficients: Shape ``(N, K, 3)``.
        centres: Shape ``(N, 3)``, metres.
        eye: Shape ``(3,)``, metres.
        used: Number of harmonics that count.
    """
    away = centres.double() - centres.new_tensor(eye, dtype=torch.float64)
    square = (away * away).sum(dim=1, keepdim=True)
    inverse = torch.where(square > 0, torch.where(square > 0, square, 1.0).rsqrt(), 0.0)
    x, y, z = (away * inverse).unbind(dim=1)
    values = harmonics(x, y, z)[:used]
    basis = torch.stack([v if isinstance(v, torch.Tensor) else torch.full_like(x, v) for v in values], dim=1)
    return (basis[..., None] * coefficients[:, :used].double()).sum(dim=1).to(coefficients.dtype)
