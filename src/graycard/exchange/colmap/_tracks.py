# SPDX-License-Identifier: Apache-2.0
"""The views and points of a capture as tables of a COLMAP model: what both its forms write."""

from collections.abc import Sequence

import numpy as np

from graycard._camera import Camera
from graycard._capture import Capture, View
from graycard.points import Points, no_points

CameraRow = tuple[int, int, tuple[float, ...]]
ImageRow = tuple[str, int, tuple[float, ...], np.ndarray]
PointRow = tuple[np.ndarray, np.ndarray, float, list[tuple[int, int]]]


def model_tables(
    capture: Capture, views: Sequence[View], with_points: bool
) -> tuple[list[CameraRow], list[ImageRow], list[PointRow]]:
    """Return cameras, images and points of some views; all are numbered from 1 in their order.

    Args:
        capture: It has the views.
        views: Some of them.
        with_points: Whether its sparse points belong to the model.
    """
    points = capture.points() if with_points else no_points()
    cameras = list(dict.fromkeys(_intrinsics(view.camera) for view in views))
    images, tracks = [], [[] for _ in range(len(points))]
    for number, view in enumerate(views, 1):
        here = np.flatnonzero(points.view == capture.views.index(view))
        keypoints = np.column_stack([points.pixel[here], points.point[here] + 1.0])
        for index, observation in enumerate(here):
            tracks[points.point[observation]].append((number, index))
        camera = 1 + cameras.index(_intrinsics(view.camera))
        images.append((f"{view.name}.png", camera, _pose(view.camera), keypoints))
    errors = _reprojection_errors(capture, points)
    rows = list(zip(points.positions, points.colors, errors, tracks, strict=True))
    return cameras, images, rows


def _intrinsics(camera: Camera) -> CameraRow:
    K = camera.K
    return camera.width, camera.height, tuple(float(x) for x in (K[0, 0], K[1, 1], K[0, 2], K[1, 2]))


def _pose(camera: Camera) -> tuple[float, ...]:
    """Return a quaternion (w, x, y, z) and a translation, world to camera."""
    from scipy.spatial.transform import Rotation

    x, y, z, w = Rotation.from_matrix(camera.world_to_camera[:3, :3]).as_quat()
    return tuple(float(number) for number in (w, x, y, z, *camera.world_to_camera[:3, 3]))


def _reprojection_errors(capture: Capture, points: Points) -> list[float]:
    """Return the mean distance of each point's observations from its projections, pixels; 0 without any."""
    miss = np.zeros(len(points.point))
    for number, view in enumerate(capture.views):
        here = points.view == number
        pixel = view.camera.project(points.positions[points.point[here]])[0]
        miss[here] = np.linalg.norm(pixel - points.pixel[here], axis=-1)
    sums = np.bincount(points.point, miss, len(points))
    return [float(e) for e in sums / np.maximum(points.views, 1)]
