# SPDX-License-Identifier: Apache-2.0
"""The CPU engine: projection in PyTorch, pixels in Numba on all cores, bit-identical when repeated."""

import numpy as np
import torch

from graycard import Camera
from graycard.methods.splat._coefficients import CENTRE_Z, HEIGHT, LOG2_E, PLANE, Footprints, footprints
from graycard.methods.splat._forward import MOMENTS, forward
from graycard.methods.splat._geometry import CameraSurfels, see
from graycard.methods.splat._maps import NDC_FAR, NDC_NEAR, NEAR, Maps
from graycard.methods.splat._reference import checked_features
from graycard.methods.splat._surfels import Surfels
from graycard.methods.splat._tiles import TileLists, tile_lists

KAPPA = NDC_FAR * NDC_NEAR / (NDC_FAR - NDC_NEAR)
"""Metres: depth in normalised device coordinates is a constant minus ``KAPPA / z``."""


def rasterize_cpu(surfels: Surfels, camera: Camera, features: torch.Tensor | None = None) -> Maps:
    """Draw surfels as :func:`rasterize_reference` does, in float32 but for the projection.

    Args:
        surfels: N surfels on the CPU.
        camera: The pinhole camera.
        features: shape ``(N, C)``, instead of the surfels' own.

    Returns:
        The maps, in the dtype of the surfels.

    Raises:
        ValueError: Features of another shape, or surfels that are not on the CPU.
    """
    features = checked_features(surfels, features)
    if surfels.centres.device.type != "cpu":
        raise ValueError(f"expected surfels on the CPU, got them on {surfels.centres.device}")
    seen = see(_in_float64(surfels), camera)
    drawn = footprints(seen, surfels.opacities.double(), camera)
    lists = tile_lists(drawn.bounds, _numbers(seen.centres[drawn.kept, 2]), camera.width, camera.height)
    channels = _channels(features, seen, camera)[drawn.kept]
    size = (camera.height, camera.width)
    image, medians = draw(drawn.coefficients, drawn.centres, channels, drawn.bounds, lists, size)
    maps = _maps(image.double(), features.shape[1], _median_depth(drawn, medians))
    return Maps(**{name: value.to(features.dtype) for name, value in maps.items()})


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
    alpha, depth, inverse, square = image[..., features + 3 :].unbind(dim=-1)
    return {
        "features": image[..., :features],
        "alpha": alpha,
        "depth": depth / torch.where(alpha > 0, alpha, 1.0),
        "median_depth": median,
        "normal": image[..., features : features + 3],
        "distortion": (KAPPA**2 * (alpha * square - inverse**2)).clamp(min=0),
    }


def _median_depth(drawn: Footprints, medians: torch.Tensor) -> torch.Tensor:
    """Depth of the surfel that the kernel named at each pixel; outside the kernel, for few pixels need it."""
    row, column = (medians >= 0).nonzero(as_tuple=True)
    surfel = medians[row, column]
    offset = torch.stack([column, row], dim=1) + 0.5 - drawn.centres[surfel]
    chosen = drawn.coefficients[surfel]
    forms = chosen[:, :PLANE].reshape(-1, 3, 3)
    u, v, below = (forms @ torch.nn.functional.pad(offset, (0, 1), value=1.0)[:, :, None])[:, :, 0].unbind(1)
    z = chosen[:, HEIGHT] / below
    disc = (u / below) ** 2 + (v / below) ** 2
    plane = (z >= NEAR) & (disc <= LOG2_E * (offset**2).sum(dim=1))
    depth = torch.where(plane, z, chosen[:, CENTRE_Z])
    return torch.zeros(medians.shape, dtype=depth.dtype).index_put((row, column), depth)


def draw(
    coefficients: torch.Tensor,
    centres: torch.Tensor,
    channels: torch.Tensor,
    bounds: np.ndarray,
    lists: TileLists,
    size: tuple[int, int],
) -> tuple[torch.Tensor, torch.Tensor]:
    """Run the forward kernel.

    Returns:
        The sums, float32 ``(H, W, C + MOMENTS)``, and the surfels of the median depth, int64 ``(H, W)``.
    """
    image = np.empty((*size, channels.shape[1] + MOMENTS), np.float32)
    medians = np.empty(size, np.int64)
    drawn = np.empty(lists.start.size - 1, np.int64)
    forward(
        _numbers(coefficients).astype(np.float32).ravel(), _numbers(centres), _numbers(channels).ravel(),
        channels.shape[1], bounds, lists.start, lists.surfels, image, medians, drawn,
    )  # fmt: skip
    return torch.from_numpy(image), torch.from_numpy(medians)
