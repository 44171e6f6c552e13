# SPDX-License-Identifier: Apache-2.0
"""Compile kernels by using them once, on next to nothing: one job for each of those that go together.

A job must call kernels with arguments of the types that a fit has, or a fit would compile them again.
"""

from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple, cast

import numpy as np
import torch

from graycard import Camera
from graycard.methods.splat._rays import camera_rays
from graycard.methods.splat._surfels import Surfels
from graycard.methods.splat._trace import build_bvh, trace_rays
from graycard.methods.splat.ewa._gaussians import Gaussians
from graycard.methods.splat.ewa._rasterize import rasterize_gaussians
from graycard.methods.splat.fit._adam import move_all
from graycard.methods.splat.fit._moved import Moved
from graycard.methods.splat.ops._depth_normal import depth_normal_map
from graycard.methods.splat.ops._harmonics import spherical_harmonics_colours
from graycard.methods.splat.ops._losses import photometric_map
from graycard.methods.splat.raster._stage_arrays import Drawn, Lists, Projected, Scene, empty_shape, vectors
from graycard.methods.splat.raster._stages import draw, draw_backward, list_tiles, project, project_backward
from graycard.methods.splat.raster._tiles import TileLists

SIDE = 32
"""Pixels of the image that is looked at; it is wide enough for all kernels that go by vectors."""
TILES = 4
CHANNELS = (3, 8, 16)
"""Numbers of channels that methods draw."""


class Job(NamedTuple):
    """Kernels that are compiled by one process, one after the other."""

    run: Callable[[], None]
    seconds: float
    """About how long it takes, relative to the others: decides which process gets which jobs."""


def _camera() -> Camera:
    return Camera(SIDE, SIDE, np.array([[SIDE, 0, SIDE / 2], [0, SIDE, SIDE / 2], [0, 0, 1.0]]), np.eye(4))


def _draw(channels: int, shaped: bool) -> None:
    """Project, list and draw no surfels."""
    scene = _scene(channels, shaped)
    projected = project(scene)
    draw(scene, projected, list_tiles(scene, projected))


def _draw_solids(channels: int) -> None:
    """Compile the same with no ellipsoids."""
    geometry = torch.empty(0, 3), torch.empty(0, 4), torch.empty(0, 3), torch.empty(0)
    rasterize_gaussians(Gaussians(*geometry, torch.empty(0, channels)), _camera())


def _pull(channels: int, shaped: bool) -> None:
    """Find the gradients of no surfels, with what would be drawn of them made up."""
    scene, size = _scene(channels, shaped), (SIDE, SIDE)
    projected = Projected(
        vectors(0, 16), np.empty((0, 4), np.int32), np.empty(0), np.empty((0, 3), np.float32)
    )
    lists = Lists(TileLists(np.zeros(TILES + 1, np.int32), np.empty(0, np.int32)), np.zeros(1, np.int64))
    drawn = Drawn(
        np.zeros((*size, channels), np.float32), np.ones(size, np.float32), np.empty(0, np.uint16),
        np.zeros(TILES, np.int32), np.zeros(TILES, np.int32), empty_shape(size, TILES) if shaped else None,
    )  # fmt: skip
    maps = [np.zeros(size, np.float32) for _ in range(4)]
    to_shape = (np.zeros((*size, 3), np.float32), *maps[:3]) if shaped else None
    slots = draw_backward(scene, projected, lists, drawn, drawn.image, maps[3], to_shape)
    project_backward(scene, projected, lists, slots)


def _scene(channels: int, shaped: bool) -> Scene:
    widths = (3, 4, 2)
    geometry = [np.empty((0, width), np.float32) for width in widths]
    features, offsets = (np.empty((0, width), np.float32) for width in (channels, 2))
    arrays = *geometry, np.empty(0, np.float32), features, offsets
    return cast(Any, Scene)(*arrays, _camera(), shaped)


def _losses() -> None:
    image = torch.zeros(SIDE, SIDE, 3, requires_grad=True)
    photometric_map(image, torch.zeros(SIDE, SIDE, 3)).sum().backward()


def _depth_normal() -> None:
    depth = torch.ones(SIDE, SIDE, requires_grad=True)
    normal = torch.zeros(SIDE, SIDE, 3, requires_grad=True)
    depth_normal_map(depth, normal, torch.zeros(SIDE, SIDE), _camera()).sum().backward()


def _harmonics() -> None:
    coefficients, centres = torch.zeros(1, 16, 3, requires_grad=True), torch.ones(1, 3, requires_grad=True)
    spherical_harmonics_colours(coefficients, centres, _camera().position, 0).sum().backward()


def _adam() -> None:
    move_all([Moved(*torch.zeros(4, 1), rate=1.0, steps=1)], 1.0)


def _trace() -> None:
    one = torch.ones(1, 1)
    geometry = one.expand(1, 3).clone(), torch.tensor([[1.0, 0, 0, 0]]), one.expand(1, 2).clone()
    features = torch.ones(1, 3, requires_grad=True)
    surfels = Surfels(*geometry, one[0].clone(), features)
    traced = trace_rays(surfels, camera_rays(_camera()), bvh=build_bvh(surfels))
    (traced.features.sum() + traced.depth.sum()).backward()


JOBS = {
    **{f"draw {c}": Job(partial(_draw, c, False), 8) for c in CHANNELS},
    **{f"draw {c}, shaped": Job(partial(_draw, c, True), 11) for c in CHANNELS},
    **{f"pull {c}": Job(partial(_pull, c, False), 6) for c in CHANNELS},
    **{f"pull {c}, shaped": Job(partial(_pull, c, True), 9) for c in CHANNELS},
    "draw 3, solid": Job(partial(_draw_solids, 3), 11),
    "photometric": Job(_losses, 3),
    "depth normal": Job(_depth_normal, 4),
    "harmonics": Job(_harmonics, 2),
    "trace": Job(_trace, 20),
    "Adam": Job(_adam, 1),
}
"""By their names."""
PARTS = {
    **{f"features {c}": (f"draw {c}", f"pull {c}") for c in CHANNELS},
    **{f"maps {c}": (f"draw {c}, shaped", f"pull {c}, shaped") for c in CHANNELS},
    "gaussians 3": ("draw 3, solid",),
    **{name: (name,) for name in ("photometric", "depth normal", "harmonics", "trace", "Adam")},
}
"""Jobs of the parts of the engine, by the names of the parts."""
