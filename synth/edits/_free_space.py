# SPDX-License-Identifier: Apache-2.0
"""Free space: boxes around things, and sides of walls."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from graycard import Camera, View
from graycard.synth._mesh import Mesh
from graycard.synth._scene import Ball, Geometry, Quad, Scene


def bounds(geometry: Geometry) -> np.ndarray:
    """Return the least and the greatest coordinates of a shape, ``(2, 3)``, metres."""
    match geometry:
        case Mesh() as mesh:
            return np.stack([mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)])
        case Ball(center, radius):
            return np.array(center) + radius * np.array([[-1.0], [1.0]])
        case Quad(center, half_u, half_v):
            reach = np.abs(half_u) + np.abs(half_v)
            return np.array(center) + reach * np.array([[-1.0], [1.0]])


@dataclass(frozen=True, slots=True, eq=False)
class Obstacles:
    """Obstacles of a scene: walls, and solids taken for the boxes around them.

    So not all that is free is found. A box around all cameras is a room, and no obstacle.
    """

    walls: tuple[Quad, ...]
    boxes: np.ndarray
    """Least and greatest coordinates of each solid, ``(K, 2, 3)``, metres."""

    def leave_free(self, points: np.ndarray, margin: float) -> bool:
        """Return whether points are outside of all solids, and on the side that is seen of all walls they are
        over.

        Args:
            points: Shape ``(N, 3)``, metres.
            margin: Least distance from boxes and walls, metres.
        """
        if any(_behind(wall, points, margin).any() for wall in self.walls):
            return False
        low, high = self.boxes[:, None, 0] - margin, self.boxes[:, None, 1] + margin
        return not _inside(points, low, high).any()

    def touch(self, box: np.ndarray, margin: float) -> bool:
        """Return whether a solid is nearer to a box, ``(2, 3)``, than ``margin`` along each axis."""
        near = (box[0] < self.boxes[:, 1] + margin) & (box[1] > self.boxes[:, 0] - margin)
        return bool(near.all(axis=-1).any())

    def hide(self, eye: np.ndarray, points: np.ndarray) -> np.ndarray:
        """Return which of ``(N, 3)`` points lie behind a solid for an eye, ``(N,)`` (slabs: Kay and Kajiya
        1986).
        """
        way = points - eye
        way = np.where(np.abs(way) < 1e-12, 1e-12, way)
        ends = np.sort((self.boxes[:, None] - eye) / way[None, :, None], axis=2)
        enters, leaves = ends[:, :, 0].max(axis=-1), ends[:, :, 1].min(axis=-1)
        return (np.maximum(enters, 0) < np.minimum(leaves, 1)).any(axis=0)


def obstacles(scene: Scene, but: Iterable[str] = ()) -> Obstacles:
    """Return the obstacles of a scene.

    Args:
        scene: What is there.
        but: Names of things that do not count.
    """
    left_out = set(but)
    shapes = [thing.geometry for thing in scene.things if thing.name not in left_out]
    eyes = np.array([view.camera.position for view in scene.views])
    boxes = [bounds(shape) for shape in shapes if not isinstance(shape, Quad)]
    solid = [box for box in boxes if not _inside(eyes, *box).all()]
    return Obstacles(tuple(x for x in shapes if isinstance(x, Quad)), np.array(solid).reshape(-1, 2, 3))


def _inside(points: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    return np.all((points > low) & (points < high), axis=-1)


def _behind(quad: Quad, points: np.ndarray, margin: float) -> np.ndarray:
    """Return which points lie over a one-sided quad, and less than ``margin`` in front of it."""
    u, v = np.array(quad.half_u), np.array(quad.half_v)
    normal = np.cross(u, v) / np.linalg.norm(np.cross(u, v))
    apart = points - np.array(quad.center)
    over = (np.abs(apart @ u) <= u @ u) & (np.abs(apart @ v) <= v @ v)
    return over & (apart @ normal < margin)


def is_seen(views: Iterable[View], points: np.ndarray, border: float = 0.03) -> bool:
    """Return whether a point lies in the picture of a view or near its edge, whatever may hide it there.

    Args:
        views: Where the cameras are.
        points: Shape ``(N, 3)``, metres.
        border: Width of the edge, as a share of the picture.
    """
    return any(in_picture(view.camera, points, border).any() for view in views)


def in_picture(camera: Camera, points: np.ndarray, border: float) -> np.ndarray:
    """Return which points project into a picture that is wider by a border on all sides, ``(N,)``, bool."""
    pixel, z = camera.project(points)
    share = pixel / (camera.width, camera.height)
    return (z > 0) & ((share > -border) & (share < 1 + border)).all(axis=-1)


def looked_at(views: Iterable[View]) -> np.ndarray:
    """Return the point nearest to the optical axes of all views (least squares), shape ``(3,)``, metres."""
    axes = [(view.camera.forward, view.camera.position) for view in views]
    across = [np.eye(3) - np.outer(axis, axis) for axis, _ in axes]
    eyes = [square @ eye for square, (_, eye) in zip(across, axes, strict=True)]
    return np.linalg.lstsq(np.sum(across, axis=0), np.sum(eyes, axis=0), rcond=None)[0]
