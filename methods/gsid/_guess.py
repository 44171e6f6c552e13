# SPDX-License-Identifier: Apache-2.0
"""Answers of a prior about the photographs: normals, base colour, roughness and metallic."""

from dataclasses import dataclass

import numpy as np
import torch

from graycard import Capture
from graycard.io import Room
from graycard.methods._contract import Ask, Priors

KINDS = ("normal", "base_color", "roughness", "metallic")
ASKS = tuple(Ask(kind, optional=True) for kind in KINDS)


@dataclass(frozen=True, eq=False)
class MaterialGuess:
    """Layers of a view as a prior sees them, float32; None where it says nothing."""

    normal: torch.Tensor | None = None
    """Shape ``(H, W, 3)``: world, unit, zero where there is nothing."""
    base_color: torch.Tensor | None = None
    """Shape ``(H, W, 3)``, linear, [0, 1]."""
    roughness: torch.Tensor | None = None
    """Shape ``(H, W)``, [0, 1]."""
    metallic: torch.Tensor | None = None
    """Shape ``(H, W)``, [0, 1]."""


def guesses_of(capture: Capture, priors: Priors) -> list[MaterialGuess]:
    """Return what the prior says when it sees the training photographs, exposed; what it does not know is
    None.

    Raises:
        MethodError: An answer is not sound.
    """
    found = []
    with Room() as room:
        for view in capture.train:
            image = capture.photograph(view) * np.float32(capture.exposure)
            answers = {
                kind: torch.from_numpy(getattr(priors, kind)(image, view).astype(np.float32))
                for kind in KINDS
                if kind in priors.kinds
            }
            found.append(room.keep(MaterialGuess(**answers)))
    return found
