# SPDX-License-Identifier: Apache-2.0
"""A trained splat, from whatever file."""

from dataclasses import dataclass
from typing import Literal

import torch

from graycard.methods.splat import Gaussians, Surfels

Primitive = Literal["3dgs", "2dgs"]


@dataclass(frozen=True, eq=False)
class TrainedSplat:
    """Ellipsoids or discs with the harmonics of their colours, float32, in the world of the program."""

    shapes: Gaussians | Surfels
    """Without features."""
    coefficients: torch.Tensor
    """Shape ``(N, K, 3)``, K = 1, 4, 9 or 16: a colour is one half plus their sum with the harmonics."""
    antialiased: bool
    """True if the file says that it was trained with antialiasing: brush does, others say nothing."""
    unused: tuple[str, ...] = ()
    """Properties of the file that say nothing about shape or colour here, and were passed over."""
    doubts: tuple[str, ...] = ()
    """Signs that the numbers are not those that training writes, in words."""

    def __len__(self) -> int:
        return len(self.shapes)

    @property
    def primitive(self) -> Primitive:
        """Kind of the shapes."""
        return "2dgs" if isinstance(self.shapes, Surfels) else "3dgs"

    @property
    def degree(self) -> int:
        """Degree of the harmonics, 0 to 3."""
        return {1: 0, 4: 1, 9: 2, 16: 3}[self.coefficients.shape[1]]
