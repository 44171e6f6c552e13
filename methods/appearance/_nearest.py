# SPDX-License-Identifier: Apache-2.0
"""Similarity: which photograph a new view is most like: told from the cameras alone."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from graycard import Camera
from graycard.methods.splat import scene_extent


@dataclass(frozen=True, eq=False)
class Eyes:
    """Places of the cameras."""

    positions: np.ndarray
    """Shape ``(M, 3)``, world, metres."""
    directions: np.ndarray
    """Shape ``(M, 3)``: of the optical axes, world, unit length."""
    extent: float
    """Extent of the cameras, metres."""

    def nearest(self, camera: Camera) -> int:
        """Return the number of the photograph that was taken from nearest to where a camera is and looks.

        The squared distance is that of the places in extents plus that of the directions as points of the
        unit sphere: what a lamp on the camera lights changes with both.
        """
        aside = (self.positions - camera.position) / self.extent
        turned = self.directions - camera.forward
        return int(np.argmin((aside**2).sum(axis=1) + (turned**2).sum(axis=1)))


def eyes_of(cameras: Sequence[Camera]) -> Eyes:
    """Return the eyes of cameras.

    Raises:
        ValueError: There is no camera.
    """
    extent = scene_extent(list(cameras))
    return Eyes(np.array([c.position for c in cameras]), np.array([c.forward for c in cameras]), extent)
