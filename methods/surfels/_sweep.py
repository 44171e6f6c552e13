# SPDX-License-Identifier: Apache-2.0
"""Dense depth of each photograph by multi-view stereo, without weights.

A plane sweep (Collins 1996), whose costs semi-global matching (Hirschmüller 2008) makes smooth.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from graycard import Camera
from graycard.io import Room
from graycard.methods.surfels._ncc import SweptView, mean_ncc
from graycard.methods.surfels._paths import semi_global
from graycard.methods.surfels._transfer import depth_ratio

PLANES = 64
WINDOW = 7
"""Pixels on each side of the windows that are compared."""
NEIGHBOURS = 4
"""Views that each is compared with; the better half counts, for what is hidden in one is seen in another."""
WIDEST = 50.0
"""Degrees between the directions of two views that are compared."""
STEP, JUMP = 0.04, 0.5
"""Costs: what a step to the next plane, and any larger one, costs between neighbouring pixels."""
WITNESSES = 2
"""Views that must agree; one where there is but one."""
AGREEMENT = 0.03
"""Relative difference of depth up to which two views agree."""


@dataclass(frozen=True, eq=False)
class SweptDepth:
    """Results of stereo for a view."""

    depth: np.ndarray
    """Shape ``(H, W)``: z-depth at which the partners look most alike, metres; NaN in a view without any."""
    sure: np.ndarray
    """Shape ``(H, W)``, bool: whether enough other views see the same surface there."""


def sweep_depths(views: Sequence[SweptView]) -> list[SweptDepth]:
    """Dense depth of each view, by the others.

    Args:
        views: Two or more, of one scene.
    """
    partners = [partners_of(views, number) for number in range(len(views))]
    room = Room()
    depths = [room.keep(sweep_depth(views, number)) for number in range(len(views))]
    swept = []
    for number, found in enumerate(partners):
        others = [(views[p].camera, depths[p]) for p in found]
        sure = _agreed(views[number].camera, depths[number], others)
        swept.append(SweptDepth(depths[number], room.keep(sure)))
    return swept


def sweep_depth(views: Sequence[SweptView], number: int) -> np.ndarray:
    """Dense depth of one view, by the others: z-depth at which they look most alike, sure or not.

    Args:
        views: Two or more, of one scene.
        number: Which of them.

    Returns:
        Shape ``(H, W)``, metres; NaN if no other looks from nearby in about the same direction.
    """
    return _swept(views[number], [views[p] for p in partners_of(views, number)])


def partners_of(views: Sequence[SweptView], number: int) -> list[int]:
    """Return the views that look from nearby in about the same direction, nearest first."""
    here = views[number].camera
    away = [float(np.linalg.norm(v.camera.position - here.position)) for v in views]
    turned = [np.degrees(np.arccos(np.clip(v.camera.forward @ here.forward, -1, 1))) for v in views]
    fit = [p for p in range(len(views)) if away[p] > 0 and turned[p] < WIDEST]
    return sorted(fit, key=lambda p: away[p])[:NEIGHBOURS]


def _swept(view: SweptView, partners: Sequence[SweptView]) -> np.ndarray:
    """Return the depth at which the partners look most alike, shape ``(H, W)``; NaN without partners."""
    if not partners:
        return np.full(view.grey.shape, np.nan)
    inverse = np.linspace(1 / view.far, 1 / view.near, PLANES)
    ncc = mean_ncc(view, partners, inverse[:, None, None], WINDOW)
    cost = semi_global(1 - np.moveaxis(ncc, 0, -1), STEP, JUMP)
    return 1 / _lowest(cost, inverse)


def _lowest(cost: np.ndarray, inverse: np.ndarray) -> np.ndarray:
    """Inverse depth of the lowest cost, between planes by a parabola through three of them."""
    best = cost.argmin(axis=-1).clip(1, len(inverse) - 2)
    left, middle, right = (
        np.take_along_axis(cost, best[..., None] + step, axis=-1)[..., 0] for step in (-1, 0, 1)
    )
    bend = left - 2 * middle + right
    shift = np.where(bend > 1e-9, 0.5 * (left - right) / np.maximum(bend, 1e-9), 0).clip(-0.5, 0.5)
    return inverse[best] + shift * (inverse[1] - inverse[0])


def _agreed(camera: Camera, depth: np.ndarray, others: Sequence[tuple[Camera, np.ndarray]]) -> np.ndarray:
    """Return where enough other views have about the same depth for the same point, shape ``(H, W)``,
    bool.
    """
    agree = np.zeros(depth.shape, np.int64)
    for other in others:
        agree += np.abs(depth_ratio(camera, depth, *other) - 1) < AGREEMENT
    return agree >= max(1, min(WITNESSES, len(others)))
