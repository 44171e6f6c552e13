# SPDX-License-Identifier: Apache-2.0
"""Photographs of bent lenses and of any size become pictures of the pinhole cameras that a capture holds.

Distortion is undone first, then the picture is made smaller by averaging areas, all in linear light.
"""

from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache
from threading import Lock

import cv2
import numpy as np

from graycard._camera import Camera
from graycard._errors import DatasetError
from graycard.exchange._cameras import PosedPhotograph
from graycard.exchange._lens import Lens

LARGEST = 2.0
"""Factor up to which the sides of an undistorted picture may grow: as of COLMAP's undistorter."""
_STEPS = 200
_SAMPLES = 64
"""Points a side of a picture's border."""
_SLACK = 0.02
"""Pixels by which centres of outermost pixels may miss those of the photograph, from where light is known."""

Box = tuple[float, float, float, float]
"""Left, top, right and bottom of a rectangle in pixels of the pinhole that has the lens's intrinsics."""


def with_width(shot: PosedPhotograph, width: int | None) -> PosedPhotograph:
    """Return a shot whose camera is the pinhole that the capture will hold.

    Args:
        shot: Its camera is what the files say.
        width: Of the picture, pixels; None, or more than it has, leaves it as large as it is.

    Raises:
        DatasetError: The lens bends so much that no rectangle of the photograph is left.
    """
    camera = shot.camera if shot.lens is None else undistorted(shot.lens, shot.camera)
    if width is not None and width < camera.width:
        camera = _smaller(camera, width)
    return replace(shot, camera=camera)


def develop(linear: np.ndarray, shot: PosedPhotograph) -> np.ndarray:
    """Return the picture of a shot's camera from its photograph.

    Args:
        linear: Shape ``(H, W, 3)`` or ``(H, W)``, float32, of the size of the file.
        shot: As of :func:`with_width`.

    Returns:
        The size of ``shot.camera``, float32.
    """
    camera = shot.camera
    if shot.lens is not None:
        K, width, height = _full_size(shot)
        with _lock_of(shot.lens):  # one thread makes a map, the others wait for it
            columns, rows = _maps(shot.lens, tuple(K[[0, 1, 0, 1], [0, 1, 2, 2]].tolist()), width, height)
        linear = cv2.remap(linear, columns, rows, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    if linear.shape[:2] != (camera.height, camera.width):
        linear = cv2.resize(linear, (camera.width, camera.height), interpolation=cv2.INTER_AREA)
    return np.asarray(linear, np.float32)


def develop_mask(mask: np.ndarray, shot: PosedPhotograph) -> np.ndarray:
    """Return a mask, ``(H, W)``, bool, as the camera of a shot sees it: true where most of a pixel is."""
    if shot.lens is None and mask.shape == (shot.camera.height, shot.camera.width):
        return mask
    return develop(mask.astype(np.float32), shot) > 0.5


def develop_pixels(pixels: np.ndarray, shot: PosedPhotograph) -> np.ndarray:
    """Return where pixels of the photograph lie in the picture of the shot's camera; shapes ``(N, 2)``."""
    K = shot.camera.K
    if shot.lens is not None:
        return shot.lens.directions(pixels) * K[[0, 1], [0, 1]] + K[[0, 1], [2, 2]]
    width, height = shot.size
    return pixels * [shot.camera.width / width, shot.camera.height / height]


def undistorted(lens: Lens, camera: Camera) -> Camera:
    """Return the pinhole with the lens's focal lengths that sees as much as it can and nothing else.

    Args:
        lens: It bends.
        camera: Its size, principal point and pose; a pinhole only in name.

    Raises:
        DatasetError: No rectangle of the photograph is left.
    """
    size = camera.width, camera.height
    box = _box(lens, size)
    left, top, right, bottom = (round(side) for side in box)
    if right - left < 2 or bottom - top < 2:
        raise DatasetError(
            f"expected a lens that shows a rectangle around its principal point, got {lens.model} of which "
            f"{right - left}x{bottom - top} pixels of {size[0]}x{size[1]} are left. Undistort the "
            "photographs first"
        )
    K = camera.K - [[0, 0, left], [0, 0, top], [0, 0, 0]]
    return Camera(right - left, bottom - top, K, camera.camera_to_world)


def _smaller(camera: Camera, width: int) -> Camera:
    height = max(1, round(camera.height * width / camera.width))
    scale = np.array([[width / camera.width], [height / camera.height], [1.0]])
    return Camera(width, height, camera.K * scale, camera.camera_to_world)


def _full_size(shot: PosedPhotograph) -> tuple[np.ndarray, int, int]:
    """Return intrinsics and size of the undistorted picture before it is made smaller."""
    assert shot.lens is not None, "asked for bent photographs alone"
    whole = undistorted(shot.lens, _named(shot))
    return whole.K, whole.width, whole.height


def _named(shot: PosedPhotograph) -> Camera:
    """Return the pinhole that the files name before distortion."""
    assert shot.lens is not None, "asked for bent photographs alone"
    (fx, fy), (cx, cy) = shot.lens.focal, shot.lens.centre
    K = np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]])
    return Camera(*shot.size, K, shot.camera.camera_to_world)


