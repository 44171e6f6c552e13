# SPDX-License-Identifier: Apache-2.0
"""The engine taken apart into stages that can be timed one by one; what knows of its inside is here only."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import torch
from numba import njit

import graycard as gc
from graycard.methods.splat import Surfels
from graycard.methods.splat._coefficients import footprints
from graycard.methods.splat._cpu import _channels, _Draw, _in_float64, _Plan
from graycard.methods.splat._forward import BLOCK, LANES, block_range
from graycard.methods.splat._geometry import see
from graycard.methods.splat._tiles import TILE, tile_lists


@dataclass(frozen=True)
class Staged:
    """The engine on one scene, all stages run once."""

    stages: Mapping[str, Callable[[], object]]
    """In order; each may be repeated alone."""
    forward_lanes: int
    """Pairs of pixel and surfel that the forward kernel evaluates."""
    backward_lanes: int
    working_bytes: int
    """Arrays that live between forward and backward, and those that either works in."""


DRAW, DRAW_BACKWARD = "draw", "draw backward"
"""The stages that are the kernels."""


def staged(surfels: Surfels, camera: gc.Camera) -> Staged:
    """Take the engine apart on a scene."""
    seen = see(_in_float64(surfels), camera)
    drawn = footprints(seen, surfels.opacities.double(), camera, torch.zeros(len(surfels), 2).double())
    depths = seen.centres[drawn.kept, 2].detach().numpy()
    size = (camera.height, camera.width)
    lists = tile_lists(drawn.bounds, depths, camera.width, camera.height)
    channels = _channels(surfels.features, seen, camera)[drawn.kept].requires_grad_()
    inputs = drawn.coefficients.requires_grad_(), drawn.centres.requires_grad_(), channels
    plan = _Plan(drawn.bounds, lists, size)
    image, _ = _Draw.apply(*inputs, plan)
    upstream = torch.ones_like(image)
    lanes = _evaluated(lists.start, lists.surfels, image.grad_fn.drawn, drawn.bounds, camera.width)
    stages = {
        "project": lambda: footprints(
            see(_in_float64(surfels), camera),
            surfels.opacities.double(),
            camera,
            torch.zeros(len(surfels), 2).double(),
        ),
        "sort and bin": lambda: tile_lists(drawn.bounds, depths, camera.width, camera.height),
        DRAW: lambda: _Draw.apply(*inputs, plan),
        DRAW_BACKWARD: lambda: torch.autograd.grad(image, inputs, upstream, retain_graph=True),
    }
    held = (lists.surfels.nbytes, lists.start.nbytes, image.numel() * 4, lists.slots[-1] * 4 * 2 * LANES)
    return Staged(stages, lanes, lanes, int(sum(held)))


@njit(cache=True)
def _evaluated(start, listed, drawn, bounds, width):
    columns, lanes = (width + TILE - 1) // TILE, 0
    for tile in range(drawn.size):
        for rank in range(drawn[tile]):
            surfel = listed[start[tile] + rank]
            left, right = block_range(bounds[surfel, 0], bounds[surfel, 1], tile % columns * TILE)
            top, bottom = block_range(bounds[surfel, 2], bounds[surfel, 3], tile // columns * TILE)
            lanes += (right - left) * (bottom - top) * BLOCK * BLOCK
    return lanes
