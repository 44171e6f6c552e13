# SPDX-License-Identifier: Apache-2.0
"""The eight orientations of EXIF (tag 0x0112): how stored pixels are turned to stand upright."""

import numpy as np

UPRIGHT = 1
WORDS = {
    2: "mirrored left to right",
    3: "turned by 180°",
    4: "mirrored top to bottom",
    5: "mirrored along the diagonal",
    6: "turned by 90° clockwise",
    7: "mirrored along the other diagonal",
    8: "turned by 90° counterclockwise",
}
"""Turn and mirror that a viewer applies to the stored pixels."""


def swaps_sides(orientation: int) -> bool:
    """Tell whether width and height change places when a picture is turned upright."""
    return orientation in (5, 6, 7, 8)


def turn_back(image: np.ndarray, orientation: int) -> np.ndarray:
    """Return an image ``(H, W, ...)`` that stands upright as it is stored: the inverse of :func:`turn`."""
    return turn(image, {6: 8, 8: 6}.get(orientation, orientation))


def turn(image: np.ndarray, orientation: int) -> np.ndarray:
    """Return an image ``(H, W, ...)`` upright, as a view of the same memory."""
    flipped = {2: np.s_[:, ::-1], 3: np.s_[::-1, ::-1], 4: np.s_[::-1]}
    if orientation in flipped:
        return image[flipped[orientation]]
    if not swaps_sides(orientation):
        return image
    across = image.swapaxes(0, 1)
    return across[{5: np.s_[:, :], 6: np.s_[:, ::-1], 7: np.s_[::-1, ::-1], 8: np.s_[::-1]}[orientation]]
