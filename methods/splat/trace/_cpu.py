# SPDX-License-Identifier: Apache-2.0
"""The tracer's CPU engine: a tree of boxes, packets of sixteen rays, bit-identical when repeated."""

from typing import Any, NamedTuple, cast

import numpy as np
import torch
from torch.autograd.function import once_differentiable

from graycard.methods.splat._rays import Rays, Traced
from graycard.methods.splat._surfels import Surfels
from graycard.methods.splat.raster._stages import check_memory
from graycard.methods.splat.simd._vector import LANES
from graycard.methods.splat.trace._backward import INNER, backward
from graycard.methods.splat.trace._bvh import Bvh, Geometry, bvh_of
from graycard.methods.splat.trace._bvh_kernels import RECORD, gather_features, gather_gradients
from graycard.methods.splat.trace._forward import forward, packets_of
from graycard.methods.splat.trace._gather import Asked, Found, Kept

PARTS = 8
"""Threads among which the backward pass is divided; each needs sums of its own."""
KEPT = 128
"""Rows a packet that are kept for the backward pass, six bytes each: 48 bytes a ray in all."""
SUMS_BYTES = 2**26
"""Memory limit: all sums together may take; with more surfels there are fewer parts, down to one."""


def trace_cpu(surfels: Surfels, rays: Rays, features: torch.Tensor, bvh: Bvh | None, near: float) -> Traced:
    """Trace as :func:`trace_reference` does, in float32.

    Args:
        surfels: N surfels on the CPU.
        rays: R rays, in the same dtype.
        features: shape ``(N, C)``, in the same dtype.
        bvh: the surfels' tree, or None, to build it.
        near: metres.

    Returns:
        What the rays meet, differentiable once in all that was given.

    Raises:
        MethodError: There is not enough memory.
        ValueError: The tree is that of other surfels, or the surfels are not on the CPU.
    """
    needed = _bytes_needed(len(surfels), len(rays), features.shape[1])
    check_memory(needed, f"{len(surfels)} surfels along {len(rays)} rays")
    if bvh is None:
        bvh = bvh_of(surfels)
    else:
        bvh.check(surfels)
    tensors = (
        surfels.centres, surfels.rotations, surfels.scales, surfels.opacities,
        features, rays.origins, rays.directions,
    )  # fmt: skip
    returns = torch.is_grad_enabled() and any(tensor.requires_grad for tensor in tensors)
    beyond = np.nextafter(
        np.float32(near), np.float32(np.inf)
    )  # the kernels take it for the first that counts
    far = np.full(len(rays), np.inf, np.float32) if rays.far is None else _float32(rays.far)
    results = _Trace.apply(*tensors, _Plan(bvh, beyond, far, rays.width or 0, KEPT if returns else 0))
    return Traced(*cast(tuple[torch.Tensor, ...], results))


class _Plan(NamedTuple):
    """Arrays of the kernels without gradients, no gradient passes."""

    bvh: Bvh
    near: np.float32
    far: np.ndarray
    """Shape ``(R,)``, float32."""
    width: int
    kept: int
    """Rows a packet of which the backward pass is told."""


class _Trace(torch.autograd.Function):
    """The kernels as one differentiable step."""

    @staticmethod
    def forward(ctx: Any, *inputs: Any) -> tuple[torch.Tensor, ...]:
        """Features, transmittance and depth, from the surfels' five tensors, the rays' two, and a plan."""
        features, origins, directions, plan = inputs[4:]
        channels, count = features.shape[1], len(origins)
        packets = packets_of(count, plan.width)
        kept = Kept(
            np.empty((packets, plan.kept), np.int32),
            np.empty((packets, plan.kept), np.uint16),
            np.empty(packets, np.int32),
        )
        asked = Asked(_float32(origins), _float32(directions), plan.far, plan.width, plan.near)
        scene = plan.bvh.tree, asked, _float32(features).ravel(), kept
        out = Found(*(np.empty(shape, np.float32) for shape in ((count, channels), (count,), (count,))))
        forward(*scene, out)
        ctx.scene, ctx.plan, ctx.shape, ctx.dtype = scene, plan, features.shape, features.dtype
        return tuple(torch.from_numpy(values).to(features.dtype) for values in out)

    @staticmethod
    @once_differentiable
    def backward(  # type: ignore[override]  # the decorator hides the name of ctx from type checkers
        ctx: Any, *grad_outputs: torch.Tensor
    ) -> tuple[torch.Tensor | None, ...]:
        """Gradients of all tensors of the forward pass."""
        tree, geometry = ctx.plan.bvh.tree, ctx.plan.bvh.geometry
        stride = _stride(ctx.shape[1])
        sums = np.zeros((_parts(tree.order.size * stride), tree.order.size * stride), np.float32)
        to_rays = np.empty_like(ctx.scene[1].origins), np.empty_like(ctx.scene[1].directions)
        to_found = Found(*(_float32(values) for values in grad_outputs))
        backward(len(sums), *ctx.scene, to_found, stride, sums, to_rays)
        to_geometry = Geometry(*(np.empty_like(values) for values in geometry))
        gather_gradients(geometry, tree.order, sums, stride, to_geometry)
        to_features = np.empty(ctx.shape, np.float32)
        gather_features(tree.order, sums, stride, RECORD, to_features)
        results = [*to_geometry, to_features, *to_rays]
        return *(torch.from_numpy(values).to(ctx.dtype) for values in results), None


def _float32(values: torch.Tensor) -> np.ndarray:
    return np.ascontiguousarray(values.detach().numpy(), np.float32)


def _bytes_needed(surfels: int, rays: int, channels: int) -> int:
    """About what tree, results and sums of gradients take, there and back."""
    a_surfel = 2 * 80 + 4 * (RECORD + channels) + 4 * _stride(channels)
    return surfels * a_surfel + rays * 4 * (2 * channels + 12 + 2 * 6)


def _stride(channels: int) -> int:
    """Floats of a surfel's gradients: one vector, and what it has no room for."""
    return LANES * (1 + -(-max(channels - INNER, 0) // LANES))


def _parts(floats: int) -> int:
    """Return copies of the sums: ``PARTS`` as long as they fit."""
    return max(1, min(PARTS, SUMS_BYTES // (4 * floats)))