@lru_cache(maxsize=64)
def _lock_of(lens: Lens) -> Lock:
    return Lock()


@lru_cache(maxsize=2)
def _maps(
    lens: Lens, intrinsics: tuple[float, ...], width: int, height: int
) -> tuple[np.ndarray, np.ndarray]:
    fx, fy, cx, cy = intrinsics
    return lens.maps(np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]]), width, height)


@lru_cache(maxsize=4096)
def _box(lens: Lens, size: tuple[int, int]) -> Box:
    """Return the largest box around the principal point, about, whose border the photograph shows.

    It grows by a common factor until some side meets the border of the photograph, or until distortion folds
    the picture over; then each side by itself.
    """
    (cx, cy), (width, height) = lens.centre, size
    whole = np.array([-cx, -cy, width - cx, height - cy])

    def fits(scales: np.ndarray, slack: float = 0.0) -> bool:
        with np.errstate(all="ignore"):  # what overflows is not seen
            return _is_seen(lens, size, whole * scales, slack)

    scales = np.full(4, _last(lambda s: fits(np.full(4, s)), 0.0))
    for side in range(4):
        unit = np.eye(4)[side]
        scales[side] = _last(lambda s, u=unit: fits(np.where(u > 0, s, scales), _SLACK), scales[side])
    left, top, right, bottom = np.nan_to_num(whole * scales + np.array([cx, cy, cx, cy]))
    return float(np.ceil(left)), float(np.ceil(top)), float(np.floor(right)), float(np.floor(bottom))


def _last(fits: Callable[[float], bool], start: float) -> float:
    """Return the last scale before the first that does not fit, by steps and then by halving."""
    step = LARGEST / _STEPS
    low = start
    while low + step <= LARGEST and fits(low + step):
        low += step
    high = min(low + step, LARGEST)
    for _ in range(20):
        middle = (low + high) / 2
        low, high = (middle, high) if fits(middle) else (low, middle)
    return low


def _is_seen(lens: Lens, size: tuple[int, int], box: np.ndarray, slack: float) -> bool:
    """Tell whether a photograph shows the outermost pixels of a box, and distance grows up to its border.

    Args:
        lens: It bends.
        size: Width and height of the photograph, pixels.
        box: Left, top, right and bottom, from the principal point, pixels.
        slack: Pixels by which centres of pixels may leave those of the photograph.
    """
    border = _border(box) / lens.focal
    centres = (
        _border(np.concatenate([np.minimum(box[:2] + 0.5, 0), np.maximum(box[2:] - 0.5, 0)])) / lens.focal
    )
    both = lens.pixels(np.concatenate([border, 0.995 * border, centres]))
    outer, inner, pixels = np.split(both, 3)
    seen = (pixels >= 0.5 - slack).all() and (pixels <= np.array(size) - 0.5 + slack).all()
    grows = np.linalg.norm(outer - lens.centre, axis=-1) > np.linalg.norm(inner - lens.centre, axis=-1)
    return bool(np.isfinite(both).all() and seen and grows.all())


def _border(box: np.ndarray) -> np.ndarray:
    left, top, right, bottom = box
    t = np.linspace(0, 1, _SAMPLES)[:, None]
    corners = np.array([[left, top], [right, top], [right, bottom], [left, bottom]])
    sides = [a + t * (b - a) for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True)]
    return np.concatenate(sides)
