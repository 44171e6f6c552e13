# SPDX-License-Identifier: Apache-2.0
"""Lenses that bend: which pixel of a photograph shows a direction, and the reverse.

Directions are ``(x / z, y / z)`` in camera axes. Pixels have (0, 0) at the outer corner of the first one.
OpenCV knows the polynomial models; rarer ones are COLMAP's own, and need ``pycolmap``.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Any, Protocol

import cv2
import numpy as np

from graycard._errors import DatasetError
from graycard.exchange._pycolmap import import_pycolmap

Pair = tuple[float, float]


class Lens(Protocol):
    """A lens with distortion."""

    @property
    def model(self) -> str:
        """COLMAP's name for it."""
        ...

    @property
    def focal(self) -> Pair:
        """Fx and fy, pixels."""
        ...

    @property
    def centre(self) -> Pair:
        """Principal point, pixels."""
        ...

    def pixels(self, directions: np.ndarray) -> np.ndarray:
        """Return the pixels that show directions; both of shape ``(N, 2)``."""
        ...

    def directions(self, pixels: np.ndarray) -> np.ndarray:
        """Return the directions that pixels show; both of shape ``(N, 2)``, NaN where there is none."""
        ...

    def maps(self, K: np.ndarray, width: int, height: int) -> tuple[np.ndarray, np.ndarray]:
        """Return column and row, counted from the first pixel's centre, that each pixel of a pinhole shows.

        Args:
            K: Intrinsics of the pinhole, shape ``(3, 3)``.
            width: Of the pinhole's picture, pixels.
            height: Of the pinhole's picture, pixels.

        Returns:
            Two arrays ``(height, width)``, float32.
        """
        ...


@dataclass(frozen=True)
class BrownLens:
    """A perspective lens with OpenCV's rational radial and tangential distortion."""

    model: str
    focal: Pair
    centre: Pair
    coefficients: tuple[float, ...]
    """k1, k2, p1, p2, k3, k4, k5, k6, or the first of them."""

    def pixels(self, directions: np.ndarray) -> np.ndarray:
        """See :meth:`Lens.pixels`."""
        rays = np.column_stack([directions, np.ones(len(directions))])
        found = cv2.projectPoints(rays, np.zeros(3), np.zeros(3), _matrix(self), self._bends)[0]
        return found.reshape(-1, 2)

    def directions(self, pixels: np.ndarray) -> np.ndarray:
        """See :meth:`Lens.directions`."""
        if not len(pixels):
            return np.zeros((0, 2))
        points = np.asarray(pixels, np.float64).reshape(-1, 1, 2)
        found = cv2.undistortPoints(points, _matrix(self), self._bends, None, None, None, _UNTIL)
        return _where_it_holds(self, found.reshape(-1, 2), pixels)

    def maps(self, K: np.ndarray, width: int, height: int) -> tuple[np.ndarray, np.ndarray]:
        """See :meth:`Lens.maps`."""
        size = width, height
        own = _at_centres(_matrix(self))
        return cv2.initUndistortRectifyMap(own, self._bends, np.eye(3), _at_centres(K), size, cv2.CV_32FC1)

    @property
    def _bends(self) -> np.ndarray:
        return np.array(self.coefficients, np.float64)


