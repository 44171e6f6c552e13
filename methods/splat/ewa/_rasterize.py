# SPDX-License-Identifier: Apache-2.0
"""One contract for drawing 3D Gaussians, two back ends."""

from typing import Literal, get_args

import torch

from graycard import Camera, UnknownNameError
from graycard.methods.splat.ewa._gaussians import GaussianMaps, Gaussians
from graycard.methods.splat.ewa._reference import rasterize_gaussians_reference

GaussianBackend = Literal["cpu", "reference"]


def rasterize_gaussians(
    gaussians: Gaussians,
    camera: Camera,
    features: torch.Tensor | None = None,
    backend: GaussianBackend = "cpu",
    antialiased: bool = False,
) -> GaussianMaps:
    """Draw 3D Gaussians: features, alpha and depth, with the footprint and the rules of gsplat 1.5.

    Args:
        gaussians: N of them.
        camera: The pinhole camera.
        features: shape ``(N, C)``, in the dtype of the Gaussians, instead of their own.
        backend: ``cpu``, the engine (float32 inside; forward only), or ``reference``, the specification
            (dense, in the dtype of the Gaussians, differentiable).
        antialiased: Lower the opacity of a picture as its dilation widens it, as gsplat's
            ``rasterize_mode="antialiased"`` and Mip-Splatting do.

    Returns:
        The maps, in the dtype of the Gaussians.

    Raises:
        UnknownNameError: There is no such back end.
        MethodError: The lists and images would not fit into the memory that is available (``cpu``).
        ValueError: Features of another shape or dtype, or not finite; or, on ``cpu``, tensors that ask for
            gradients.
    """
    if not isinstance(gaussians, Gaussians):  # kernels would read a third scale that is not there
        raise ValueError(f"expected Gaussians, got {type(gaussians).__name__}. Draw discs by rasterize")
    if backend == "reference":
        return rasterize_gaussians_reference(gaussians, camera, features, antialiased)
    if backend == "cpu":
        from graycard.methods.splat.ewa._cpu import rasterize_gaussians_cpu  # Numba takes long to import

        return rasterize_gaussians_cpu(gaussians, camera, features, antialiased)
    raise UnknownNameError("back end", backend, get_args(GaussianBackend))
