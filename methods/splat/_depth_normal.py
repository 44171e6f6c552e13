# SPDX-License-Identifier: Apache-2.0
"""Whether the normals of surfels are those of the surface that their depth draws (Huang et al. 2024)."""

from typing import Any, NamedTuple, cast

import numpy as np
import torch
from torch.autograd.function import once_differentiable

from graycard import Camera


def depth_to_normals(depth: torch.Tensor, camera: Camera) -> torch.Tensor:
    """Normals of the surface through the back-projected pixels.

    The central differences of the points to the right and downwards are crossed, as in 2D Gaussian Splatting
    (Huang et al. 2024, equation 15 and their code); the result faces the camera.

    Args:
        depth: z-depth, shape ``(H, W)`` of the camera, metres, float32 or float64 on the CPU. Where it is
            not positive, or infinite, there is no surface.
        camera: The pinhole camera.

    Returns:
        Unit normals, world, shape ``(H, W, 3)``, in the dtype of the depth; zero on the image's border
        and where one of the four neighbours is no surface. Differentiable once in the depth.

    Raises:
        ValueError: A depth of another shape or dtype, or not on the CPU.
    """
    _check("depth", depth, (camera.height, camera.width), depth.dtype)
    return cast(torch.Tensor, _Normals.apply(depth, _frame(camera)))


def depth_normal_map(
    depth: torch.Tensor, normal: torch.Tensor, alpha: torch.Tensor, camera: Camera
) -> torch.Tensor:
    """``1 - alpha N . N_d``, N_d being :func:`depth_to_normals`: how much drawn normals and depth disagree.

    Alpha is a constant here, as in the code of 2D Gaussian Splatting: else surfels would become transparent
    to agree.

    Args:
        depth: z-depth, shape ``(H, W)`` of the camera, metres, float32 or float64 on the CPU.
        normal: shape ``(H, W, 3)``, world, not unit length: the sum of weights times normals.
        alpha: shape ``(H, W)``, the sum of weights; gets no gradient.
        camera: The pinhole camera.

    Returns:
        Shape ``(H, W)``, unreduced: about ``1 - alpha^2`` where they agree, 1 where there is no normal
        from depth. Differentiable once in depth and normal.

    Raises:
        ValueError: Images of other shapes or unequal dtypes, or not on the CPU.
    """
    size = (camera.height, camera.width)
    for name, one, tail in (("depth", depth, ()), ("normal", normal, (3,)), ("alpha", alpha, ())):
        _check(name, one, size + tail, depth.dtype)
    return cast(torch.Tensor, _Mismatch.apply(depth, normal, alpha.detach(), _frame(camera)))


def _check(name: str, image: torch.Tensor, shape: tuple[int, ...], dtype: torch.dtype) -> None:
    """Refuse what the kernels cannot read."""
    if tuple(image.shape) != shape:
        raise ValueError(f"expected {name} of shape {shape}, got {tuple(image.shape)}")
    if image.dtype not in (torch.float32, torch.float64) or image.device.type != "cpu":
        raise ValueError(
            f"expected {name} in float32 or float64 on the CPU, got {image.dtype} on {image.device}"
        )
    if image.dtype != dtype:
        raise ValueError(f"expected {name} in the dtype of the depth, {dtype}, got {image.dtype}")


class _Frame(NamedTuple):
    """How pixels lie in the world."""

    to_rays: np.ndarray
    to_world: np.ndarray


def _frame(camera: Camera) -> _Frame:
    return _Frame(np.linalg.inv(camera.K), np.ascontiguousarray(camera.camera_to_world[:3, :3]))


def _numbers(values: torch.Tensor) -> np.ndarray:
    return values.detach().contiguous().numpy()


def _normals(depth: torch.Tensor, frame: _Frame) -> torch.Tensor:
    from graycard.methods.splat._depth_normal_forward import normals_forward  # Numba takes long to import

    normals = torch.empty((*depth.shape, 3), dtype=depth.dtype)
    normals_forward(_numbers(depth), frame.to_rays, frame.to_world, normals.numpy())
    return normals


def _to_depth(depth: torch.Tensor, frame: _Frame, to_normals: torch.Tensor) -> torch.Tensor:
    """The gradient of the depth by that of the normals."""
    from graycard.methods.splat._depth_normal_backward import normals_backward

    to_camera, steps = np.ascontiguousarray(frame.to_world.T), np.empty((*depth.shape, 2, 3))
    gradient = torch.empty(depth.shape, dtype=depth.dtype)
    images = _numbers(to_normals), steps, gradient.numpy()
    normals_backward(_numbers(depth), frame.to_rays, to_camera, *images)
    return gradient


class _Normals(torch.autograd.Function):
    """Normals from depth as a differentiable step."""

    @staticmethod
    def forward(ctx: Any, depth: torch.Tensor, frame: _Frame) -> torch.Tensor:
        """As :func:`depth_to_normals`."""
        ctx.save_for_backward(depth)
        ctx.frame = frame
        return _normals(depth, frame)

    @staticmethod
    @once_differentiable
    def backward(  # type: ignore[override]  # the decorator hides the name of ctx from type checkers
        ctx: Any, *grad_outputs: torch.Tensor
    ) -> tuple[torch.Tensor | None, ...]:
        """The gradient of the depth."""
        (depth,) = ctx.saved_tensors
        return _to_depth(depth, ctx.frame, grad_outputs[0]), None


class _Mismatch(torch.autograd.Function):
    """Disagreement of normals as a differentiable step."""

    @staticmethod
    def forward(
        ctx: Any, depth: torch.Tensor, normal: torch.Tensor, alpha: torch.Tensor, frame: _Frame
    ) -> torch.Tensor:
        """As :func:`depth_normal_map`."""
        from graycard.methods.splat._depth_normal_forward import mismatch_forward

        normals, values = _normals(depth, frame), torch.empty(depth.shape, dtype=depth.dtype)
        mismatch_forward(normals.numpy(), _numbers(normal), _numbers(alpha), values.numpy())
        ctx.save_for_backward(depth, normal, alpha, normals)
        ctx.frame = frame
        return values

    @staticmethod
    @once_differentiable
    def backward(  # type: ignore[override]  # as above
        ctx: Any, *grad_outputs: torch.Tensor
    ) -> tuple[torch.Tensor | None, ...]:
        """The gradients of depth and normal."""
        from graycard.methods.splat._depth_normal_backward import mismatch_backward

        depth, normal, alpha, normals = ctx.saved_tensors
        to_normals, to_normal = torch.empty_like(normals), torch.empty_like(normals)
        given = _numbers(normals), _numbers(normal), _numbers(alpha), _numbers(grad_outputs[0])
        mismatch_backward(*given, to_normals.numpy(), to_normal.numpy())
        return _to_depth(depth, ctx.frame, to_normals), to_normal, None, None