@dataclass(frozen=True)
class FisheyeLens:
    """An equidistant lens with OpenCV's polynomial in the angle."""

    model: str
    focal: Pair
    centre: Pair
    coefficients: tuple[float, float, float, float]
    """k1, k2, k3, k4."""

    def pixels(self, directions: np.ndarray) -> np.ndarray:
        """See :meth:`Lens.pixels`."""
        rays = np.column_stack([directions, np.ones(len(directions))])[None]
        bends = np.array(self.coefficients)
        found = cv2.fisheye.projectPoints(rays, np.zeros(3), np.zeros(3), _matrix(self), bends)[0]
        return found.reshape(-1, 2)

    def directions(self, pixels: np.ndarray) -> np.ndarray:
        """See :meth:`Lens.directions`."""
        bent = (np.asarray(pixels, np.float64) - self.centre) / self.focal
        radius = np.linalg.norm(bent, axis=-1)
        scale = np.tan(self._angles(radius)) / np.where(radius > 0, radius, 1)
        return _where_it_holds(self, bent * np.where(radius > 0, scale, 1)[:, None], pixels)

    def _angles(self, radii: np.ndarray) -> np.ndarray:
        """Return the angles from the axis that radii show, radians; NaN from a right angle or a fold on.

        OpenCV takes radii beyond π/2 for π/2, whatever the coefficients.
        """
        angles = np.linspace(0, np.pi / 2, _ANGLES)[:-1]
        rising = np.flatnonzero(self._slope(angles) <= 0)
        angles = angles[: rising[0]] if len(rising) else angles
        found = np.interp(radii, self._radius(angles), angles, right=np.nan)
        for _ in range(3):  # Newton's, from less than a step away
            found = found - (self._radius(found) - radii) / self._slope(found)
        return found

    def _radius(self, angle: np.ndarray) -> np.ndarray:
        k1, k2, k3, k4 = self.coefficients
        a = angle**2
        return angle * (1 + a * (k1 + a * (k2 + a * (k3 + a * k4))))

    def _slope(self, angle: np.ndarray) -> np.ndarray:
        k1, k2, k3, k4 = self.coefficients
        a = angle**2
        return 1 + a * (3 * k1 + a * (5 * k2 + a * (7 * k3 + a * 9 * k4)))

    def maps(self, K: np.ndarray, width: int, height: int) -> tuple[np.ndarray, np.ndarray]:
        """See :meth:`Lens.maps`."""
        own, bends = _at_centres(_matrix(self)), np.array(self.coefficients)
        return cv2.fisheye.initUndistortRectifyMap(
            own, bends, np.eye(3), _at_centres(K), (width, height), cv2.CV_32FC1
        )


@dataclass(frozen=True)
class ColmapLens:
    """A lens of a model that only COLMAP has."""

    model: str
    focal: Pair
    centre: Pair
    parameters: tuple[float, ...]
    """All of them, as COLMAP orders them."""
    size: tuple[int, int]
    """Width and height of the photograph, pixels."""

    def pixels(self, directions: np.ndarray) -> np.ndarray:
        """See :meth:`Lens.pixels`."""
        rays = np.column_stack([directions, np.ones(len(directions))])
        return np.asarray(self._camera.img_from_cam(rays)).reshape(-1, 2)

    def directions(self, pixels: np.ndarray) -> np.ndarray:
        """See :meth:`Lens.directions`."""
        found = np.asarray(self._camera.cam_from_img(np.asarray(pixels, np.float64)), np.float64)
        return _where_it_holds(self, found.reshape(-1, 2), pixels)

    def maps(self, K: np.ndarray, width: int, height: int) -> tuple[np.ndarray, np.ndarray]:
        """See :meth:`Lens.maps`."""
        columns, rows = (np.empty((height, width), np.float32) for _ in range(2))
        x = (np.arange(width) + 0.5 - K[0, 2]) / K[0, 0]
        band = max(1, _BAND // width)
        for top in range(0, height, band):  # the whole in float64 would take a GiB for 12 MP
            y = (np.arange(top, min(top + band, height)) + 0.5 - K[1, 2]) / K[1, 1]
            flat = np.column_stack([np.tile(x, len(y)), np.repeat(y, width)])
            found = (self.pixels(flat) - 0.5).reshape(len(y), width, 2)
            columns[top : top + band], rows[top : top + band] = found[..., 0], found[..., 1]
        return columns, rows

    @cached_property
    def _camera(self) -> Any:
        width, height = self.size
        return import_pycolmap(f"a lens of model {self.model}").Camera(
            model=self.model, width=width, height=height, params=list(self.parameters)
        )


_ANGLES = 4097
"""Steps of a quarter turn from which angles are found."""
_MISS = 0.01
"""Pixels by which a direction may miss its pixel, beyond which it is none."""
_BAND = 2**18
"""Pixels of a map that are found at a time."""
_UNTIL = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 100, 1e-12)
PINHOLES = {"SIMPLE_PINHOLE": 1, "PINHOLE": 2}
"""Models without distortion, with the number of their focal lengths."""
_BROWN = {"SIMPLE_RADIAL": (1, 1), "RADIAL": (1, 2), "OPENCV": (2, 4), "FULL_OPENCV": (2, 8)}
"""Perspective models: how many focal lengths, and how many coefficients."""
_FISHEYE = {
    "SIMPLE_FISHEYE": (1, 0),
    "FISHEYE": (2, 0),
    "SIMPLE_RADIAL_FISHEYE": (1, 1),
    "RADIAL_FISHEYE": (1, 2),
    "OPENCV_FISHEYE": (2, 4),
}
_RARE = {
    "FOV": (2, 1),
    "THIN_PRISM_FISHEYE": (2, 8),
    "RAD_TAN_THIN_PRISM_FISHEYE": (2, 12),
    "SIMPLE_DIVISION": (1, 1),
    "DIVISION": (2, 1),
    "EUCM": (2, 2),
}
"""Models that need COLMAP's own code."""
_STRAIGHT = ("SIMPLE_DIVISION", "DIVISION")
"""Models that are a pinhole when all their coefficients are zero."""
_COUNTS = {**{name: (focal, 0) for name, focal in PINHOLES.items()}, **_BROWN, **_FISHEYE, **_RARE}


