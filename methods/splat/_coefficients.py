# SPDX-License-Identifier: Apache-2.0
"""What a kernel needs to know of a surfel: fourteen numbers in which a pixel costs a few operations.

Along the ray through a pixel that lies ``p`` away from the centre of the disc's box, in pixels, the disc's
plane is met at ``u = (U . (p, 1)) / (D . (p, 1))``, ``v`` likewise, at depth ``h / (D . (p, 1))``: the
ray of a pixel is linear in ``p``, and so are numerators and denominator. All exponents are to base two.
"""

from typing import NamedTuple

import numpy as np
import torch

from graycard import Camera
from graycard.methods.splat._geometry import CameraSurfels, box_centres, disc_to_image
from graycard.methods.splat._maps import ALPHA_MIN, NEAR

LOG2_E = 1.4426950408889634
PLANE = 9
"""Columns of the linear forms: three each of u, v and the denominator."""
LOG_OPACITY, HEIGHT, CENTRE_Z = 9, 10, 11
COLUMNS = 12
MARGIN = 0.01
"""Pixels by which a footprint is widened against rounding."""


class Footprints(NamedTuple):
    """Surfels that touch the image, in no order."""

    coefficients: torch.Tensor
    """Shape ``(n, COLUMNS)``, float64, differentiable: the linear forms of u, v (scaled so that the disc's
    exponent is u^2 + v^2) and the denominator; log2 of the opacity; h; z-depth of the centre."""
    centres: torch.Tensor
    """Shape ``(n, 2)``, float64, differentiable: of the projected disc's box where it is drawn, pixels."""
    bounds: np.ndarray
    """Shape ``(n, 4)``, int32: columns from, to, rows from, to; ends excluded; never empty."""
    kept: torch.Tensor
    """Shape ``(n,)``: their indices among the given."""


def footprints(
    seen: CameraSurfels, opacities: torch.Tensor, camera: Camera, offsets: torch.Tensor | None = None
) -> Footprints:
    """Coefficients of the surfels that can reach ``ALPHA_MIN`` at a pixel of the image."""
    kept = ((seen.centres[:, 2] > NEAR) & (opacities >= ALPHA_MIN)).nonzero()[:, 0]
    moved = torch.zeros_like(seen.centres[:, :2]) if offsets is None else offsets.double()
    bounds = _bounds(_pick(seen, kept), opacities[kept], moved[kept], camera)
    touches = (bounds[:, 0] < bounds[:, 1]) & (bounds[:, 2] < bounds[:, 3])
    kept = kept[torch.from_numpy(touches)]
    seen = _pick(seen, kept)
    boxes = box_centres(seen, camera)
    coefficients = _coefficients(seen, opacities[kept], boxes, camera)
    return Footprints(coefficients, boxes + moved[kept], bounds[touches], kept)


def _pick(seen: CameraSurfels, index: torch.Tensor) -> CameraSurfels:
    return CameraSurfels(seen.centres[index], seen.axes[index], seen.normals[index], seen.scales[index])


def _coefficients(
    seen: CameraSurfels, opacities: torch.Tensor, boxes: torch.Tensor, camera: Camera
) -> torch.Tensor:
    """The columns of :class:`Footprints`."""
    away = -seen.normals  # so that height and denominator are positive where the disc is seen
    height = (away * seen.centres).sum(dim=1)
    along = (seen.axes * seen.centres[:, None]).sum(dim=2, keepdim=True)
    uv = (height[:, None, None] * seen.axes - along * away[:, None]) / seen.scales[:, :, None]
    forms = torch.cat([uv * (LOG2_E / 2) ** 0.5, away[:, None]], dim=1)  # on rays
    slopes, constants = _on_pixels(forms, boxes, camera)
    plane = torch.cat([slopes, constants[:, :, None]], dim=2).reshape(-1, PLANE)
    rest = torch.stack([opacities.log2(), height, seen.centres[:, 2]], dim=1)
    return torch.cat([plane, rest], dim=1)


def _on_pixels(forms: torch.Tensor, boxes: torch.Tensor, camera: Camera) -> tuple[torch.Tensor, torch.Tensor]:
    """Linear forms on rays, ``(n, 3, 3)``, as slopes ``(n, 3, 2)`` in x, y and values at the box centres."""
    to_rays = torch.linalg.inv(torch.tensor(camera.K, dtype=boxes.dtype))
    on_image = forms @ to_rays
    middle = torch.nn.functional.pad(boxes, (0, 1), value=1.0)
    return on_image[:, :, :2], (on_image * middle[:, None]).sum(dim=2)


@torch.no_grad()
def _bounds(
    seen: CameraSurfels, opacities: torch.Tensor, offsets: torch.Tensor, camera: Camera
) -> np.ndarray:
    """Pixels that the disc, cut where alpha falls below ``ALPHA_MIN``, or its low-pass may reach.

    The rim of the disc of ``r`` standard deviations, projected, is a conic; its box has the centre
    of :func:`box_centres` with f = (r^2, r^2, -1) and half the width ``sqrt(c^2 - f m1 m1 / f m3 m3)``.
    """
    square = 2 * torch.log(opacities / ALPHA_MIN).clamp(min=0)
    M = disc_to_image(seen, camera)
    depth = M[:, :, 2:]
    f = torch.stack([square, square, -torch.ones_like(square)], dim=1)[:, :, None]
    norm = (f * depth**2).sum(dim=1)
    whole = norm < 0  # else the disc reaches the camera's plane: it may be anywhere
    norm = torch.where(whole, norm, -1.0)
    middle = (f * M[:, :, :2] * depth).sum(dim=1) / norm
    half = (middle**2 - (f * M[:, :, :2] ** 2).sum(dim=1) / norm).clamp(min=0).sqrt()
    boxes, radius = box_centres(seen, camera), (square / 2).sqrt()[:, None]
    low = torch.where(whole, torch.minimum(middle - half, boxes - radius), -torch.inf)
    high = torch.where(whole, torch.maximum(middle + half, boxes + radius), torch.inf)
    size = low.new_tensor([camera.width, camera.height])
    low, high = low + offsets, high + offsets
    first = torch.ceil(low - 0.5 - MARGIN).clamp(min=0).minimum(size)
    past = (torch.floor(high - 0.5 + MARGIN) + 1).clamp(min=0).minimum(size)
    return torch.stack([first, past], dim=2).reshape(-1, 4).to(torch.int32).numpy()
