# SPDX-License-Identifier: Apache-2.0
"""Cameras that go around what was fitted."""

from collections.abc import Sequence

import numpy as np

from graycard import Camera, look_at

FIELD = 50.0
"""Degrees, of the picture's width."""
RAISED = 25.0
"""Degrees above the horizon, where no cameras are known."""
REACH = 80
"""Percentile of the distances from the middle that a picture is to hold."""
SHAKEN = np.radians(3) ** 2
"""Mean square of the sine by which rows of pixels lean through an unsteady hand."""


def orbit(centres: np.ndarray, count: int, size: int, around: Sequence[Camera] = ()) -> list[Camera]:
    """Return cameras on a circle that look at its middle, upright.

    Args:
        centres: Of the surfels, shape ``(N, 3)``, metres.
        count: Of cameras.
        size: Of the pictures, pixels a side.
        around: Cameras of the photographs: where they look, how far and how high they stand is kept, and what
            is up in them. Without any the circle lies around the surfels, about z.
    """
    up = up_of(around)
    middle, distance, height = _of_cameras(around, up) if len(around) > 1 else _of_surfels(centres)
    turns = 2 * np.pi * np.arange(count) / count
    field = float(np.degrees(2 * np.arctan(0.5 * around[0].width / around[0].K[0, 0]))) if around else FIELD
    first, second = _level(up)
    places = (middle + distance * (np.cos(t) * first + np.sin(t) * second) + height * up for t in turns)
    poses = (look_at(place, middle, (up[0], up[1], up[2])) for place in places)
    return [Camera.from_fov(size, size, field, pose) for pose in poses]


def up_of(cameras: Sequence[Camera]) -> np.ndarray:
    """Return the direction that is up in photographs, shape ``(3,)``, unit length; z without any.

    Rows of pixels are level where nobody held the camera askew, whichever way it looked down: up is at right
    angles to all of them. What they leave open, as when all cameras look the same way, is decided by the mean
    of what is up in each photograph.
    """
    if not cameras:
        return np.array([0.0, 0.0, 1.0])
    turns = np.stack([c.camera_to_world[:3, :3] for c in cameras])
    rows, mean = turns[:, :, 0], -turns[:, :, 1].mean(axis=0)
    if np.linalg.norm(mean) < 1e-6:
        return up_of(())
    along, axes = np.linalg.eigh(rows.T @ rows / len(rows))
    up = axes @ ((axes.T @ mean) / (1 + (along / SHAKEN) ** 2))
    return up / np.linalg.norm(up)


def _level(up: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return two directions, unit length, at right angles to up and to each other: x and y where z is up."""
    axis = np.eye(3)[0 if abs(up[0]) < 0.9 else 1]
    first = axis - (axis @ up) * up
    first /= np.linalg.norm(first)
    return first, np.cross(up, first)


def _of_surfels(centres: np.ndarray) -> tuple[np.ndarray, float, float]:
    middle = np.median(centres, axis=0)
    reach = max(float(np.percentile(np.linalg.norm(centres - middle, axis=1), REACH)), 1e-3)
    away = reach / np.sin(np.radians(FIELD / 2))
    return middle, away * np.cos(np.radians(RAISED)), away * np.sin(np.radians(RAISED))


def _of_cameras(cameras: Sequence[Camera], up: np.ndarray) -> tuple[np.ndarray, float, float]:
    """Return the point that is nearest to all optical axes, and where the median camera stands about it."""
    sides = [np.eye(3) - np.outer(c.forward, c.forward) for c in cameras]
    positions = np.stack([c.position for c in cameras])
    sums = np.sum(sides, axis=0) + 1e-3 * np.eye(3)  # parallel axes meet nowhere: then near the cameras
    ahead = positions + np.stack([c.forward for c in cameras])
    pulled = np.sum([s @ p for s, p in zip(sides, positions, strict=True)], axis=0) + 1e-3 * ahead.mean(
        axis=0
    )
    middle = np.linalg.solve(sums, pulled)
    offsets = positions - middle
    heights = offsets @ up
    distance = float(np.median(np.linalg.norm(offsets - np.outer(heights, up), axis=1)))
    return middle, max(distance, 1e-2), float(np.median(heights))
