# SPDX-License-Identifier: Apache-2.0
"""Inception v3 as TensorFlow published it in 2015: the network of FID and KID.

The weights keep the names of its graph, and the order of convolutions follows from them.
"""

from collections.abc import Mapping
from typing import TYPE_CHECKING

from graycard.networks._store import read_weights, weights_path

if TYPE_CHECKING:
    import torch

    Weights = Mapping[str, torch.Tensor]

SIDE = 299
"""Side of the pictures that it was trained on, pixels."""
_HALVING = {
    "conv", "mixed_3.conv", "mixed_3.tower.conv_2", "mixed_8.tower.conv_1", "mixed_8.tower_1.conv_3",
}  # fmt: skip
"""Convolutions with a stride of 2, which look at no pixel beyond the border."""
_VALID = _HALVING | {"conv_1", "conv_4"}
"""All convolutions that look at no pixel beyond the border."""
_STEPS = ("conv", "conv_1", "conv_2", "conv_3", "conv_4")
"""Names of convolutions in a tower, one after the other."""


def has_inception() -> bool:
    """Tell whether the weights were fetched."""
    return weights_path("inception").is_file()


def inception_weights() -> "Weights":
    """Return the fetched weights by name.

    Raises:
        WeightsError: They were not fetched, or are not what was fetched.
    """
    import torch

    return {name: torch.tensor(array) for name, array in read_weights("inception").items()}


def inception_features(pictures: "torch.Tensor", weights: "Weights") -> "torch.Tensor":
    """Return the features of pictures after the last pooling: the 2048 numbers of FID.

    Args:
        pictures: shape ``(N, 3, H, W)``, display values in [0, 1].
        weights: Of the network, by name.

    Returns:
        Shape ``(N, 2048)``, 0 or more.
    """
    from torch.nn.functional import max_pool2d

    # TensorFlow's range of 8-bit pictures, (v - 128) / 128
    x = resized(pictures.clamp(0, 1)) * (255 / 128) - 1
    for name in ("conv", "conv_1", "conv_2"):
        x = _convolved(x, name, weights)
    x = max_pool2d(x, 3, 2)
    for name in ("conv_3", "conv_4"):
        x = _convolved(x, name, weights)
    x = max_pool2d(x, 3, 2)
    for block in ("mixed", *(f"mixed_{number}" for number in range(1, 9))):
        x = _mixed(x, block, weights)
    for block in ("mixed_9", "mixed_10"):
        x = _widest(x, block, weights)
    return x.mean(dim=(2, 3))


def resized(pictures: "torch.Tensor") -> "torch.Tensor":
    """Return pictures at the size of the network, as the first TensorFlow resized them.

    It is bilinear, without a filter, and counts pixels from the upper left corner. Output pixel ``j`` is
    taken at ``j · W / 299``; libraries of today have ``(j + ½) · W / 299 - ½``.

    Args:
        pictures: shape ``(N, 3, H, W)``.

    Returns:
        Shape ``(N, 3, 299, 299)``.
    """
    import torch
    from torch.nn.functional import grid_sample

    steps = torch.arange(SIDE, dtype=pictures.dtype) / SIDE
    y, x = (2 * steps - 1 + 1 / size for size in pictures.shape[-2:])
    grid = torch.stack(torch.meshgrid(x, y, indexing="xy"), dim=-1).expand(len(pictures), -1, -1, -1)
    return grid_sample(pictures, grid, mode="bilinear", padding_mode="border", align_corners=False)


def _convolved(x: "torch.Tensor", name: str, weights: "Weights") -> "torch.Tensor":
    """Convolve, normalise by the moments of the training, and cut at zero."""
    from torch.nn.functional import batch_norm, conv2d, relu

    kernel = weights[f"{name}.weight"]
    padding = (0, 0) if name in _VALID else (kernel.shape[2] // 2, kernel.shape[3] // 2)
    x = conv2d(x, kernel, None, 2 if name in _HALVING else 1, padding)
    mean, variance, beta = (weights[f"{name}.{kind}"] for kind in ("mean", "var", "beta"))
    return relu(batch_norm(x, mean, variance, None, beta, eps=1e-3))


def _mixed(x: "torch.Tensor", block: str, weights: "Weights") -> "torch.Tensor":
    """Return one convolution, one or two towers and a pooling side by side."""
    import torch
    from torch.nn.functional import avg_pool2d, max_pool2d

    parts = [_convolved(x, f"{block}.conv", weights)] if f"{block}.conv.weight" in weights else []
    towers = (f"{block}.tower", f"{block}.tower_1")
    parts += [_tower(x, tower, weights) for tower in towers if f"{tower}.conv.weight" in weights]
    if f"{block}.tower_2.conv.weight" in weights:
        pooled = avg_pool2d(x, 3, 1, 1, count_include_pad=False)
        return torch.cat([*parts, _convolved(pooled, f"{block}.tower_2.conv", weights)], dim=1)
    return torch.cat([*parts, max_pool2d(x, 3, 2)], dim=1)


def _tower(x: "torch.Tensor", tower: str, weights: "Weights") -> "torch.Tensor":
    for step in _STEPS:
        if f"{tower}.{step}.weight" in weights:
            x = _convolved(x, f"{tower}.{step}", weights)
    return x


def _widest(x: "torch.Tensor", block: str, weights: "Weights") -> "torch.Tensor":
    """Return one of the last two blocks, whose towers end in two convolutions side by side.

    The first of them averages before its last convolution, the second takes the maximum, as published.
    """
    import torch
    from torch.nn.functional import avg_pool2d, max_pool2d

    near = _convolved(x, f"{block}.tower_conv", weights)
    far = _convolved(_convolved(x, f"{block}.tower_1_conv", weights), f"{block}.tower_1_conv_1", weights)
    last = block == "mixed_10"
    pooled = max_pool2d(x, 3, 1, 1) if last else avg_pool2d(x, 3, 1, 1, count_include_pad=False)
    sources = {
        "conv": x, "tower_mixed_conv": near, "tower_mixed_conv_1": near,
        "tower_1_mixed_conv": far, "tower_1_mixed_conv_1": far, "tower_2_conv": pooled,
    }  # fmt: skip
    return torch.cat([_convolved(y, f"{block}.{name}", weights) for name, y in sources.items()], dim=1)
