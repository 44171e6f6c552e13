# SPDX-License-Identifier: Apache-2.0
"""Dense depth of each photograph by multi-view stereo, without weights.

A plane sweep (Collins 1996), whose costs semi-global matching (Hirschmüller 2008) makes smooth.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch
from torch.nn.functional import avg_pool2d, grid_sample

from graycard import Camera

Ease = tuple[np.ndarray, np.ndarray]

PLANES = 64
WINDOW = 7
"""Pixels on each side of the windows that are compared."""
NEIGHBOURS = 4
"""Views that each is compared with; the better half counts, for what is hidden in one is seen in another."""
WIDEST = 50.0
"""Degrees between the directions of two views that are compared."""
NOISE = 2e-4
"""Variance, in encoded units, below which a window has no structure."""
STEP, JUMP = 0.04, 0.5
"""What a step to the next plane, and any larger one, costs between neighbouring pixels."""
WITNESSES = 2
"""Views that must agree; one where there is but one."""
AGREEMENT = 0.03
"""Relative difference of depth up to which two views agree."""

HIDES = 0.05
"""Of its depth by which a point must be nearer than what another view sees to be in its way."""


@dataclass(frozen=True, eq=False)
class SweptView:
    """A photograph and between which depths its surfaces are sought."""

    camera: Camera
    grey: torch.Tensor
    """Shape ``(H, W)``, encoded."""
    near: float
    """Metres of z-depth."""
    far: float


@dataclass(frozen=True, eq=False)
class SweptDepth:
    """What stereo says about a view."""

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
    depths = [sweep_depth(views, number) for number in range(len(views))]
    swept = []
    for number, found in enumerate(partners):
        others = [(views[p].camera, depths[p]) for p in found]
        sure = _agreed(views[number].camera, depths[number], others)
        swept.append(SweptDepth(depths[number], sure))
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
    """The views that look from nearby in about the same direction, nearest first."""
    here = views[number].camera
    away = [float(np.linalg.norm(v.camera.position - here.position)) for v in views]
    turned = [np.degrees(np.arccos(np.clip(v.camera.forward @ here.forward, -1, 1))) for v in views]
    fit = [p for p in range(len(views)) if away[p] > 0 and turned[p] < WIDEST]
    return sorted(fit, key=lambda p: away[p])[:NEIGHBOURS]


def _swept(view: SweptView, partners: Sequence[SweptView]) -> np.ndarray:
    """The depth at which the partners look most alike, shape ``(H, W)``; NaN without partners."""
    if not partners:
        return np.full(view.grey.shape, np.nan)
    inverse = np.linspace(1 / view.far, 1 / view.near, PLANES)
    likeness = mean_likeness(view, partners, inverse[:, None, None], WINDOW)
    cost = semi_global(1 - likeness.permute(1, 2, 0).numpy(), STEP, JUMP)
    return 1 / _lowest(cost, inverse)


def mean_likeness(
    view: SweptView, partners: Sequence[SweptView], inverse: np.ndarray, window: int
) -> torch.Tensor:
    """How much the better half of the partners look like a view, if its surfaces are at some depths.

    Args:
        view: The view.
        partners: One or more others.
        inverse: shape ``(K, H, W)`` or ``(K, 1, 1)``: K hypotheses of one over z-depth, 1/m, positive.
        window: Pixels on each side of the windows that are compared, odd.

    Returns:
        Mean normalised cross-correlation of windows, shape ``(K, H, W)``, [-1, 1].
    """
    likeness = torch.stack([_likeness(view, partner, inverse, window) for partner in partners])
    return likeness.topk((len(partners) + 1) // 2, dim=0).values.mean(dim=0)


def _likeness(view: SweptView, partner: SweptView, inverse: np.ndarray, window: int) -> torch.Tensor:
    """Normalised cross-correlation of windows, shape ``(K, H, W)``; 0 outside the partner."""
    rays = view.camera.rays() / (view.camera.rays() @ view.camera.forward)[..., None]
    points = view.camera.position + rays / inverse[..., None]
    pixels, z = partner.camera.project(points)
    size = np.array([partner.camera.width, partner.camera.height])
    seen = torch.from_numpy((z > 0) & (pixels > 0).all(axis=-1) & (pixels < size).all(axis=-1))
    grid = torch.from_numpy((2 * pixels / size - 1).astype(np.float32))
    images = partner.grey.expand(len(inverse), 1, -1, -1)
    warped = grid_sample(images, grid, align_corners=False, padding_mode="border")
    mine = view.grey[None, None]
    mean, other = _mean(mine, window), _mean(warped, window)
    covariance = _mean(mine * warped, window) - mean * other
    variances = (_mean(mine * mine, window) - mean**2) * (_mean(warped * warped, window) - other**2)
    correlation = covariance / (variances.clamp(min=0).sqrt() + NOISE)
    return torch.where(seen, correlation[:, 0], 0.0)


def _mean(images: torch.Tensor, window: int) -> torch.Tensor:
    """Mean over a square window; at the border over what there is."""
    half = window // 2
    rows = avg_pool2d(images, (window, 1), 1, (half, 0), count_include_pad=False)
    return avg_pool2d(rows, (1, window), 1, (0, half), count_include_pad=False)


def semi_global(cost: np.ndarray, step: float, jump: float, ease: Ease | None = None) -> np.ndarray:
    """Costs summed along paths from four sides, on which a change of label has a price.

    Args:
        cost: shape ``(H, W, K)``, of each of K labels.
        step: Price of a change to the label before or after.
        jump: Price of any other change.
        ease: Factors on both prices between neighbours, (0, 1]: shapes ``(H - 1, W)`` and ``(H, W - 1)``;
            1 if None.
    """
    height, width = cost.shape[:2]
    factors = ease or (np.ones((height - 1, width)), np.ones((height, width - 1)))
    total = np.zeros_like(cost)
    for axis, factor in enumerate(factors):
        lines, weights = np.moveaxis(cost, axis, 0), np.moveaxis(factor, axis, 0)[..., None]
        for way in (1, -1):
            paths = _along(lines[::way], step * weights[::way], jump * weights[::way])
            total += np.moveaxis(paths[::way], 0, axis)
    return total


def _along(lines: np.ndarray, step: np.ndarray, jump: np.ndarray) -> np.ndarray:
    """The least cost of a path that ends at each pixel and label, along the first axis."""
    paths = np.empty_like(lines)
    paths[0] = lines[0]
    for here in range(1, len(lines)):
        before = paths[here - 1]
        least = before.min(axis=-1, keepdims=True)
        beside = np.pad(before, ((0, 0), (1, 1)), constant_values=np.inf)
        stepped = np.minimum(beside[:, :-2], beside[:, 2:]) + step[here - 1]
        paths[here] = lines[here] + np.minimum(np.minimum(before, stepped), least + jump[here - 1]) - least
    return paths


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
    """Where enough other views have about the same depth for the same point, shape ``(H, W)``, bool."""
    agree = [np.abs(depth_ratio(camera, depth, *other) - 1) < AGREEMENT for other in others]
    return np.sum(agree, axis=0, initial=0) >= max(1, min(WITNESSES, len(others)))


def depth_ratio(camera: Camera, depth: np.ndarray, other: Camera, there: np.ndarray) -> np.ndarray:
    """How far the points of a view are from another one, in shares of what that one sees in their place.

    Args:
        camera: Of the view.
        depth: shape ``(H, W)``, its z-depth, metres.
        other: The other camera.
        there: shape ``(H', W')``, z-depth of the other view.

    Returns:
        Shape ``(H, W)``; below 1 in front of what the other sees; NaN outside its image.
    """
    rays = camera.rays() / (camera.rays() @ camera.forward)[..., None]
    pixels, z = other.project(camera.position + rays * depth[..., None])
    pixels = np.where(np.isfinite(pixels), pixels, -1)
    inside = (z > 0) & (pixels >= 0).all(axis=-1) & (pixels < [other.width, other.height]).all(axis=-1)
    column, row = np.where(inside[..., None], pixels, 0).astype(np.int64).transpose(2, 0, 1)
    return np.where(inside, z / there[row, column], np.nan)
