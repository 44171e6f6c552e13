# SPDX-License-Identifier: Apache-2.0
"""The specification of 3D Gaussians: each against every pixel in plain PyTorch, gradients by autograd.

The equations are those of EWA splatting (Zwicker et al. 2002) as 3D Gaussian Splatting uses them (Kerbl et
al. 2023, section 4). The memory is that of a few arrays of (Gaussians x pixels): for tests, not for fits.
"""

from dataclasses import dataclass

import torch

from graycard import Camera
from graycard.methods.splat._geometry import rotation_matrices
from graycard.methods.splat._maps import ALPHA_MIN, NEAR
from graycard.methods.splat.ewa._gaussians import (
    BEYOND_VIEW,
    DILATION,
    ELLIPSOID_ALPHA_MAX,
    ELLIPSOID_TRANSMITTANCE_MIN,
    GaussianMaps,
    Gaussians,
)
from graycard.methods.splat.reference._rasterize import checked_features, last_of_half, pixel_centres


@dataclass(frozen=True)
class Footprints:
    """The pictures of N Gaussians."""

    centres: torch.Tensor
    """Shape ``(N, 2)``, pixels."""
    covariances: torch.Tensor
    """Shape ``(N, 2, 2)``, squared pixels, dilated."""
    depths: torch.Tensor
    """Shape ``(N,)``, of the centres, metres."""
    thinning: torch.Tensor
    """Shape ``(N,)``: what the dilation multiplied the area of the picture by, inverted."""


def rasterize_gaussians_reference(
    gaussians: Gaussians,
    camera: Camera,
    features: torch.Tensor | None = None,
    antialiased: bool = False,
) -> GaussianMaps:
    """Draw Gaussians in the order of their centres' depth, in their dtype (float64 is meant).

    Returns:
        The maps, differentiable in every tensor of the Gaussians and in the features.

    Raises:
        ValueError: Features of another shape or dtype, or not finite.
    """
    features = checked_features(gaussians, features)
    order = torch.argsort(footprints(gaussians, camera).depths, stable=True)
    gaussians = Gaussians(
        gaussians.centres[order],
        gaussians.rotations[order],
        gaussians.scales[order],
        gaussians.opacities[order],
        features[order],
    )
    seen = footprints(gaussians, camera)
    alpha = _alpha(seen, gaussians.opacities * (seen.thinning if antialiased else 1), camera)
    after = torch.cumprod(1 - alpha, dim=0)
    before = torch.nn.functional.pad(after, (0, 0, 1, 0), value=1.0)[:-1]
    weight = torch.where(after > ELLIPSOID_TRANSMITTANCE_MIN, before * alpha, 0.0)
    total, size = weight.sum(dim=0), (camera.height, camera.width)
    depth = (weight * seen.depths[:, None]).sum(dim=0) / torch.where(total > 0, total, 1.0)
    median = last_of_half(seen.depths[:, None].expand_as(weight), before, weight)
    return GaussianMaps(
        (weight.T @ gaussians.features).reshape(*size, features.shape[1]),
        total.reshape(size),
        depth.reshape(size),
        median.reshape(size),
    )


def footprints(gaussians: Gaussians, camera: Camera) -> Footprints:
    """Return the pictures of Gaussians: the perspective is linear about each centre.

    Far outside of the image it would stretch them beyond all bounds: there the slope of the ray is kept at
    the field of view and a bit.
    """
    pose, K = (gaussians.centres.new_tensor(value) for value in (camera.world_to_camera, camera.K))
    centres = gaussians.centres @ pose[:3, :3].T + pose[:3, 3]
    z = torch.where(centres[:, 2] > NEAR, centres[:, 2], 1.0)
    slopes = _kept_slopes(centres[:, :2] / z[:, None], camera)
    axes = rotation_matrices(gaussians.rotations) * gaussians.scales[:, None]  # as columns, sized
    axes = pose[:3, :3] @ axes
    flat = (axes[:, :2] - slopes[:, :, None] * axes[:, 2:]) / z[:, None, None]
    covariances = K[:2, :2] @ flat
    covariances = covariances @ covariances.mT
    dilated = covariances + DILATION * torch.eye(2, dtype=z.dtype)
    thinning = (torch.linalg.det(covariances) / torch.linalg.det(dilated)).clamp(min=0)
    safe = torch.where(thinning > 0, thinning, 1.0).sqrt()  # the root has no slope at zero
    on_image = (centres / z[:, None]) @ K.T
    return Footprints(on_image[:, :2], dilated, centres[:, 2], torch.where(thinning > 0, safe, 0.0))


def _kept_slopes(slopes: torch.Tensor, camera: Camera) -> torch.Tensor:
    """Slopes x/z and y/z of rays, kept near the field of view."""
    K, size = camera.K, (camera.width, camera.height)
    kept = []
    for axis in range(2):
        more = BEYOND_VIEW * 0.5 * size[axis] / K[axis, axis]
        least = -K[axis, 2] / K[axis, axis] - more
        most = (size[axis] - K[axis, 2]) / K[axis, axis] + more
        kept.append(slopes[:, axis].clamp(least, most))
    return torch.stack(kept, dim=1)


def _alpha(seen: Footprints, opacities: torch.Tensor, camera: Camera) -> torch.Tensor:
    """Alpha of each Gaussian at each pixel, shape ``(N, P)``; 0 below ALPHA_MIN or behind the near plane."""
    offset = pixel_centres(camera, opacities.dtype) - seen.centres[:, None]
    inverse = torch.linalg.inv(seen.covariances)
    square = torch.einsum("npi,nij,npj->np", offset, inverse, offset)
    alpha = (opacities[:, None] * torch.exp(-0.5 * square)).clamp(max=ELLIPSOID_ALPHA_MAX)
    return torch.where((alpha >= ALPHA_MIN) & (seen.depths[:, None] > NEAR), alpha, 0.0)
