# SPDX-License-Identifier: Apache-2.0
"""The CPU engine: projection in PyTorch, pixels in Numba on all cores, bit-identical when repeated."""

from typing import Any, NamedTuple, cast

import numpy as np
import torch
from torch.autograd.function import once_differentiable

from graycard import Camera
from graycard.methods.splat._backward import GEOMETRY, backward
from graycard.methods.splat._coefficients import (
    CENTRE_Z,
    COLUMNS,
    HEIGHT,
    LOG2_E,
    PLANE,
    Footprints,
    footprints,
)
from graycard.methods.splat._forward import LANES, MOMENTS, forward
from graycard.methods.splat._geometry import CameraSurfels, see
from graycard.methods.splat._maps import NDC_FAR, NDC_NEAR, NEAR, FeatureMaps, Maps
from graycard.methods.splat._reference import checked_features, checked_offsets
from graycard.methods.splat._surfels import Surfels
from graycard.methods.splat._tiles import TileLists, tile_lists

KAPPA = NDC_FAR * NDC_NEAR / (NDC_FAR - NDC_NEAR)
"""Metres: depth in normalised device coordinates is a constant minus ``KAPPA / z``."""


def rasterize_cpu(
    surfels: Surfels,
    camera: Camera,
    features: torch.Tensor | None = None,
    offsets: torch.Tensor | None = None,
) -> Maps:
    """Draw surfels as :func:`rasterize_reference` does, in float32 but for the projection.

    Args:
        surfels: N surfels on the CPU.
        camera: The pinhole camera.
        features: shape ``(N, C)``, instead of the surfels' own.
        offsets: shape ``(N, 2)``, pixels: moves the picture of each surfel on the image.

    Returns:
        The maps, in the dtype of the surfels, differentiable once in every tensor of the surfels, in the
        features and in the offsets.

    Raises:
        ValueError: Features or offsets of another shape, or surfels that are not on the CPU.
    """
    features, offsets = checked_features(surfels, features), checked_offsets(surfels, offsets)
    if surfels.centres.device.type != "cpu":
        raise ValueError(f"expected surfels on the CPU, got them on {surfels.centres.device}")
    seen = see(_in_float64(surfels), camera)
    drawn = footprints(seen, surfels.opacities.double(), camera, offsets)
    lists = tile_lists(drawn.bounds, _numbers(seen.centres[drawn.kept, 2]), camera.width, camera.height)
    channels = _channels(features, seen, camera)[drawn.kept]
    size = (camera.height, camera.width)
    inputs = (drawn.coefficients, drawn.centres, channels, _Plan(drawn.bounds, lists, size))
    image, medians = cast(tuple[torch.Tensor, torch.Tensor], _Draw.apply(*inputs))
    maps = _maps(image, features.shape[1], _median_depth(drawn, medians))
    return Maps(**{name: value.to(features.dtype) for name, value in maps.items()})


def rasterize_features_cpu(
    surfels: Surfels,
    camera: Camera,
    features: torch.Tensor | None = None,
    offsets: torch.Tensor | None = None,
) -> FeatureMaps:
    """The features and alpha of :func:`rasterize_cpu`; arguments and errors are as there."""
    maps = rasterize_cpu(surfels, camera, features, offsets)
    return FeatureMaps(maps.features, maps.alpha)


def _in_float64(surfels: Surfels) -> Surfels:
    """The projection cancels digits where discs are seen edge-on; float32 would lose them."""
    return Surfels(
        surfels.centres.double(),
        surfels.rotations.double(),
        surfels.scales.double(),
        surfels.opacities.double(),
        surfels.features.double(),
    )


def _numbers(values: torch.Tensor) -> np.ndarray:
    return values.detach().numpy()


def _channels(features: torch.Tensor, seen: CameraSurfels, camera: Camera) -> torch.Tensor:
    """All that is summed with plain weights: features, world normals, and one, whose sum is alpha."""
    to_world = torch.tensor(camera.camera_to_world[:3, :3])
    normals = (seen.normals @ to_world.T).to(torch.float32)
    return torch.cat([features.to(torch.float32), normals, torch.ones(len(features), 1)], dim=1)


def _maps(image: torch.Tensor, features: int, median: torch.Tensor) -> dict[str, torch.Tensor]:
    """The fields of :class:`Maps` from the kernel's sums."""
    drawn, normal, moments = image.split([features, 3, 1 + MOMENTS], dim=-1)
    alpha, depth, inverse, square = moments.double().unbind(dim=-1)  # differences of sums follow
    return {
        "features": drawn,
        "alpha": alpha,
        "depth": depth / torch.where(alpha > 0, alpha, 1.0),
        "median_depth": median,
        "normal": normal,
        "distortion": (KAPPA**2 * (alpha * square - inverse**2)).clamp(min=0),
    }