@dataclass(frozen=True)
class Intrinsics:
    """The camera of a photograph without its pose."""

    size: tuple[int, int]
    """Width and height, pixels."""
    focal: Pair
    centre: Pair
    lens: Lens | None = None
    """None for a pinhole."""


def make_intrinsics(
    model: str, size: tuple[int, int], parameters: tuple[float, ...], where: str
) -> Intrinsics:
    """Return the camera of one of COLMAP's models; one whose distortion is all zero is a pinhole.

    Args:
        model: COLMAP's name.
        size: Width and height, pixels.
        parameters: Focal lengths, principal point and coefficients, as COLMAP orders them.
        where: File and entry, for the message.

    Raises:
        DatasetError: The model is not known or no photograph of a plane, or has other parameters.
    """
    if model not in _COUNTS:
        raise DatasetError(
            f"expected a camera of model {', '.join(_COUNTS)} in {where}, got {model}. Undistort the "
            "photographs first, or leave this camera out"
        )
    focals, bends = _COUNTS[model]
    if len(parameters) != focals + 2 + bends:
        raise DatasetError(
            f"expected {focals + 2 + bends} parameters of {model} in {where}, got {len(parameters)}"
        )
    if not np.isfinite(parameters).all() or min(parameters[:focals]) <= 0 or min(size) < 1:
        raise DatasetError(
            f"expected a size, fx, fy > 0 and finite numbers in {where}, got {size[0]}x{size[1]} and "
            f"{', '.join(f'{p:g}' for p in parameters)}. Leave this camera out"
        )
    focal, centre = (parameters[0], parameters[focals - 1]), (parameters[focals], parameters[focals + 1])
    return Intrinsics(size, focal, centre, _lens(model, focal, centre, parameters, size))


def _lens(
    model: str, focal: Pair, centre: Pair, parameters: tuple[float, ...], size: tuple[int, int]
) -> Lens | None:
    bends = parameters[_COUNTS[model][0] + 2 :]
    if model in _FISHEYE:
        k1, k2, k3, k4 = (*bends, 0.0, 0.0, 0.0, 0.0)[:4]
        return FisheyeLens(model, focal, centre, (k1, k2, k3, k4))
    if model in PINHOLES or (not any(bends) and (model in _BROWN or model in _STRAIGHT)):
        return None
    if model in _BROWN:
        return BrownLens(model, focal, centre, (*bends, 0.0, 0.0, 0.0)[: max(4, len(bends))])
    import_pycolmap(f"a lens of model {model}")  # says so before any photograph is read
    return ColmapLens(model, focal, centre, parameters, size)


def _where_it_holds(lens: Lens, directions: np.ndarray, pixels: np.ndarray) -> np.ndarray:
    """Return directions, NaN where they do not show their pixels: what iterations gave up on."""
    if not len(pixels):
        return directions
    with np.errstate(all="ignore"):  # what overflows is not seen
        miss = np.abs(lens.pixels(directions) - pixels).max(axis=-1)
    return np.where((miss < _MISS)[:, None], directions, np.nan)


def _matrix(lens: Lens) -> np.ndarray:
    return np.array([[lens.focal[0], 0, lens.centre[0]], [0, lens.focal[1], lens.centre[1]], [0, 0, 1.0]])


def _at_centres(K: np.ndarray) -> np.ndarray:
    """Return intrinsics in coordinates whose origin is the centre of the first pixel, as OpenCV's is."""
    moved = np.array(K, np.float64)
    moved[:2, 2] -= 0.5
    return moved
