# SPDX-License-Identifier: Apache-2.0
"""Colours that change with the direction of view: real spherical harmonics up to degree three."""

from typing import Any, cast

import numpy as np
import torch
from torch.autograd.function import once_differentiable

from graycard.methods.splat._devices import is_on_cpu
from graycard.methods.splat.ops._harmonics_basis import MAX_DEGREE, harmonics
from graycard.methods.splat.ops._pytorch import harmonics_sum


def coefficient_count(degree: int) -> int:
    """Return how many harmonics there are up to a degree: ``(degree + 1)^2``.

    Raises:
        ValueError: The degree is not 0 to 3.
    """
    if not 0 <= degree <= MAX_DEGREE:
        raise ValueError(f"expected a degree of 0 to {MAX_DEGREE}, got {degree}")
    return (degree + 1) ** 2


def harmonics_basis(directions: np.ndarray, degree: int) -> np.ndarray:
    """Values of the harmonics, in the order and with the signs of 3D Gaussian Splatting.

    Args:
        directions: shape ``(..., 3)``, unit length.
        degree: 0 to 3.

    Returns:
        Shape ``(..., (degree + 1)^2)``, float64.

    Raises:
        ValueError: The degree is not 0 to 3.
    """
    x, y, z = np.moveaxis(np.asarray(directions, dtype=np.float64), -1, 0)
    values = np.broadcast_arrays(*harmonics(x, y, z))
    return np.stack(values[: coefficient_count(degree)], axis=-1)


def spherical_harmonics_colours(
    coefficients: torch.Tensor, centres: torch.Tensor, eye: np.ndarray, degree: int
) -> torch.Tensor:
    """Return the sum of coefficients times harmonics in the direction from an eye to each centre.

    Nothing is added and nothing is cut off: 3D Gaussian Splatting adds one half and clips at zero.

    Args:
        coefficients: shape ``(N, K, 3)``, float32 or float64, K >= (degree + 1)^2; any colour space.
        centres: shape ``(N, 3)``, world, metres, in the same dtype.
        eye: shape ``(3,)``, world, metres: the position of the camera.
        degree: 0 to 3; harmonics of higher degree are not used, and their coefficients get no gradient.

    Returns:
        Shape ``(N, 3)``, in the dtype of the coefficients; differentiable once in coefficients and centres.
        A centre in the eye has no direction: it gets what is the same in all.

    Raises:
        ValueError: Shapes or dtypes do not fit, or the degree is not 0 to 3.
    """
    used = coefficient_count(degree)
    count = len(centres)
    if coefficients.ndim != 3 or coefficients.shape[::2] != (count, 3) or coefficients.shape[1] < used:
        raise ValueError(
            f"expected coefficients of shape ({count}, {used} or more, 3), got {tuple(coefficients.shape)}"
        )
    if centres.shape != (count, 3) or centres.dtype != coefficients.dtype:
        raise ValueError(
            f"expected centres of shape (N, 3) in {coefficients.dtype}, "
            f"got {tuple(centres.shape)} in {centres.dtype}"
        )
    origin = np.asarray(eye, dtype=np.float64)
    if not is_on_cpu(coefficients):
        return harmonics_sum(coefficients, centres, origin, used)
    return cast(torch.Tensor, _Colours.apply(coefficients, centres, origin, used))


class _Colours(torch.autograd.Function):
    """The kernels as one differentiable step."""

    @staticmethod
    def forward(
        ctx: Any, coefficients: torch.Tensor, centres: torch.Tensor, eye: np.ndarray, used: int
    ) -> torch.Tensor:
        """Return the colours."""
        from graycard.methods.splat.ops._harmonics_forward import (
            colours_forward,  # Numba takes long to import
        )

        ctx.save_for_backward(coefficients, centres)
        ctx.eye, ctx.used = eye, used
        colours = torch.empty_like(centres, memory_format=torch.contiguous_format)
        colours_forward(_numbers(coefficients), _numbers(centres), eye, used, colours.numpy())
        return colours

    @staticmethod
    @once_differentiable
    def backward(  # type: ignore[override]  # the decorator hides the name of ctx from type checkers
        ctx: Any, *grad_outputs: torch.Tensor
    ) -> tuple[torch.Tensor | None, ...]:
        """Gradients of coefficients and centres."""
        from graycard.methods.splat.ops._harmonics_backward import colours_backward

        coefficients, centres = ctx.saved_tensors
        to_coefficients = torch.zeros_like(coefficients, memory_format=torch.contiguous_format)
        to_centres = torch.empty_like(centres, memory_format=torch.contiguous_format)
        inputs = _numbers(coefficients), _numbers(centres), ctx.eye, ctx.used, _numbers(grad_outputs[0])
        colours_backward(*inputs, to_coefficients.numpy(), to_centres.numpy())
        return to_coefficients, to_centres, None, None


def _numbers(values: torch.Tensor) -> np.ndarray:
    return np.ascontiguousarray(values.detach().numpy())
