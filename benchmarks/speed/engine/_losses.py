# SPDX-License-Identifier: Apache-2.0
"""The losses beside what one writes in torch: a training step is no faster than its slowest part."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
import torch

from graycard import Camera, Progress
from graycard.benchmarks.speed._machine import Patience, time_calls
from graycard.benchmarks.speed.engine._records import LossCost
from graycard.benchmarks.speed.engine._scenes import Workload, engine_camera
from graycard.io import silent
from graycard.methods.splat import depth_normal_map, photometric_map

Loss = Callable[[torch.Tensor, torch.Tensor], torch.Tensor]
WINDOW, SIGMA, C1, C2 = 11, 1.5, 0.01**2, 0.03**2


@dataclass(frozen=True)
class _Case:
    """A loss of two images, ours and that of torch; gradients are of the first."""

    name: str
    images: tuple[torch.Tensor, torch.Tensor]
    ours: Loss
    theirs: Loss


def measure_losses(sizes: tuple[int, ...], patience: Patience, progress: Progress = silent) -> list[LossCost]:
    """Forward and backward of each loss on images of three channels and random values.

    Args:
        sizes: Pixels on each side.
        patience: How long to measure.
        progress: Told about each size.
    """
    costs = []
    for number, size in enumerate(sizes):
        progress(number / len(sizes), f"losses at {size} px")
        for case in _cases(size):
            ours, theirs = (
                time_calls(partial(_both, loss, *case.images), patience) for loss in (case.ours, case.theirs)
            )
            costs.append(LossCost(case.name, size, 3, ours, theirs))
    return costs


def _cases(size: int) -> list[_Case]:
    random = torch.Generator().manual_seed(0)
    image, target = (torch.rand(size, size, 3, generator=random) for _ in range(2))
    depth, alpha = 2 + 0.1 * torch.rand(size, size, generator=random), torch.ones(size, size)
    camera = engine_camera(Workload("", 0, size, 1.0))
    return [
        _Case("L1 + SSIM", (image, target), photometric_map, torch_photometric),
        _Case(
            "depth-normal",
            (depth, target),
            lambda depth, normal: depth_normal_map(depth, normal, alpha, camera),
            lambda depth, normal: torch_depth_normal(depth, normal, alpha, camera),
        ),
    ]


def _both(loss: Loss, first: torch.Tensor, second: torch.Tensor) -> torch.Tensor:
    """Return the gradient of the first image by the mean of the loss."""
    leaf = first.detach().requires_grad_()
    return torch.autograd.grad(loss(leaf, second).mean(), leaf)[0]


def torch_photometric(image: torch.Tensor, target: torch.Tensor) -> torch.Tensor:
    """0.8 L1 + 0.2 (1 - SSIM) as the code of 3D Gaussian Splatting has it, ``(H, W, C)``."""
    line = torch.exp(-0.5 * (torch.arange(WINDOW) - WINDOW // 2) ** 2 / SIGMA**2)
    line = line / line.sum()
    channels = image.shape[2]
    window = torch.outer(line, line).expand(channels, 1, WINDOW, WINDOW).contiguous()

    def mean(values: torch.Tensor) -> torch.Tensor:
        return torch.nn.functional.conv2d(values, window, padding=WINDOW // 2, groups=channels)

    x, y = image.permute(2, 0, 1)[None], target.permute(2, 0, 1)[None]
    mean_x, mean_y = mean(x), mean(y)
    variances = mean(x * x) - mean_x**2 + mean(y * y) - mean_y**2
    covariance = mean(x * y) - mean_x * mean_y
    above = (2 * mean_x * mean_y + C1) * (2 * covariance + C2)
    ssim = above / ((mean_x**2 + mean_y**2 + C1) * (variances + C2))
    return 0.8 * (image - target).abs() + 0.2 * (1 - ssim[0].permute(1, 2, 0))


def torch_depth_normal(
    depth: torch.Tensor, normal: torch.Tensor, alpha: torch.Tensor, camera: Camera
) -> torch.Tensor:
    """Return the depth-normal loss as the code of 2D Gaussian Splatting has it, ``(H, W)``."""
    y, x = torch.meshgrid(torch.arange(camera.height), torch.arange(camera.width), indexing="ij")
    pixels = torch.stack([x + 0.5, y + 0.5, torch.ones_like(x)], dim=-1)
    to_world = camera.camera_to_world[:3, :3] @ np.linalg.inv(camera.K)
    points = (pixels @ torch.from_numpy(to_world.T.copy()).float()) * depth[..., None]
    down, right = points[2:, 1:-1] - points[:-2, 1:-1], points[1:-1, 2:] - points[1:-1, :-2]
    normals = torch.nn.functional.normalize(torch.linalg.cross(down, right), dim=-1)
    drawn = torch.nn.functional.pad(normals, (0, 0, 1, 1, 1, 1)) * alpha.detach()[..., None]
    return 1 - (normal * drawn).sum(dim=-1)
