# SPDX-License-Identifier: Apache-2.0
"""Where in a scene there is room for a lamp or an object: boxes around things, and sides of walls."""

from collections.abc import Iterable

import numpy as np

import graycard as gc
from graycard.synth._mesh import Mesh
from graycard.synth._scene import Ball, Geometry, Quad, Scene, Thing


def bounds(geometry: Geometry) -> np.ndarray:
    """The least and the greatest coordinates of a shape, ``(2, 3)``, metres."""
    match geometry:
        case Mesh() as mesh:
            return np.stack([mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)])
        case Ball(center, radius):
            return np.array(center) + radius * np.array([[-1.0], [1.0]])
        case Quad(center, half_u, half_v):
            reach = np.abs(half_u) + np.abs(half_v)
            return np.array(center) + reach * np.array([[-1.0], [1.0]])


def is_free(scene: Scene, points: np.ndarray, margin: float, but: Iterable[str] = ()) -> bool:
    """Whether points have air around them: outside of all solids, and on the shining side of all walls.

    A solid is taken for the box around it, so not all that is free is found; one around all cameras is a
    room, not a solid.

    Args:
        scene: What is there.
        points: Shape ``(N, 3)``, metres.
        margin: Least distance from boxes and walls, metres.
        but: Names of things that do not count.
    """
    left_out = set(but)
    things = [thing for thing in scene.things if thing.name not in left_out]
    return not any(_blocks(thing, scene, points, margin) for thing in things)


def _blocks(thing: Thing, scene: Scene, points: np.ndarray, margin: float) -> bool:
    if isinstance(thing.geometry, Quad):
        return bool(_behind(thing.geometry, points, margin).any())
    low, high = bounds(thing.geometry)
    eyes = np.array([view.camera.position for view in scene.views])
    if _inside(eyes, low, high).all():
        return False
    return bool(_inside(points, low - margin, high + margin).any())


def _inside(points: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    return np.all((points > low) & (points < high), axis=-1)


def _behind(quad: Quad, points: np.ndarray, margin: float) -> np.ndarray:
    """Which points lie over a one-sided quad, and less than ``margin`` in front of it."""
    u, v = np.array(quad.half_u), np.array(quad.half_v)
    normal = np.cross(u, v) / np.linalg.norm(np.cross(u, v))
    apart = points - np.array(quad.center)
    over = (np.abs(apart @ u) <= u @ u) & (np.abs(apart @ v) <= v @ v)
    return over & (apart @ normal < margin)


def is_seen(views: Iterable[gc.View], points: np.ndarray, border: float = 0.03) -> bool:
    """Whether a point lies in the picture of a view or near its edge, whatever may hide it there.

    Args:
        views: Where the cameras are.
        points: Shape ``(N, 3)``, metres.
        border: Width of the edge, as a share of the picture.
    """
    return any(_in_picture(view.camera, points, border).any() for view in views)


def _in_picture(camera: gc.Camera, points: np.ndarray, border: float) -> np.ndarray:
    pixel, z = camera.project(points)
    share = pixel / (camera.width, camera.height)
    return (z > 0) & ((share > -border) & (share < 1 + border)).all(axis=-1)


def looked_at(views: Iterable[gc.View]) -> np.ndarray:
    """The point nearest to the optical axes of all views (least squares), shape ``(3,)``, metres."""
    axes = [(view.camera.forward, view.camera.position) for view in views]
    across = [np.eye(3) - np.outer(axis, axis) for axis, _ in axes]
    eyes = [square @ eye for square, (_, eye) in zip(across, axes, strict=True)]
    return np.linalg.lstsq(np.sum(across, axis=0), np.sum(eyes, axis=0), rcond=None)[0]
