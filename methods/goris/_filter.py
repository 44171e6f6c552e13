# SPDX-License-Identifier: Apache-2.0
"""Reflections in rough surfaces: those of a mirror, blurred in screen space (GOR-IS, its S1.3)."""

from collections.abc import Mapping
from itertools import pairwise
from typing import Literal

import torch
from torch.nn.functional import avg_pool2d, conv2d, interpolate, pad

Reading = Literal["paper", "release"]
"""``paper``: each level is a Gaussian blur of the one before, at half its size; the network knows roughness
and the depth of the pixel. ``release``, as its code has it: a box, in which pixels count by how alike their
normals are; the network knows how far the reflected ray went, and one over depth. The code's network is
U-shaped; here both readings have the paper's."""

LEVELS = 5
_BOX = 5
"""Pixels of the box of ``release``."""
_GAUSSIAN = (1.0, 4.0, 6.0, 4.0, 1.0)
"""Binomial weights: those of a Gaussian of one pixel."""
WIDTH = 8
"""Channels of the network's latent layers."""
LATENT = 6
"""Weights of them, 3 x 3 each; one layer of 1 x 1 before and one after."""
_INSIDE = 1e-3


def pyramid(image: torch.Tensor, reading: Reading, normal: torch.Tensor | None = None) -> list[torch.Tensor]:
    """Return an image less and less sharp, each level at full size again; differentiable.

    Args:
        image: Shape ``(H, W, C)``.
        reading: How a level is made of the one before.
        normal: Shape ``(H, W, 3)``, unit; for ``release``.

    Returns:
        :data:`LEVELS` images of shape ``(H, W, C)``; the first is ``image``.

    Raises:
        ValueError: ``release`` without normals.
    """
    if reading == "release" and normal is None:
        raise ValueError("expected normals for the pyramid of the release, got none. Hand them in")
    height, width = image.shape[:2]
    level, facing = _first(image), None if normal is None else _first(normal)
    levels = [image]
    for number in range(1, LEVELS):
        if min(level.shape[-2:]) < 2:
            levels.append(levels[-1])
            continue
        if reading == "paper" or facing is None:
            level = _half(_blurred(level))
        else:
            level = _half(_blurred_alike(level, facing))
            facing = torch.nn.functional.normalize(_half(facing), dim=1)
        # sides were rounded up: what covers more than the picture is cut, not squeezed
        whole = interpolate(level, scale_factor=2**number, mode="bilinear", align_corners=False)
        levels.append(whole[0, :, :height, :width].permute(1, 2, 0))
    return levels


def filtered(levels: list[torch.Tensor], blur: torch.Tensor) -> torch.Tensor:
    """Return an image as blurred as each of its pixels asks for, shape ``(H, W, C)``; differentiable in both.

    Args:
        levels: Of :func:`pyramid`.
        blur: Shape ``(H, W)``, 0 to 1: the translated roughness. Level ``5 blur - 1/2``, none beyond the
            ends; between two levels linear.
    """
    place = (len(levels) * blur - 0.5).clamp(0, len(levels) - 1)
    weights = [(1 - (place - number).abs()).clamp(min=0)[..., None] for number in range(len(levels))]
    return torch.stack([weight * level for weight, level in zip(weights, levels, strict=True)]).sum(dim=0)


def translation_parameters(reading: Reading, seed: int) -> dict[str, torch.Tensor]:
    """Return the network that translates roughness to blur, before the first step: it changes nothing.

    Its last layer is zero, so that the blur begins as the roughness (inferred; the paper does not say).
    """
    random = torch.Generator().manual_seed(seed)
    sizes = [2 if reading == "paper" else 3, *[WIDTH] * (LATENT + 1), 1]
    found: dict[str, torch.Tensor] = {}
    for number, (before, after) in enumerate(pairwise(sizes)):
        side = 3 if 0 < number <= LATENT else 1
        spread = (2 / (before * side * side)) ** 0.5 if number <= LATENT else 0.0  # He et al. 2015
        found[_weight(number)] = spread * torch.randn(after, before, side, side, generator=random)
        found[_bias(number)] = torch.zeros(after)
    return found


def translated(
    values: Mapping[str, torch.Tensor], roughness: torch.Tensor, distances: torch.Tensor
) -> torch.Tensor:
    """Return the blur of each pixel, shape ``(H, W)``, 0 to 1: roughness as seen on the screen.

    Args:
        values: Parameters, those of :func:`translation_parameters` among them.
        roughness: Shape ``(H, W)``, 0 to 1.
        distances: Shape ``(H, W, K)``, finite, of the order of one: depth in the paper, see :data:`Reading`.
    """
    side_by_side = torch.channels_last  # channels of a pixel: with few of them convolutions are faster
    layer = torch.cat([roughness[..., None], distances], dim=-1).permute(2, 0, 1)[None]
    layer = layer.contiguous(memory_format=side_by_side)
    for number in range(LATENT + 2):
        weight = values[_weight(number)].contiguous(memory_format=side_by_side)
        edge = weight.shape[-1] // 2
        padded = pad(layer, (edge,) * 4, mode="replicate") if edge else layer
        layer = conv2d(padded, weight, values[_bias(number)])
        layer = layer.relu() if number <= LATENT else layer
    return torch.sigmoid(torch.logit(roughness, eps=_INSIDE) + layer[0, 0])


def _weight(number: int) -> str:
    return f"translation weight {number}"


def _bias(number: int) -> str:
    return f"translation bias {number}"


def _first(image: torch.Tensor) -> torch.Tensor:
    return image.permute(2, 0, 1)[None]


def _half(level: torch.Tensor) -> torch.Tensor:
    """Every second pixel's size, sides rounded up."""
    return avg_pool2d(level, 2, ceil_mode=True, count_include_pad=False)


def _blurred(level: torch.Tensor) -> torch.Tensor:
    channels = level.shape[1]
    row = level.new_tensor(_GAUSSIAN) / sum(_GAUSSIAN)
    kernel = row[:, None] * row[None]
    edge = len(_GAUSSIAN) // 2
    padded = pad(level, (edge,) * 4, mode="replicate")
    return conv2d(padded, kernel.expand(channels, 1, -1, -1), groups=channels)


def _blurred_alike(level: torch.Tensor, normal: torch.Tensor) -> torch.Tensor:
    """Means over a box, weighted by the squared cosine between normals, 0 where they face apart."""
    edge, (height, width) = _BOX // 2, level.shape[-2:]
    around, facing = (pad(part, (edge,) * 4, mode="replicate") for part in (level, normal))
    total, count = torch.zeros_like(level), torch.zeros_like(level[:, :1])
    for row in range(_BOX):
        for column in range(_BOX):
            part = slice(row, row + height), slice(column, column + width)
            weight = (normal * facing[:, :, *part]).sum(dim=1, keepdim=True).clamp(min=0) ** 2
            total = total + weight * around[:, :, *part]
            count = count + weight
    return torch.where(count > _INSIDE, total / count.clamp(min=_INSIDE), level)
