# SPDX-License-Identifier: Apache-2.0
"""Consistency: whether the normals of surfels are those of the surface that their depth draws (Huang et
al. 2024).
"""

from typing import Any, NamedTuple, cast

import numpy as np
import torch
from torch.autograd.function import once_differentiable

from graycard import Camera
from graycard.methods.splat._devices import DEVICES, is_on_cpu
from graycard.methods.splat.ops._pytorch import normal_mismatch, normals_of_depth


def depth_to_normals(depth: torch.Tensor, camera: Camera) -> torch.Tensor:
    """Return normals of the surface through the back-projected pixels.

    The central differences of the points to the right and downwards are crossed, as in 2D Gaussian Splatting
    (Huang et al. 2024, equation 15 and their code); the result faces the camera.

    Args:
        depth: z-depth, shape ``(H, W)`` of the camera, metres, float32 or float64. Where it is
            not positive, or infinite, there is no surface.
        camera: The pinhole camera.

    Returns:
        Unit normals, world, shape ``(H, W, 3)``, in the dtype of the depth; zero on the image's border
        and where one of the four neighbours is no surface. Differentiable once in the depth.

    Raises:
        ValueError: A depth of another shape or dtype, or neither on the CPU nor on a GPU.
    """
    _check("depth", depth, (camera.height, camera.width), depth)
    frame = _frame(camera, depth.dtype)
    if not is_on_cpu(depth):
        return normals_of_depth(depth, frame)
    return cast(torch.Tensor, _Normals.apply(depth, frame))


def depth_normal_map(
    depth: torch.Tensor, normal: torch.Tensor, alpha: torch.Tensor, camera: Camera
) -> torch.Tensor:
    """``1 - alpha N . N_d``, N_d being :func:`depth_to_normals`: how much drawn normals and depth disagree.

    Alpha is a constant here, as in the code of 2D Gaussian Splatting: else surfels would become transparent
    to agree.

    Args:
        depth: z-depth, shape ``(H, W)`` of the camera, metres, float32 or float64.
        normal: shape ``(H, W, 3)``, world, not unit length: the sum of weights times normals.
        alpha: shape ``(H, W)``, the sum of weights; gets no gradient.
        camera: The pinhole camera.

    Returns:
        Shape ``(H, W)``, unreduced: about ``1 - alpha^2`` where they agree, 1 where there is no normal
        from depth. Differentiable once in depth and normal.

    Raises:
        ValueError: Images of other shapes, or unequal dtypes or devices.
    """
    size = (camera.height, camera.width)
    for name, one, tail in (("depth", depth, ()), ("normal", normal, (3,)), ("alpha", alpha, ())):
        _check(name, one, size + tail, depth)
    frame = _frame(camera, depth.dtype)
    if not is_on_cpu(depth):
        return normal_mismatch(depth, normal, alpha.detach(), frame)
    return cast(torch.Tensor, _Mismatch.apply(depth, normal, alpha.detach(), frame))


def _check(name: str, image: torch.Tensor, shape: tuple[int, ...], depth: torch.Tensor) -> None:
    """Refuse what does not go with the depth, or cannot be read."""
    if tuple(image.shape) != shape:
        raise ValueError(f"expected {name} of shape {shape}, got {tuple(image.shape)}")
    if image.dtype not in (torch.float32, torch.float64) or image.device.type not in DEVICES:
        raise ValueError(
            f"expected {name} in float32 or float64 on the CPU or a GPU, got {image.dtype} on {image.device}"
        )
    if (image.dtype, image.device) != (depth.dtype, depth.device):
        raise ValueError(
            f"expected {name} in the dtype of the depth, {depth.dtype}, on its device, {depth.device}, "
            f"got {image.dtype} on {image.device}"
        )


class Frame(NamedTuple):
    """Places where pixels lie in the world, in the dtype of the images."""

    rays: np.ndarray
    """Shape ``(3, max(H, W))``: x by column, what a row adds to it, y by row."""
    lens: np.ndarray
    """Shape ``(4,)``, see ``meet``; the last is one."""
    to_world: np.ndarray
    """Shape ``(3, 3)``, rotation of the camera."""
    to_camera: np.ndarray
    """Its inverse."""


def _frame(camera: Camera, dtype: torch.dtype) -> Frame:
    to_rays, middles = np.linalg.inv(camera.K), np.arange(max(camera.width, camera.height)) + 0.5
    rays = (
        to_rays[[0, 0, 1], [0, 1, 1]][:, None] * middles
        + np.array([to_rays[0, 2], 0, to_rays[1, 2]])[:, None]
    )
    lens = np.array([1 / to_rays[0, 0], 1 / to_rays[1, 1], to_rays[0, 1] / to_rays[1, 1], 1.0])
    to_world = camera.camera_to_world[:3, :3]
    numbers = np.float32 if dtype == torch.float32 else np.float64
    return Frame(*(np.ascontiguousarray(one, numbers) for one in (rays, lens, to_world, to_world.T)))


