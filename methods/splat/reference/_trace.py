# SPDX-License-Identifier: Apache-2.0
"""The specification of the tracer: every ray against every surfel in plain PyTorch, gradients by autograd.

The memory is that of a few arrays of (rays x surfels): for tests, not for fits.
"""

import torch

from graycard.methods.splat._geometry import rotation_matrices
from graycard.methods.splat._maps import ALPHA_MAX, ALPHA_MIN, TRANSMITTANCE_MIN
from graycard.methods.splat._rays import Rays, Traced
from graycard.methods.splat._surfels import Surfels


def trace_reference(surfels: Surfels, rays: Rays, features: torch.Tensor, near: float) -> Traced:
    """Trace in the order of the distances to the discs' planes, equals by index.

    Args:
        surfels: N surfels (float64 is meant).
        rays: R rays, in the same dtype.
        features: shape ``(N, C)``, in the same dtype.
        near: metres; what a ray meets at this distance or nearer does not count.

    Returns:
        What the rays meet, differentiable in all that was given.
    """
    distance, alpha = intersect(surfels, rays, near)
    distance, order = torch.where(alpha > 0, distance, torch.inf).sort(dim=1, stable=True)
    alpha = alpha.gather(1, order)
    after = torch.cumprod(1 - alpha, dim=1)
    before = torch.nn.functional.pad(after, (1, 0), value=1.0)
    counts = before > TRANSMITTANCE_MIN
    weight = torch.where(counts[:, :-1], before[:, :-1] * alpha, 0.0)
    total = weight.sum(dim=1)
    way = (weight * torch.where(alpha > 0, distance, 0.0)).sum(dim=1)
    last = counts.sum(dim=1, keepdim=True).clamp(max=len(surfels))  # the first that no longer counts
    return Traced(
        features=torch.einsum("rn,rnc->rc", weight, features[order]),
        transmittance=before.gather(1, last)[:, 0],
        depth=way / torch.where(total > 0, total, 1.0),
    )


def intersect(surfels: Surfels, rays: Rays, near: float) -> tuple[torch.Tensor, torch.Tensor]:
    """Distance to each disc's plane and alpha there, both of shape ``(R, N)``; alpha is 0 where it misses.

    The Gaussian is that of the disc alone: a ray has no pixel over which a low-pass could spread it.
    """
    rotation = rotation_matrices(surfels.rotations)
    normals = rotation[:, :, 2]
    slope = rays.directions @ normals.T
    offset = rays.origins[:, None] - surfels.centres
    height = (offset * normals).sum(dim=2)
    parallel = slope == 0
    distance = -height / torch.where(parallel, 1.0, slope)
    meets = ~parallel & (distance > near)
    if rays.far is not None:
        meets = meets & (distance <= rays.far[:, None])
    distance = torch.where(meets, distance, 0.0)
    point = offset + distance[:, :, None] * rays.directions[:, None]
    uv = torch.einsum("rnk,nka->rna", point, rotation[:, :, :2]) / surfels.scales
    raw = surfels.opacities * torch.exp(-0.5 * (uv**2).sum(dim=2))
    return distance, torch.where(meets & (raw >= ALPHA_MIN), raw.clamp(max=ALPHA_MAX), 0.0)
