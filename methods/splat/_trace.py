# SPDX-License-Identifier: Apache-2.0
"""Rays through surfels: one contract, several back ends."""

from typing import TYPE_CHECKING

import torch

from graycard import UnknownNameError
from graycard.methods.splat._devices import CPU, is_on_cpu, on_device
from graycard.methods.splat._rasterize import Backend
from graycard.methods.splat._rays import Rays, Traced
from graycard.methods.splat._surfels import Surfels
from graycard.methods.splat.reference._rasterize import checked_features
from graycard.methods.splat.reference._trace import trace_reference

if TYPE_CHECKING:
    from graycard.methods.splat.trace._bvh import Bvh

NEAR_DISTANCE = 1e-4
"""Metres: a ray that starts on a surfel does not meet it."""


def trace_rays(
    surfels: Surfels,
    rays: Rays,
    features: torch.Tensor | None = None,
    backend: Backend = "cpu",
    bvh: "Bvh | None" = None,
    near: float = NEAR_DISTANCE,
) -> Traced:
    """Follow rays through surfels in the order in which they meet them.

    A disc counts where its plane is met farther than ``near`` and its alpha,
    ``min(0.99, opacity * exp(-(u^2 + v^2) / 2))`` with u, v in standard deviations, is at least 1/255 before
    the clamp. A ray ends behind the disc after which no more than 1e-4 passes, or where it is told to.

    Args:
        surfels: N surfels. What lies on a GPU is traced on the CPU.
        rays: R rays, on the device and in the dtype of the surfels.
        features: shape ``(N, C)``, in the dtype of the surfels, instead of their own; C may be zero.
        backend: ``cpu``, the engine (float32 inside; compiled when first used, then cached), or
            ``reference``, the specification (dense, in the dtype of the surfels).
        bvh: what :func:`build_bvh` made of these surfels, for more than one call while they stand still.
            The reference has no use for it.
        near: metres, not negative.

    Returns:
        Features, transmittance and depth, differentiable once in every tensor of the surfels, the features
        and the origins and directions of the rays.

    Raises:
        UnknownNameError: There is no such back end.
        MethodError: Tree and results would not fit into the memory that is available (``cpu``).
        ValueError: Features, rays or the tree do not fit the surfels.
    """
    features = checked_features(surfels, features)
    _check(surfels, rays, near)
    if not is_on_cpu(features):
        here, along = on_device(surfels, CPU), on_device(rays, CPU)
        return on_device(trace_rays(here, along, features.cpu(), backend, bvh, near), features.device)
    if backend == "reference":
        return trace_reference(surfels, rays, features, near)
    if backend == "cpu":
        from graycard.methods.splat.trace._cpu import trace_cpu  # Numba takes long to import

        return trace_cpu(surfels, rays, features, bvh, near)
    raise UnknownNameError("back end", backend, ["cpu", "reference"])


def build_bvh(surfels: Surfels) -> "Bvh":
    """Put surfels into a tree of boxes: sixteen neighbours on a Hilbert curve, sixteen of those, ...

    Args:
        surfels: N surfels on the CPU; no gradient passes through the tree, nor needs to.

    Returns:
        The tree, for calls of :func:`trace` with these surfels.

    Raises:
        ValueError: The surfels are not on the CPU.
    """
    from graycard.methods.splat.trace._bvh import bvh_of  # Numba takes long to import

    return bvh_of(surfels)


def _check(surfels: Surfels, rays: Rays, near: float) -> None:
    wanted, got = surfels.centres, rays.origins
    if (got.dtype, got.device) != (wanted.dtype, wanted.device):
        raise ValueError(
            f"expected rays in {wanted.dtype} on {wanted.device}, as the surfels are, "
            f"got {got.dtype} on {got.device}"
        )
    if not 0 <= near < float("inf"):
        raise ValueError(f"expected a near distance of zero metres or more, got {near}")
