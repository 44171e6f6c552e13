# SPDX-License-Identifier: Apache-2.0
"""Windows of a view: parts that are drawn and compared alone, at the cost of a part."""

from itertools import pairwise
from typing import NamedTuple

import numpy as np
import torch

from graycard import Camera


class Window(NamedTuple):
    """A part of a view, contiguous: half-open ranges of rows and columns, pixels."""

    top: int
    bottom: int
    left: int
    right: int

    def of(self, image: torch.Tensor) -> torch.Tensor:
        """Return the part of an image of shape ``(H, W, ...)``."""
        return image[self.top : self.bottom, self.left : self.right]

    def camera(self, camera: Camera) -> Camera:
        """Return a camera that sees this part alone, with the same rays."""
        moved = np.array([[0, 0, self.left], [0, 0, self.top], [0, 0, 0]])
        size = self.right - self.left, self.bottom - self.top
        return Camera(*size, camera.K - moved, camera.camera_to_world)


def windows_of(height: int, width: int, side: int) -> list[Window]:
    """Parts of a view, as alike as can be, of about ``side`` pixels a side: each pixel is in one of them."""
    rows, columns = (_edges(length, side) for length in (height, width))
    return [Window(*r, *c) for r in pairwise(rows) for c in pairwise(columns)]


def _edges(length: int, side: int) -> list[int]:
    parts = max(1, round(length / side))
    return [round(part * length / parts) for part in range(parts + 1)]
