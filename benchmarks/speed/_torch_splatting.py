# SPDX-License-Identifier: Apache-2.0
"""torch-splatting (github.com/hbb1/torch-splatting) as a peer, where its folder is on the path.

It is no package of an index, draws three-dimensional Gaussians of three channels, 64 x 64 pixels at a time,
and writes ``"cuda"`` wherever it makes a tensor: these calls are turned to the CPU while it draws. A disc is
handed to it as a Gaussian without thickness, projected as it does (Zwicker et al. 2002, EWA splatting, eq.
29 and 31, with 0.3 square pixels of low-pass): pictures are like those of the discs, not the same.
"""

from types import SimpleNamespace
from typing import Any

import torch
from torch.overrides import TorchFunctionMode

from graycard import Camera
from graycard.methods.splat import FeatureMaps, Surfels, rotation_matrices

PACKAGE = "gaussian_splatting"
"""Its importable folder."""
CHANNELS = 3
TILE = 64
LOW_PASS = 0.3
"""Square pixels."""
ARRAYS = 16
"""About so many float32 arrays of pairs it holds, forward and backward."""


class _OnCpu(TorchFunctionMode):
    """Tensors that are asked to go to CUDA stay where they are."""

    def __torch_function__(self, func: Any, types: Any, args: Any = (), kwargs: Any = None) -> Any:
        if func is torch.Tensor.to and args[1:] == ("cuda",):
            return args[0]
        return func(*args, **(kwargs or {}))


def draw(surfels: Surfels, camera: Camera) -> FeatureMaps:
    """Features ``(H, W, 3)`` and alpha ``(H, W)``, differentiable."""
    from gaussian_splatting.gauss_render import GaussRenderer  # pyright: ignore[reportMissingImports]

    means, covariances, depths = _project(surfels, camera)
    size = SimpleNamespace(image_width=camera.width, image_height=camera.height)
    renderer = GaussRenderer(white_bkgd=False)
    with _OnCpu():
        drawn = renderer.render(
            size, means, covariances, surfels.features, surfels.opacities[:, None], depths
        )
    return FeatureMaps(drawn["render"], drawn["alpha"][..., 0])


@torch.no_grad()
def memory_needed(surfels: Surfels, camera: Camera) -> float:
    """About how many MiB forward and backward take: every Gaussian of a tile at each of its pixels."""
    means, covariances, _ = _project(surfels, camera)
    reach = 3 * covariances.diagonal(dim1=1, dim2=2).amax(dim=1).sqrt()[:, None]
    first = ((means - reach) / TILE).floor().clamp(min=0)
    limit = torch.tensor([camera.width, camera.height]) / TILE
    tiles = (((means + reach) / TILE).ceil().minimum(limit.ceil()) - first).clamp(min=0).prod(dim=1).sum()
    pixels = min(TILE, camera.width) * min(TILE, camera.height)
    return float(tiles) * pixels * ARRAYS * 4 / 2**20


def _project(surfels: Surfels, camera: Camera) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
    """Means ``(N, 2)``, pixel centres being whole numbers, covariances ``(N, 2, 2)``, and depths ``(N,)``."""
    view, K = (surfels.centres.new_tensor(value) for value in (camera.world_to_camera, camera.K))
    at = surfels.centres @ view[:3, :3].T + view[:3, 3]
    x, y, z = at.unbind(dim=1)
    means = torch.stack([K[0, 0] * x / z + K[0, 2], K[1, 1] * y / z + K[1, 2]], dim=1) - 0.5
    none = torch.zeros_like(z)
    slope = torch.stack(
        [
            torch.stack([K[0, 0] / z, none, -K[0, 0] * x / z**2], dim=1),
            torch.stack([none, K[1, 1] / z, -K[1, 1] * y / z**2], dim=1),
        ],
        dim=1,
    )
    axes = slope @ view[:3, :3] @ rotation_matrices(surfels.rotations)[:, :, :2] * surfels.scales[:, None, :]
    covariances = axes @ axes.transpose(1, 2) + LOW_PASS * torch.eye(2, dtype=z.dtype)
    return means, covariances, z
