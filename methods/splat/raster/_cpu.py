# SPDX-License-Identifier: Apache-2.0
"""The CPU engine: projection and pixels in Numba on all cores, bit-identical when repeated."""

from typing import Any, NamedTuple, cast

import numpy as np
import torch
from torch.autograd.function import once_differentiable

from graycard import Camera
from graycard.methods.splat._maps import FeatureMaps, Maps
from graycard.methods.splat._surfels import Surfels
from graycard.methods.splat.raster._idle import give_back
from graycard.methods.splat.raster._stage_arrays import Drawn, Scene
from graycard.methods.splat.raster._stages import (
    draw,
    draw_backward,
    list_tiles,
    padded_channels,
    project,
    project_backward,
)
from graycard.methods.splat.reference._rasterize import checked_features, checked_offsets


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
        MethodError: There is not enough memory.
        ValueError: Features or offsets of another shape, or surfels that are not on the CPU.
    """
    image, alpha, normal, depth, distortion, median = _draw(surfels, camera, features, offsets, True)
    return Maps(image, alpha, depth, median, normal, distortion)


def rasterize_features_cpu(
    surfels: Surfels,
    camera: Camera,
    features: torch.Tensor | None = None,
    offsets: torch.Tensor | None = None,
) -> FeatureMaps:
    """Return the features and alpha of :func:`rasterize_cpu`, drawn alone.

    Arguments and errors are as there.
    """
    image, alpha = _draw(surfels, camera, features, offsets, False)
    return FeatureMaps(image, alpha)


def _draw(
    surfels: Surfels,
    camera: Camera,
    features: torch.Tensor | None,
    offsets: torch.Tensor | None,
    shaped: bool,
) -> list[torch.Tensor]:
    """Return the image, alpha, and the maps of ``Shape`` if they are asked for; in the surfels' dtype."""
    features, offsets = checked_features(surfels, features), checked_offsets(surfels, offsets)
    if surfels.centres.device.type != "cpu":
        raise ValueError(f"expected surfels on the CPU, got them on {surfels.centres.device}")
    channels = features.shape[1]
    offsets = torch.zeros(len(surfels), 2, dtype=features.dtype) if offsets is None else offsets
    padding = padded_channels(channels) - channels
    if padding:
        features = torch.nn.functional.pad(features, (0, padding))
    tensors = (surfels.centres, surfels.rotations, surfels.scales, surfels.opacities, features, offsets)
    drawn = cast(tuple[torch.Tensor, ...], _Draw.apply(*tensors, _View(camera, shaped)))
    image, *others = (value.to(features.dtype) for value in drawn)
    return [image[..., :channels] if padding else image, *others]


class _View(NamedTuple):
    """Arrays without gradients."""

    camera: Camera
    shaped: bool


class _Draw(torch.autograd.Function):
    """The stages as one differentiable step, from the tensors of the surfels to float32 images."""

    @staticmethod
    def forward(ctx: Any, *inputs: Any) -> tuple[torch.Tensor, ...]:
        """Centres, rotations, scales, opacities, features, offsets, view."""
        *tensors, view = inputs
        scene = _scene(tensors, view)
        projected = project(scene)
        lists = list_tiles(scene, projected)
        drawn = draw(scene, projected, lists)
        ctx.stages, ctx.dtype = (scene, projected, lists, drawn), tensors[4].dtype
        return tuple(torch.from_numpy(values) for values in _images(drawn))

    @staticmethod
    @once_differentiable
    def backward(  # type: ignore[override]  # the decorator hides the name of ctx from type checkers
        ctx: Any, *grad_outputs: torch.Tensor
    ) -> tuple[torch.Tensor | None, ...]:
        """Gradients of the arguments of the forward pass."""
        scene, projected, lists, drawn = ctx.stages
        to_image, to_alpha, *to_shape = (np.ascontiguousarray(g.numpy()) for g in grad_outputs)
        slots = draw_backward(scene, projected, lists, drawn, to_image, -to_alpha, tuple(to_shape) or None)
        gradients = project_backward(scene, projected, lists, slots)
        give_back(slots)
        geometry = (gradients.centres, gradients.rotations, gradients.scales, gradients.opacities)
        return (
            *(torch.from_numpy(values) for values in geometry),
            torch.from_numpy(gradients.features).to(ctx.dtype),
            torch.from_numpy(gradients.offsets),
            None,
        )


def _scene(tensors: list[torch.Tensor], view: _View) -> Scene:
    """Return the arrays behind the tensors."""
    *geometry, features, offsets = (np.ascontiguousarray(tensor.detach().numpy()) for tensor in tensors)
    arrays = [*geometry, features.astype(np.float32, copy=False), offsets]
    return cast(Any, Scene)(*arrays, *view)


def _images(drawn: Drawn) -> list[np.ndarray]:
    """Return the outputs of the differentiable step.

    Alpha is made here, not in PyTorch: the threads of PyTorch go on spinning after each step of theirs, on
    the cores where the kernels run next.
    """
    alpha = 1 - drawn.transmittance
    if drawn.shape is None:
        return [drawn.image, alpha]
    shape = drawn.shape
    return [drawn.image, alpha, shape.normal, shape.depth, shape.distortion, shape.median_depth]
