# SPDX-License-Identifier: Apache-2.0
"""Cameras that go around what was fitted, z up."""

from collections.abc import Sequence

import numpy as np

from graycard import Camera, look_at

FIELD = 50.0
"""Degrees, of the picture's width."""
RAISED = 25.0
"""Degrees above the horizon, where no cameras are known."""
REACH = 80
"""Percentile of the distances from the middle that a picture is to hold."""


def orbit(centres: np.ndarray, count: int, size: int, around: Sequence[Camera] = ()) -> list[Camera]:
    """Return cameras on a circle that look at its middle.

    Args:
        centres: Of the surfels, shape ``(N, 3)``, metres.
        count: Of cameras.
        size: Of the pictures, pixels a side.
        around: Cameras of the photographs: where they look, how far and how high they stand is kept. Without
            any the circle lies around the surfels.
    """
    middle, distance, height = _of_cameras(around) if len(around) > 1 else _of_surfels(centres)
    turns = 2 * np.pi * np.arange(count) / count
    field = float(np.degrees(2 * np.arctan(0.5 * around[0].width / around[0].K[0, 0]))) if around else FIELD
    places = (middle + np.array([distance * np.cos(t), distance * np.sin(t), height]) for t in turns)
    return [Camera.from_fov(size, size, field, look_at(place, middle)) for place in places]


def _of_surfels(centres: np.ndarray) -> tuple[np.ndarray, float, float]:
    middle = np.median(centres, axis=0)
    reach = max(float(np.percentile(np.linalg.norm(centres - middle, axis=1), REACH)), 1e-3)
    away = reach / np.sin(np.radians(FIELD / 2))
    return middle, away * np.cos(np.radians(RAISED)), away * np.sin(np.radians(RAISED))


def _of_cameras(cameras: Sequence[Camera]) -> tuple[np.ndarray, float, float]:
    """The point that is nearest to all optical axes, and where the median camera stands about it."""
    sides = [np.eye(3) - np.outer(c.forward, c.forward) for c in cameras]
    positions = np.stack([c.position for c in cameras])
    sums = np.sum(sides, axis=0) + 1e-3 * np.eye(3)  # parallel axes meet nowhere: then near the cameras
    ahead = positions + np.stack([c.forward for c in cameras])
    pulled = np.sum([s @ p for s, p in zip(sides, positions, strict=True)], axis=0) + 1e-3 * ahead.mean(
        axis=0
    )
    middle = np.linalg.solve(sums, pulled)
    offsets = positions - middle
    distance = float(np.median(np.linalg.norm(offsets[:, :2], axis=1)))
    return middle, max(distance, 1e-2), float(np.median(offsets[:, 2]))
