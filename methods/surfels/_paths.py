# SPDX-License-Identifier: Apache-2.0
"""Labels of pixels that agree with their neighbours: semi-global matching (Hirschmüller 2008)."""

import numpy as np

from graycard.methods._numba import njit
from graycard.methods.splat.parallel import UNWRAPPED, run, share, task

Ease = tuple[np.ndarray, np.ndarray]


def semi_global(cost: np.ndarray, step: float, jump: float, ease: Ease | None = None) -> np.ndarray:
    """Costs summed along paths from four sides, on which a change of label has a price.

    Args:
        cost: shape ``(H, W, K)``, of each of K labels.
        step: Price of a change to the label before or after.
        jump: Price of any other change.
        ease: Factors on both prices between neighbours, (0, 1]: shapes ``(H - 1, W)`` and ``(H, W - 1)``;
            1 if None.
    """
    height, width, labels = cost.shape
    down, across = ease or (np.ones((height - 1, width)), np.ones((height, width - 1)))
    down, across = (
        np.pad(factors, rim).ravel().astype(np.float64)
        for factors, rim in ((down, ((0, 1), (0, 0))), (across, ((0, 0), (0, 1))))
    )
    flat = np.ascontiguousarray(cost).reshape(-1, labels)
    total = np.zeros_like(flat)
    last_row, last_column = (height - 1) * width, width - 1
    for begin, way in ((0, width), (last_row, -width)):
        _add_paths(flat, step * down, jump * down, (begin, 1, width), (way, height), total)
    for begin, way in ((0, 1), (last_column, -1)):
        _add_paths(flat, step * across, jump * across, (begin, width, height), (way, width), total)
    return total.reshape(cost.shape)


@njit(cache=True)
def _add_paths(cost, step, jump, lines, along, total):
    """Add the least cost of a path that ends at each pixel and label.

    Args:
        cost: ``(H * W, K)``.
        step: ``(H * W,)``: price between a pixel and the next one below or beside it.
        jump: ``(H * W,)``.
        lines: first pixel, from there to that of the next line, number of lines.
        along: from a pixel to the next on its line, number of them.
        total: ``(H * W, K)``, to be added to.
    """
    run(task(_add_some_paths, (cost, step, jump, lines, along, total)))


@njit(**UNWRAPPED)
def _add_some_paths(part, parts, cost, step, jump, lines, along, total):
    """Go along a part of the lines."""
    begin, apart, count = lines
    stride, length = along
    labels = cost.shape[1]
    before = np.full(labels + 2, np.inf, cost.dtype)  # none beside the first and the last
    first, past = share(part, parts, count)
    for line in range(first, past):
        pixel = begin + line * apart
        for label in range(labels):
            before[label + 1] = cost[pixel, label]
            total[pixel, label] += cost[pixel, label]
        for _ in range(1, length):
            least = before[1]
            for label in range(1, labels):
                least = min(least, before[label + 1])
            between = min(pixel, pixel + stride)
            small, large = step[between], least + jump[between]
            pixel += stride
            left = before[0]
            for label in range(labels):
                same, right = before[label + 1], before[label + 2]
                way = min(min(same, min(left, right) + small), large)
                before[label + 1] = cost[pixel, label] + way - least
                left = same
            for label in range(labels):
                total[pixel, label] += before[label + 1]
