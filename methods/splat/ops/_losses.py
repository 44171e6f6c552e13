# SPDX-License-Identifier: Apache-2.0
"""Photometric losses, pixel by pixel: absolute difference and SSIM."""

from typing import Any, NamedTuple, cast

import numpy as np
import torch
from torch.autograd.function import once_differentiable

from graycard.methods.splat._devices import DEVICES, is_on_cpu
from graycard.methods.splat.ops._pytorch import compare_images

SSIM_SHARE = 0.2
"""Weight of 1 - SSIM beside the absolute difference, as in 3D Gaussian Splatting (Kerbl et al. 2023)."""


def l1_map(image: torch.Tensor, target: torch.Tensor) -> torch.Tensor:
    """Absolute difference of each pixel and channel.

    Args:
        image: shape ``(H, W, C)``, float32, linear or encoded.
        target: the same; a constant, that gets no gradient.

    Returns:
        Shape ``(H, W, C)``, in the unit of the images; its gradient is zero where they are equal.

    Raises:
        ValueError: Images of other shapes, dtypes or devices.
    """
    _check(image, target)
    return (image - target.detach()).abs()


def ssim_map(image: torch.Tensor, target: torch.Tensor) -> torch.Tensor:
    """Structural similarity around each pixel, channel by channel (Wang et al. 2004, equation 13).

    The window is a Gaussian of 11 x 11 pixels with a standard deviation of 1.5; beyond its border an image is
    zero, as in the code of 3D Gaussian Splatting. The constants C1 = 0.01^2 and C2 = 0.03^2 suppose values
    in [0, 1]: linear images of another range get another weighting of contrast, not an error.

    Args:
        image: shape ``(H, W, C)``, float32, linear or encoded; a NaN spreads to the windows
            that hold it.
        target: the same; a constant, that gets no gradient.

    Returns:
        Shape ``(H, W, C)``, at most 1, which is where the images are equal; unreduced.

    Raises:
        ValueError: Images of other shapes, dtypes or devices.
    """
    return _compare(image, target, base=1.0, absolute=0.0, dissimilar=-1.0)


def photometric_map(
    image: torch.Tensor, target: torch.Tensor, ssim_share: float = SSIM_SHARE
) -> torch.Tensor:
    """``(1 - s) |image - target| + s (1 - SSIM)``, s being ``ssim_share``: both in one sweep.

    Args:
        image: as in :func:`ssim_map`.
        target: as in :func:`ssim_map`; a constant, that gets no gradient.
        ssim_share: in [0, 1].

    Returns:
        Shape ``(H, W, C)``; unreduced, so that the caller may weight or mask pixels before the mean.

    Raises:
        ValueError: Images of other shapes, dtypes or devices, or a share outside [0, 1].
    """
    if not 0 <= ssim_share <= 1:
        raise ValueError(f"expected ssim_share in [0, 1], got {ssim_share}")
    return _compare(image, target, base=0.0, absolute=1 - ssim_share, dissimilar=ssim_share)


def _compare(
    image: torch.Tensor, target: torch.Tensor, base: float, absolute: float, dissimilar: float
) -> torch.Tensor:
    """Return the kernels' map; images too narrow for a vector get columns of zeros, which lie beyond them
    anyway.
    """
    _check(image, target)
    if not is_on_cpu(image):
        return compare_images(image, target.detach(), (base, absolute, dissimilar))
    _, width, channels = image.shape
    wider = _columns_for_a_vector(channels) - width
    if wider > 0:
        image, target = (torch.nn.functional.pad(one, (0, 0, 0, wider)) for one in (image, target))
    terms = np.array([base, absolute, dissimilar], np.float32)
    compared = cast(torch.Tensor, _Compare.apply(image, target.detach(), terms))
    return compared[:, :width]


def _columns_for_a_vector(channels: int) -> int:
    from graycard.methods.splat.ops._ssim_forward import LANES  # Numba takes long to import

    return -(-LANES // channels)


def _check(image: torch.Tensor, target: torch.Tensor) -> None:
    """Refuse what the kernels cannot read."""
    for name, one in (("image", image), ("target", target)):
        if one.ndim != 3 or 0 in one.shape:
            raise ValueError(f"expected {name} of shape (H, W, C), none of them zero, got {tuple(one.shape)}")
        if one.dtype != torch.float32 or one.device.type not in DEVICES:
            raise ValueError(
                f"expected {name} in float32 on the CPU or a GPU, got {one.dtype} on {one.device}"
            )
    if (image.shape, image.device) != (target.shape, target.device):
        raise ValueError(
            f"expected a target of shape {tuple(image.shape)} on {image.device}, "
            f"got {tuple(target.shape)} on {target.device}"
        )


def _flat(values: torch.Tensor) -> np.ndarray:
    return values.detach().contiguous().view(-1).numpy()


class _Pictures(NamedTuple):
    """Two images as the kernels read them."""

    image: np.ndarray
    """Float32, flat: rows of at least ``LANES`` floats."""
    target: np.ndarray
    """The same."""
    height: int
    """Rows."""
    length: int
    """Floats in a row: columns times channels."""
    channels: int


def _pictures(image: torch.Tensor, target: torch.Tensor) -> _Pictures:
    height, width, channels = image.shape
    return _Pictures(_flat(image), _flat(target), height, width * channels, channels)


class _Compare(torch.autograd.Function):
    """The kernels as one differentiable step."""

    @staticmethod
    def forward(ctx: Any, image: torch.Tensor, target: torch.Tensor, terms: np.ndarray) -> torch.Tensor:
        """Return the map of ``ssim_forward``."""
        from graycard.methods.splat.ops._ssim_forward import SAVED, ssim_forward

        values = torch.empty_like(image, memory_format=torch.contiguous_format)
        saved = torch.empty(SAVED * image.numel() if ctx.needs_input_grad[0] else 0).numpy()  # aligned
        ssim_forward(_pictures(image, target), terms, _flat(values), saved)
        ctx.save_for_backward(image, target)
        ctx.terms, ctx.saved = terms, saved
        return values

    @staticmethod
    @once_differentiable
    def backward(  # type: ignore[override]  # the decorator hides the name of ctx from type checkers
        ctx: Any, *grad_outputs: torch.Tensor
    ) -> tuple[torch.Tensor | None, ...]:
        """Return the gradient of the image."""
        from graycard.methods.splat.ops._ssim_backward import ssim_backward

        to_image = torch.empty(grad_outputs[0].shape)
        inputs = _pictures(*ctx.saved_tensors), ctx.terms, ctx.saved
        ssim_backward(*inputs, _flat(grad_outputs[0]), _flat(to_image))
        return to_image, None, None
