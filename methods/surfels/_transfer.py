# SPDX-License-Identifier: Apache-2.0
"""Transfer: where the pixels of one view lie in another, if their depth is known.

With z-depth ``z`` and pixels ``x = (x, y, 1)`` a pixel lies at ``z H x + e`` in the other image, homogeneous,
the third of which is the other z-depth: ``H`` is the homography of the plane at infinity and ``e`` the
epipole (Hartley and Zisserman 2004, section 9.6), with a length in metres.
"""

import numpy as np

from graycard import Camera
from graycard.methods._numba import njit
from graycard.methods.splat.parallel import INLINED, UNWRAPPED, run, share, task

HIDES = 0.05
"""Tolerance: share of its depth by which a point must be nearer than what another view sees to be in its
way."""


def transfer(camera: Camera, other: Camera) -> tuple[np.ndarray, np.ndarray]:
    """Return the homography of the plane at infinity, shape ``(3, 3)``, and the epipole, ``(3,)``, metres."""
    onto = other.K @ other.world_to_camera[:3, :3]
    homography = onto @ camera.camera_to_world[:3, :3] @ np.linalg.inv(camera.K)
    epipole = onto @ camera.position + other.K @ other.world_to_camera[:3, 3]
    return np.ascontiguousarray(homography), np.ascontiguousarray(epipole)  # of one type, for the kernels


def depth_ratio(camera: Camera, depth: np.ndarray, other: Camera, there: np.ndarray) -> np.ndarray:
    """Return how far the points of a view are from another one, in shares of what that one sees in their
    place.

    Args:
        camera: Of the view.
        depth: shape ``(H, W)`` or ``(K, H, W)``, its z-depth, metres.
        other: The other camera.
        there: shape ``(H', W')``, z-depth of the other view.

    Returns:
        Of the shape of depth; below 1 in front of what the other sees; NaN outside its image.
    """
    here, seen = (np.ascontiguousarray(values, dtype=np.float64) for values in (depth, there))
    ratio = np.full((depth.size // depth.shape[-1], depth.shape[-1]), np.nan)
    _ratios(here.reshape(ratio.shape), camera.height, transfer(camera, other), seen, ratio)
    return ratio.reshape(depth.shape)


def count_hidden(
    camera: Camera, depth: np.ndarray, other: Camera, there: np.ndarray, sure: np.ndarray, counts: np.ndarray
) -> None:
    """Add one wherever a point of a view would hide what another view is sure to see.

    It is :func:`depth_ratio` below ``1 - HIDES``, without an array of ratios.

    Args:
        camera: Of the view.
        depth: shape ``(K, H, W)``, its z-depth, metres.
        other: The other camera.
        there: shape ``(H', W')``, z-depth of the other view.
        sure: shape ``(H', W')``, bool: where that is sure.
        counts: shape ``(K, H, W)``, int32, C order: added to.
    """
    here, seen = (np.ascontiguousarray(values, dtype=np.float64) for values in (depth, there))
    shape = depth.size // depth.shape[-1], depth.shape[-1]
    told = here.reshape(shape), camera.height, transfer(camera, other), seen, np.ascontiguousarray(sure)
    _count(*told, 1 - HIDES, counts.reshape(shape))


@njit(cache=True, error_model="numpy")
def _count(depth, rows, pair, there, sure, least, counts):
    """Count in parts of the rows; see ``count_hidden``."""
    run(task(_count_some, (depth, rows, pair, there, sure, least, counts)))


@njit(error_model="numpy", **UNWRAPPED)
def _count_some(part, parts, depth, rows, pair, there, sure, least, counts):
    """Count in a part of the rows."""
    height, width = there.shape
    first, past = share(part, parts, depth.shape[0])
    for row in range(first, past):
        for column in range(depth.shape[1]):
            x, y, z = _there(pair, depth[row, column], column, row % rows)
            inside = z > 0 and 0 <= x < width and 0 <= y < height
            if inside and sure[int(y), int(x)] and z / there[int(y), int(x)] < least:
                counts[row, column] += 1


@njit(**INLINED)
def _there(pair, depth, column, row):
    """Return a point's pixel in the other image, and its z-depth there."""
    homography, epipole = pair
    across, down, along = transferred(homography, column + 0.5, row + 0.5)
    z = depth * along + epipole[2]
    return (depth * across + epipole[0]) / z, (depth * down + epipole[1]) / z, z


@njit(**INLINED)
def transferred(homography, x, y):
    """Return a pixel at infinity in the other image, homogeneous."""
    return (
        homography[0, 0] * x + homography[0, 1] * y + homography[0, 2],
        homography[1, 0] * x + homography[1, 1] * y + homography[1, 2],
        homography[2, 0] * x + homography[2, 1] * y + homography[2, 2],
    )


@njit(cache=True, error_model="numpy")
def _ratios(depth, rows, pair, there, ratio):
    """Write where a point lies inside the other image; see ``depth_ratio``.

    Args:
        depth: ``(K * H, W)``, metres.
        rows: H.
        pair: see ``transfer``.
        there: ``(H', W')``, metres.
        ratio: ``(K * H, W)``, to be written.
    """
    run(task(_some_ratios, (depth, rows, pair, there, ratio)))


@njit(error_model="numpy", **UNWRAPPED)
def _some_ratios(part, parts, depth, rows, pair, there, ratio):
    """Write a part of the rows."""
    height, width = there.shape
    first, past = share(part, parts, depth.shape[0])
    for row in range(first, past):
        for column in range(depth.shape[1]):
            x, y, z = _there(pair, depth[row, column], column, row % rows)
            if z > 0 and 0 <= x < width and 0 <= y < height:
                ratio[row, column] = z / there[int(y), int(x)]
