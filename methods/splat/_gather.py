# SPDX-License-Identifier: Apache-2.0
"""Gathering from pictures: drawing, the other way round."""

from collections.abc import Sequence

import numpy as np
import torch

from graycard import Camera
from graycard.methods.splat._rasterize import rasterize_features
from graycard.methods.splat._surfels import Surfels

_UNSEEN = 0.025
"""Pixels of a view: a surfel that fills less in the mean is not seen. What lies behind an object shines
through it a little, and would else be inside of its masks."""


def gather(surfels: Surfels, camera: Camera, image: torch.Tensor) -> torch.Tensor:
    """Return sums of an image over pixels, each weighted by what a surfel gives to it.

    A surfel gives its alpha times what shines through those in front of it: the sums are the gradients of the
    drawn channels times the image with respect to the surfel's own.

    Args:
        surfels: N of them; their features do not count.
        camera: Of the image.
        image: Shape ``(H, W, C)``; ones sum up to the pixels that each surfel fills.

    Returns:
        Shape ``(N, C)``, without gradient.
    """
    with torch.enable_grad():
        channels = torch.zeros(len(surfels), image.shape[-1], dtype=surfels.centres.dtype, requires_grad=True)
        drawn = rasterize_features(surfels, camera, features=channels).features
        counted = (drawn * image).sum()
    return torch.autograd.grad(counted, channels)[0]


def share_inside(surfels: Surfels, cameras: Sequence[Camera], masks: Sequence[np.ndarray]) -> torch.Tensor:
    """Return which share of what each surfel gives to pictures lies inside of masks.

    Args:
        surfels: N of them.
        cameras: Of the views.
        masks: One a view, shape ``(H, W)``, bool.

    Returns:
        Shape ``(N,)``, 0 to 1; 0 for what no view sees.

    Raises:
        ValueError: There is not one mask a camera, or one is not of its size.
    """
    if len(cameras) != len(masks):
        raise ValueError(f"expected one mask a camera, got {len(masks)} of {len(cameras)}")
    filled = torch.zeros(len(surfels), 2, dtype=surfels.centres.dtype)
    for camera, mask in zip(cameras, masks, strict=True):
        if mask.shape != (camera.height, camera.width):
            raise ValueError(f"expected a mask of shape {(camera.height, camera.width)}, got {mask.shape}")
        inside = torch.from_numpy(np.asarray(mask, np.float64)).to(filled.dtype)
        filled += gather(surfels, camera, torch.stack([inside, torch.ones_like(inside)], dim=-1))
    inside, everywhere = filled.unbind(dim=1)
    least = _UNSEEN * max(len(cameras), 1)
    return torch.where(everywhere > least, inside / everywhere.clamp(min=least), 0.0)
