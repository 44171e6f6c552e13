# SPDX-License-Identifier: Apache-2.0
"""One contract, several back ends."""

from typing import Literal, get_args

import torch

from graycard import Camera, UnknownNameError
from graycard.methods.splat._maps import FeatureMaps, Maps
from graycard.methods.splat._surfels import Surfels
from graycard.methods.splat.reference._rasterize import rasterize_features_reference, rasterize_reference

Backend = Literal["cpu", "cuda", "reference"]


def rasterize(
    surfels: Surfels,
    camera: Camera,
    features: torch.Tensor | None = None,
    backend: Backend | None = None,
    offsets: torch.Tensor | None = None,
) -> Maps:
    """Draw surfels: features, alpha, depth, normals and distortion.

    Args:
        surfels: N surfels, on the device of the back end.
        camera: The pinhole camera.
        features: shape ``(N, C)``, in the dtype of the surfels, instead of their own.
        backend: ``cpu``, the engine (float32 inside; compiled when first used, then cached), ``cuda``, on
            gsplat's kernels, with surfels on a GPU, or ``reference``, the specification (dense, in the dtype
            of the surfels). None: ``cuda`` for surfels on a GPU, else ``cpu``.
        offsets: shape ``(N, 2)``, in the dtype of the surfels, pixels: the picture of each surfel (disc,
            low-pass and depth) is moved on the image by this much. Their use is their gradient, at zero:
            how much the loss wants a surfel moved on the screen.

    Returns:
        The maps, in the dtype of the surfels.

    Raises:
        UnknownNameError: There is no such back end.
        MethodError: The lists and images would not fit into the memory that is available (``cpu``), or
            gsplat or a GPU is missing (``cuda``).
        ValueError: Features or offsets of another shape or dtype, or not finite.
    """
    backend = _chosen(surfels, backend)
    if backend == "cuda":
        from graycard.methods.splat.cuda._rasterize import rasterize_cuda

        return rasterize_cuda(surfels, camera, features, offsets)
    if backend == "cpu":
        from graycard.methods.splat.raster._cpu import rasterize_cpu  # Numba takes long to import

        return rasterize_cpu(surfels, camera, features, offsets)
    return rasterize_reference(surfels, camera, features, offsets)


def rasterize_features(
    surfels: Surfels,
    camera: Camera,
    features: torch.Tensor | None = None,
    backend: Backend | None = None,
    offsets: torch.Tensor | None = None,
) -> FeatureMaps:
    """Draw features and alpha only, as :func:`rasterize` does and at a fraction of its cost.

    Args:
        surfels: as there.
        camera: as there.
        features: as there.
        backend: as there.
        offsets: as there.

    Returns:
        The maps, in the dtype of the surfels.

    Raises:
        UnknownNameError: There is no such back end.
        MethodError: The lists and images would not fit into the memory that is available (``cpu``), or
            gsplat or a GPU is missing (``cuda``).
        ValueError: Features or offsets of another shape or dtype, or not finite.
    """
    backend = _chosen(surfels, backend)
    if backend == "cuda":
        from graycard.methods.splat.cuda._rasterize import rasterize_features_cuda

        return rasterize_features_cuda(surfels, camera, features, offsets)
    if backend == "cpu":
        from graycard.methods.splat.raster._cpu import rasterize_features_cpu  # Numba takes long to import

        return rasterize_features_cpu(surfels, camera, features, offsets)
    return rasterize_features_reference(surfels, camera, features, offsets)


def _chosen(surfels: Surfels, name: Backend | None) -> Backend:
    if name is None:
        return "cuda" if surfels.centres.device.type == "cuda" else "cpu"
    names = list(get_args(Backend))
    if name not in names:
        raise UnknownNameError("back end", name, names)
    return name
