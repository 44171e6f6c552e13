# SPDX-License-Identifier: Apache-2.0
"""What a prior says about the geometry of training views."""

from dataclasses import dataclass

import torch


@dataclass(frozen=True, eq=False)
class Guess:
    """Depth and normals of a view as a prior sees them; None where it says nothing."""

    depth: torch.Tensor | None = None
    """Shape ``(H, W)``, float32: of any scale and offset."""
    normal: torch.Tensor | None = None
    """Shape ``(H, W, 3)``, float32: world, of unit length."""


NO_GUESS = Guess()
