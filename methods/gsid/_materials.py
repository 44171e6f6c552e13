# SPDX-License-Identifier: Apache-2.0
"""Materials that surfels begin with: what the prior says of the pixels in which they are seen."""

from collections.abc import Sequence

import torch

from graycard.methods.gsid._model import BASE_COLOR, METALLIC, ROUGHNESS, SHADOW
from graycard.methods.gsid._objective import DeferredView
from graycard.methods.splat import Surfels, gather

NEUTRAL = {BASE_COLOR: 0.4, ROUGHNESS: 0.6, METALLIC: 0.1}
"""Materials without a prior (inferred)."""
_INSIDE = 0.02
"""Distance from 0 and 1, whose logits are infinite: what begins there could not leave."""


def first_materials(
    surfels: Surfels, normals: torch.Tensor, shots: Sequence[DeferredView]
) -> dict[str, torch.Tensor]:
    """Parameters of surfels before the second stage.

    Args:
        surfels: N of them.
        normals: Shape ``(N, 3)``: shadow vectors begin against them, so that all is lit.
        shots: Of the training views.
    """
    answers = {
        BASE_COLOR: [shot.guess.base_color for shot in shots],
        ROUGHNESS: [shot.guess.roughness for shot in shots],
        METALLIC: [shot.guess.metallic for shot in shots],
    }
    found = {SHADOW: -normals}
    for name, images in answers.items():
        channels = 3 if name == BASE_COLOR else 1
        known = [(shot, image) for shot, image in zip(shots, images, strict=True) if image is not None]
        mean = _means(surfels, known, channels, NEUTRAL[name])
        found[name] = torch.logit(mean, eps=_INSIDE)
    return found


def _means(
    surfels: Surfels, images: Sequence[tuple[DeferredView, torch.Tensor]], channels: int, otherwise: float
) -> torch.Tensor:
    """Return means of the pixels in which each surfel is drawn, weighted as it is drawn, shape ``(N,
    channels)``.
    """
    total = torch.full((len(surfels), channels + 1), 1e-3)
    total[:, :channels] *= otherwise
    for shot, image in images:
        camera = shot.ground.camera
        size = camera.height, camera.width
        known = torch.cat([image.reshape(*size, channels), torch.ones(*size, 1)], dim=-1)
        total += gather(surfels, camera, known)
    return total[:, :channels] / total[:, channels:]
