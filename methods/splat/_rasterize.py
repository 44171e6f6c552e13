# SPDX-License-Identifier: Apache-2.0
"""One contract, several back ends."""

from collections.abc import Callable
from typing import Literal

import torch

from graycard import Camera, UnknownNameError
from graycard.methods.splat._maps import Maps
from graycard.methods.splat._reference import rasterize_reference
from graycard.methods.splat._surfels import Surfels

Backend = Literal["cpu", "reference"]


def rasterize(
    surfels: Surfels,
    camera: Camera,
    features: torch.Tensor | None = None,
    backend: Backend = "cpu",
) -> Maps:
    """Draw surfels: features, alpha, depth, normals and distortion.

    Args:
        surfels: N surfels on the CPU.
        camera: The pinhole camera.
        features: shape ``(N, C)``, in the dtype of the surfels, instead of their own.
        backend: ``cpu``, the engine (float32 inside; compiled when first used, then cached), or
            ``reference``, the specification (dense, in the dtype of the surfels).

    Returns:
        The maps, in the dtype of the surfels.

    Raises:
        UnknownNameError: There is no such back end.
        ValueError: Features of another shape or dtype.
    """
    return _back_end(backend)(surfels, camera, features)


def _back_end(name: str) -> Callable[[Surfels, Camera, torch.Tensor | None], Maps]:
    if name == "reference":
        return rasterize_reference
    if name == "cpu":
        from graycard.methods.splat._cpu import rasterize_cpu  # Numba takes long to import

        return rasterize_cpu
    raise UnknownNameError("back end", name, ["cpu", "reference"])
