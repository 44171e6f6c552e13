# SPDX-License-Identifier: Apache-2.0
"""Holes in pictures filled in from around them, by algorithms that know nothing of the world."""

from collections.abc import Callable, Mapping
from typing import cast

import numpy as np

from graycard import MethodError

RADIUS = 0.03
"""Radius: how far Telea's algorithm looks for what is known, a share of the width: 3 pixels of 112, 15 of
512."""
RANGE = 255.0
"""Range of the values for OpenCV. To each pixel it adds the direction of a slope, up to √2 whatever the
slope's size: little beside the range of 8 bits, but more than all there is of an image in [0, 1]."""


def filled(image: np.ndarray, hole: np.ndarray | None, algorithm: str) -> np.ndarray:
    """Return a picture whose hole is filled in, each channel by itself.

    ``biharmonic`` is the function that bends least (Damelin and Hoang 2018, by scikit-image): it goes on with
    slopes, within the values of the picture. ``telea`` marches from the rim inwards, each pixel a mean of
    what is known near it (Telea 2004, by OpenCV), within the values around the hole. OpenCV is handed these
    as 0 to 255, in floats: nothing is rounded.

    Args:
        image: Shape ``(H, W)`` or ``(H, W, C)``, of any unit, finite outside the hole.
        hole: Shape ``(H, W)``, bool; None: there is none.
        algorithm: One of :data:`ALGORITHMS`.

    Returns:
        The shape of ``image``, float64; outside the hole ``image`` itself.

    Raises:
        MethodError: All is hole.
    """
    image = np.asarray(image, np.float64)
    if hole is None or not hole.any():
        return image
    if hole.all():
        raise MethodError("expected a hole with something around it, got one that is the whole image")
    inside = hole if image.ndim == hole.ndim else hole[..., None]
    known = np.where(inside, 0.0, image)
    return np.where(inside, _FILL[algorithm](known, hole), known)


def _biharmonic(image: np.ndarray, hole: np.ndarray) -> np.ndarray:
    from skimage.restoration import inpaint_biharmonic

    return inpaint_biharmonic(image, hole, channel_axis=-1 if image.ndim > hole.ndim else None)


def _telea(image: np.ndarray, hole: np.ndarray) -> np.ndarray:
    if image.ndim > hole.ndim:
        return np.stack([_telea(channel, hole) for channel in np.moveaxis(image, -1, 0)], axis=-1)
    from cv2 import INPAINT_TELEA, inpaint
    from scipy.ndimage import distance_transform_edt

    radius = max(round(RADIUS * image.shape[1]), 1)
    rim = image[~hole & (distance_transform_edt(~hole) <= radius)]
    low, span = rim.min(), np.ptp(rim)
    levels = RANGE * (np.clip(image, low, low + span) - low) / (span or 1.0)
    # OpenCV also reads what is in a hole at the upper or left border: there the nearest known values stand.
    nearest = distance_transform_edt(hole, return_distances=False, return_indices=True)
    rows, columns = cast(np.ndarray, nearest)  # None only if it is handed arrays to write to
    shown = levels[rows, columns].astype(np.float32)
    levels = inpaint(shown, hole.astype(np.uint8), radius, INPAINT_TELEA).astype(np.float64)
    return low + span * np.clip(levels / RANGE, 0, 1)


_FILL: Mapping[str, Callable[[np.ndarray, np.ndarray], np.ndarray]] = {
    "biharmonic": _biharmonic,
    "telea": _telea,
}
ALGORITHMS = tuple(_FILL)
"""The first is the default."""
