# SPDX-License-Identifier: Apache-2.0
"""Surfels over the sky: one sweep over the pixels, and one back."""

from collections.abc import Mapping
from typing import Any, cast

import numpy as np
import torch
from torch.autograd.function import once_differentiable

from graycard.methods._tensors import contiguous_array
from graycard.methods.splat import FeatureMaps, is_on_cpu
from graycard.methods.surfels._start import SKY


def composed(drawn: FeatureMaps, sky: torch.Tensor, values: Mapping[str, torch.Tensor]) -> torch.Tensor:
    """Return the encoded picture: surfels over the sky.

    Args:
        drawn: Features of three channels, encoded, and alpha.
        sky: shape ``(H, W, K)``: harmonics of the direction of each pixel; a constant, that gets no gradient.
        values: The parameters; the sky's are of shape ``(K, 3)``.

    Returns:
        Shape ``(H, W, 3)``, differentiable once in features, alpha and the sky's parameters.
    """
    if not is_on_cpu(drawn.features):
        return drawn.features + (1 - drawn.alpha)[..., None] * (sky.detach() @ values[SKY])
    return cast(torch.Tensor, _Over.apply(drawn.features, drawn.alpha, sky.detach(), values[SKY]))


class _Over(torch.autograd.Function):
    """The kernels as one differentiable step."""

    @staticmethod
    def forward(
        ctx: Any, features: torch.Tensor, alpha: torch.Tensor, sky: torch.Tensor, weights: torch.Tensor
    ) -> torch.Tensor:
        """Return the picture."""
        from graycard.methods.surfels._compose_kernels import over_sky  # Numba takes long to import

        ctx.save_for_backward(alpha, sky, weights)
        picture = torch.empty_like(features, memory_format=torch.contiguous_format)
        over_sky(*_pixels(features, alpha, sky), contiguous_array(weights), picture.view(-1, 3).numpy())
        return picture

    @staticmethod
    @once_differentiable
    def backward(  # type: ignore[override]  # the decorator hides the name of ctx from type checkers
        ctx: Any, *grad_outputs: torch.Tensor
    ) -> tuple[torch.Tensor | None, ...]:
        """Gradients of features, alpha and the sky's parameters."""
        from graycard.methods.surfels._compose_kernels import PIECE, from_over_sky

        alpha, sky, weights = ctx.saved_tensors
        to_alpha = torch.empty_like(alpha, memory_format=torch.contiguous_format)
        inputs = *_pixels(grad_outputs[0], alpha, sky), contiguous_array(weights)
        sums = np.zeros((-(-alpha.numel() // PIECE), *weights.shape))
        from_over_sky(*inputs, to_alpha.view(-1).numpy(), sums)
        return grad_outputs[0], to_alpha, None, torch.from_numpy(sums.sum(axis=0)).to(weights.dtype)


def _pixels(
    colours: torch.Tensor, alpha: torch.Tensor, sky: torch.Tensor
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """One row a pixel."""
    return (
        contiguous_array(colours).reshape(-1, 3),
        contiguous_array(alpha).reshape(-1),
        contiguous_array(sky).reshape(alpha.numel(), -1),
    )