def _median_depth(drawn: Footprints, medians: torch.Tensor) -> torch.Tensor:
    """Depth of the surfel that the kernel named at each pixel; outside the kernel, for few pixels need it."""
    row, column = (medians >= 0).nonzero(as_tuple=True)
    surfel = medians[row, column]
    offset = torch.stack([column, row], dim=1) + 0.5 - drawn.centres[surfel]
    chosen = drawn.coefficients[surfel]
    forms = chosen[:, :PLANE].reshape(-1, 3, 3)
    u, v, below = (forms * torch.nn.functional.pad(offset, (0, 1), value=1.0)[:, None]).sum(dim=2).unbind(1)
    z = chosen[:, HEIGHT] / below
    disc = (u / below) ** 2 + (v / below) ** 2
    plane = (z >= NEAR) & (disc <= LOG2_E * (offset**2).sum(dim=1))
    depth = torch.where(plane, z, chosen[:, CENTRE_Z])
    return torch.zeros(medians.shape, dtype=depth.dtype).index_put((row, column), depth)


class _Plan(NamedTuple):
    """What the kernels need and no gradient passes."""

    bounds: np.ndarray
    """As in :class:`Footprints`."""
    lists: TileLists
    size: tuple[int, int]
    """Height and width of the image, pixels."""


class _Scene(NamedTuple):
    """The first arguments of both kernels, see there."""

    coefficients: np.ndarray
    centres: np.ndarray
    features: np.ndarray
    channels: int
    bounds: np.ndarray
    start: np.ndarray
    listed: np.ndarray


class _Draw(torch.autograd.Function):
    """The kernels as one differentiable step."""

    @staticmethod
    def forward(
        ctx: Any,
        coefficients: torch.Tensor,
        centres: torch.Tensor,
        channels: torch.Tensor,
        plan: _Plan,
    ) -> tuple[torch.Tensor, torch.Tensor]:
        """The sums, float32 ``(H, W, C + MOMENTS)``, and the surfels of the median depth, ``(H, W)``."""
        bounds, lists, size = plan
        image = np.empty((*size, channels.shape[1] + MOMENTS), np.float32)
        medians, drawn = np.empty(size, np.int64), np.empty(lists.start.size - 1, np.int64)
        scene = _Scene(
            _numbers(coefficients).astype(np.float32).ravel(),
            np.ascontiguousarray(_numbers(centres)),
            _numbers(channels).ravel(),
            channels.shape[1],
            bounds,
            lists.start,
            lists.surfels,
        )
        forward(*scene, image, medians, drawn)
        ctx.scene, ctx.slots, ctx.drawn, ctx.image = scene, lists.slots, drawn, image
        ctx.shape = channels.shape
        named = torch.from_numpy(medians)
        ctx.mark_non_differentiable(named)
        return torch.from_numpy(image), named

    @staticmethod
    @once_differentiable
    def backward(  # type: ignore[override]  # the decorator hides the name of ctx from type checkers
        ctx: Any, *grad_outputs: torch.Tensor
    ) -> tuple[torch.Tensor | None, ...]:
        """Gradients of the first three arguments of the forward pass."""
        pairs, (count, channels) = int(ctx.slots[-1]), ctx.shape
        geometry = np.zeros((pairs, LANES), np.float32)
        colours = np.zeros((pairs, -(-channels // LANES) * LANES), np.float32)
        gradient = np.ascontiguousarray(grad_outputs[0].numpy())
        scene = cast(_Scene, ctx.scene)
        backward(*scene, ctx.slots, ctx.drawn, ctx.image, gradient, geometry.ravel(), colours.ravel())
        total = _sum_pairs(geometry, ctx.slots).astype(np.float64)
        to_coefficients = total[:, :COLUMNS]
        planes = scene.coefficients.reshape(count, COLUMNS)[:, :PLANE].reshape(count, 3, 3)
        moved = (planes[:, :, :2] * to_coefficients[:, 2:PLANE:3, None]).sum(axis=1)
        to_centres = -moved - total[:, COLUMNS:GEOMETRY]  # offsets are pixel minus centre
        to_channels = _sum_pairs(colours, ctx.slots)[:, :channels]
        results = (torch.from_numpy(values) for values in (to_coefficients, to_centres, to_channels))
        return *results, None


def _sum_pairs(values: np.ndarray, slots: np.ndarray) -> np.ndarray:
    """Sum the rows of each surfel, in their order; every surfel has at least one."""
    if len(slots) == 1:
        return values
    return np.add.reduceat(values, slots[:-1], axis=0)
