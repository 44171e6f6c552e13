# SPDX-License-Identifier: Apache-2.0
"""3D Gaussians on the CPU engine: their own projection, the tiles and pixels of surfels. Forward only."""

from typing import Any, cast

import numpy as np
import torch

from graycard import Camera
from graycard.methods.splat._surfels import Primitives
from graycard.methods.splat.ewa._gaussians import GaussianMaps, Gaussians
from graycard.methods.splat.ewa._project import project as project_kernel
from graycard.methods.splat.raster._coefficients import COLUMNS
from graycard.methods.splat.raster._footprints import SOLID
from graycard.methods.splat.raster._stage_arrays import Drawn, Projected, Scene, vectors
from graycard.methods.splat.raster._stages import check_memory, draw, list_tiles, padded_channels
from graycard.methods.splat.reference._rasterize import checked_features


def rasterize_gaussians_cpu(
    gaussians: Gaussians,
    camera: Camera,
    features: torch.Tensor | None = None,
    antialiased: bool = False,
) -> GaussianMaps:
    """Draw Gaussians as :func:`rasterize_gaussians_reference` does, in float32 but for the projection.

    Raises:
        MethodError: There is not enough memory.
        ValueError: Features of another shape, or tensors that ask for gradients or are not on the CPU.
    """
    features = checked_features(gaussians, features)
    _check_plain(gaussians, features)
    scene = scene_of(gaussians, camera, features)
    drawn = draw_solids(scene, antialiased)
    images = [drawn.image[..., : features.shape[1]], 1 - drawn.transmittance]
    if drawn.shape is not None:
        images += [drawn.shape.depth, drawn.shape.median_depth]
    return GaussianMaps(*(torch.from_numpy(values).to(features.dtype) for values in images))


def scene_of(gaussians: Gaussians, camera: Camera, features: torch.Tensor) -> Scene:
    """Return the arrays behind the tensors."""
    padding = padded_channels(features.shape[1]) - features.shape[1]
    wide = torch.nn.functional.pad(features, (0, padding)).to(torch.float32)
    tensors = gaussians.centres, gaussians.rotations, gaussians.scales, gaussians.opacities, wide
    arrays = [np.ascontiguousarray(tensor.detach().numpy()) for tensor in tensors]
    offsets = np.empty((0, 2), arrays[0].dtype)
    return cast(Any, Scene)(*arrays, offsets, camera, True)


def draw_solids(scene: Scene, antialiased: bool) -> Drawn:
    """Project, sort and draw."""
    projected = project_solids(scene, antialiased)
    return draw(scene, projected, list_tiles(scene, projected), SOLID)


def project_solids(scene: Scene, antialiased: bool) -> Projected:
    """Prepare Gaussians for the pixels; they have no normals.

    Raises:
        MethodError: There is not enough memory.
    """
    count = len(scene.centres)
    check_memory((4 * COLUMNS + 16 + 8 + 12) * count, f"{count} Gaussians")
    result = Projected(
        vectors(count, COLUMNS),
        np.empty((count, 4), np.int32),
        np.empty(count),
        np.zeros((count, 3), np.float32),
    )
    cast(Any, project_kernel)(scene.discs, scene.view, antialiased, result.rows, result.bounds, result.depths)
    return result


def _check_plain(gaussians: Primitives, features: torch.Tensor) -> None:
    """Refuse what this back end would not do as asked.

    Raises:
        ValueError: A tensor asks for gradients, or is not on the CPU.
    """
    tensors = gaussians.centres, gaussians.rotations, gaussians.scales, gaussians.opacities, features
    if gaussians.centres.device.type != "cpu":
        raise ValueError(f"expected Gaussians on the CPU, got them on {gaussians.centres.device}")
    if torch.is_grad_enabled() and any(tensor.requires_grad for tensor in tensors):
        raise ValueError(
            "expected Gaussians without gradients on the back end cpu, got some with. Use the back end "
            "reference, or torch.no_grad()"
        )
