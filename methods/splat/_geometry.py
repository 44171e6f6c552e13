# SPDX-License-Identifier: Apache-2.0
"""Surfels as a camera sees them."""

from dataclasses import dataclass

import torch

from graycard import Camera
from graycard.methods.splat._surfels import Surfels


@dataclass(frozen=True)
class CameraSurfels:
    """The geometry of N surfels in the frame of a camera (OpenCV axes)."""

    centres: torch.Tensor
    """Shape ``(N, 3)``, metres."""
    axes: torch.Tensor
    """Shape ``(N, 2, 3)``: the disc's x and y axis, unit length."""
    normals: torch.Tensor
    """Shape ``(N, 3)``, unit length, facing the camera as seen from it at the surfel's centre."""
    scales: torch.Tensor
    """Shape ``(N, 2)``, metres."""


def see(surfels: Surfels, camera: Camera) -> CameraSurfels:
    """Take surfels to the camera's frame, in their dtype."""
    pose = surfels.centres.new_tensor(camera.world_to_camera)
    centres = surfels.centres @ pose[:3, :3].T + pose[:3, 3]
    axes = rotation_matrices(surfels.rotations).mT @ pose[:3, :3].T  # as rows
    away = (axes[:, 2] * centres).sum(dim=1, keepdim=True) > 0
    normals = torch.where(away, -axes[:, 2], axes[:, 2])
    return CameraSurfels(centres, axes[:, :2], normals, surfels.scales)


def rotation_matrices(quaternions: torch.Tensor) -> torch.Tensor:
    """Rotation matrices of shape ``(N, 3, 3)`` from quaternions ``(w, x, y, z)`` of any length, ``(N, 4)``.

    A quaternion is scaled to unit length first, so that gradients stay on the sphere of rotations.
    """
    w, x, y, z = (quaternions / quaternions.norm(dim=1, keepdim=True)).unbind(dim=1)
    rows = [
        torch.stack([1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)], dim=1),
        torch.stack([2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)], dim=1),
        torch.stack([2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)], dim=1),
    ]
    return torch.stack(rows, dim=1)


def box_centres(seen: CameraSurfels, camera: Camera) -> torch.Tensor:
    """Centre of the bounding box of each disc of one standard deviation, projected, shape ``(N, 2)``, pixels.

    With M = K [s_u t_u, s_v t_v, mu] and its rows m1, m2, m3, the box's centre in x is the sum of
    ``f * m1 * m3`` over the sum of ``f * m3 * m3``, f = (1, 1, -1): the pole of the image's edge
    direction with respect to the dual conic M diag(f) M^T (Huang et al. 2024, supplement; gsplat's
    ``means2d``). A disc that reaches the camera's plane has no box: there it is the projected centre.
    """
    M = disc_to_image(seen, camera)
    depth = M[:, :, 2:]
    signs = M.new_tensor([1.0, 1.0, -1.0])[:, None]
    whole = (signs * depth**2).sum(dim=1, keepdim=True) < 0
    f = torch.where(whole, signs, signs * M.new_tensor([0.0, 0.0, 1.0])[:, None])
    return (f * M[:, :, :2] * depth).sum(dim=1) / (f * depth**2).sum(dim=1)


def disc_to_image(seen: CameraSurfels, camera: Camera) -> torch.Tensor:
    """Return the transposed M = K [s_u t_u, s_v t_v, mu], shape ``(N, 3, 3)``: from ``(u, v, 1)`` to the
    image.
    """
    columns = torch.cat([seen.axes * seen.scales[:, :, None], seen.centres[:, None]], dim=1)
    return columns @ columns.new_tensor(camera.K).T