def _flat_frame(frame: Frame) -> Frame:
    """Return the frame with its matrices as lines, as the kernels that go by lines read them."""
    return frame._replace(to_world=frame.to_world.reshape(-1), to_camera=frame.to_camera.reshape(-1))


def _numbers(values: torch.Tensor) -> np.ndarray:
    return values.detach().contiguous().numpy()


class _Normals(torch.autograd.Function):
    """Normals from depth as a differentiable step."""

    @staticmethod
    def forward(ctx: Any, depth: torch.Tensor, frame: Frame) -> torch.Tensor:
        """See :func:`depth_to_normals`."""
        from graycard.methods.splat.ops._depth_normal_forward import (
            normals_forward,  # Numba takes long to import
        )

        normals = torch.zeros((*depth.shape, 3), dtype=depth.dtype)
        normals_forward(_numbers(depth), frame, normals.numpy())
        ctx.save_for_backward(depth)
        ctx.frame = frame
        return normals

    @staticmethod
    @once_differentiable
    def backward(  # type: ignore[override]  # the decorator hides the name of ctx from type checkers
        ctx: Any, *grad_outputs: torch.Tensor
    ) -> tuple[torch.Tensor | None, ...]:
        """Return the gradient of the depth."""
        from graycard.methods.splat.ops._depth_normal_backward import normals_backward

        (depth,) = ctx.saved_tensors
        frame, pulls = ctx.frame, torch.zeros((2, *depth.shape), dtype=depth.dtype)
        to_depth = torch.empty(depth.shape, dtype=depth.dtype)
        room = _numbers(grad_outputs[0]), pulls.numpy(), to_depth.numpy()
        normals_backward(_numbers(depth), frame, *room)
        return to_depth, None


class _Mismatch(torch.autograd.Function):
    """Disagreement of normals as a differentiable step."""

    @staticmethod
    def forward(
        ctx: Any, depth: torch.Tensor, normal: torch.Tensor, alpha: torch.Tensor, frame: Frame
    ) -> torch.Tensor:
        """See :func:`depth_normal_map`."""
        values = _mismatch(_numbers(depth), _numbers(normal), _numbers(alpha), frame)
        ctx.save_for_backward(depth, normal, alpha)
        ctx.frame = frame
        return torch.from_numpy(values)

    @staticmethod
    @once_differentiable
    def backward(  # type: ignore[override]  # as above
        ctx: Any, *grad_outputs: torch.Tensor
    ) -> tuple[torch.Tensor | None, ...]:
        """Return the gradients of depth and normal."""
        depth, normal, alpha = (_numbers(one) for one in ctx.saved_tensors)
        made = _mismatch_gradients(depth, normal, alpha, ctx.frame, _numbers(grad_outputs[0]))
        return *(torch.from_numpy(values) for values in made), None, None


def _mismatch(depth: np.ndarray, normal: np.ndarray, alpha: np.ndarray, frame: Frame) -> np.ndarray:
    """See :func:`depth_normal_map`."""
    if _by_lines(depth):
        from graycard.methods.splat.ops._depth_normal_kernels import mismatch_lines_forward

        values = np.empty_like(depth)
        flat = normal.reshape(-1), alpha.reshape(-1), values.reshape(-1)
        place = depth.reshape(-1), depth.shape[1], _flat_frame(frame)
        mismatch_lines_forward(*place, *flat)
        return values
    from graycard.methods.splat.ops._depth_normal_forward import mismatch_forward

    values = np.ones_like(depth)
    mismatch_forward(depth, frame, normal, alpha, values)
    return values


def _mismatch_gradients(
    depth: np.ndarray, normal: np.ndarray, alpha: np.ndarray, frame: Frame, upstream: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Gradients of depth and normal."""
    to_depth = np.empty_like(depth)
    if _by_lines(depth):
        from graycard.methods.splat.ops._depth_normal_kernels import mismatch_lines_backward

        pulls, to_normal = np.empty((2, *depth.shape), np.float32), np.empty_like(normal)
        place = depth.reshape(-1), depth.shape[1], _flat_frame(frame)
        given = normal.reshape(-1), alpha.reshape(-1), upstream.reshape(-1)
        made = pulls, to_depth.reshape(-1), to_normal.reshape(-1)
        mismatch_lines_backward(*place, *given, *made)
        return to_depth, to_normal
    from graycard.methods.splat.ops._depth_normal_backward import mismatch_backward

    pulls, to_normal = np.zeros((2, *depth.shape), depth.dtype), np.zeros_like(normal)
    mismatch_backward(depth, frame, normal, alpha, upstream, pulls, to_depth, to_normal)
    return to_depth, to_normal


def _by_lines(depth: np.ndarray) -> bool:
    """Return whether the faster kernels can take it."""
    from graycard.methods.splat.ops._depth_normal_kernels import LEAST_WIDTH  # Numba takes long to import

    return depth.dtype == np.float32 and depth.shape[1] >= LEAST_WIDTH
