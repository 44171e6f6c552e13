# SPDX-License-Identifier: Apache-2.0
"""Discs of any orientation, spread over a box of the world."""

import numpy as np
import torch

from graycard.methods import splat

Triple = tuple[float, float, float]
BOX: tuple[Triple, Triple] = ((-1.0, -1.0, -1.0), (1.0, 1.0, 1.0))


def random_surfels(
    count: int,
    seed: int = 0,
    channels: int = 3,
    scale: float = 0.15,
    *,
    box: tuple[Triple, Triple] = BOX,
    opacities: tuple[float, float] = (0.02, 1.0),
    features: tuple[float, float] = (0.0, 1.0),
) -> splat.Surfels:
    """Surfels in float64, uniform in place, turn, opacity and features, log-normal in size.

    Args:
        count: how many.
        seed: of all numbers.
        channels: of the features.
        scale: median standard deviation of the discs, metres.
        box: two corners that the centres lie between, metres.
        opacities: from and to.
        features: from and to.
    """
    r = np.random.default_rng(seed)
    turn = r.normal(size=(count, 4))
    values = [
        r.uniform(*box, (count, 3)),
        turn / np.linalg.norm(turn, axis=1, keepdims=True),
        scale * np.exp(r.normal(0, 0.5, (count, 2))),
        r.uniform(*opacities, count),
        r.uniform(*features, (count, channels)),
    ]
    return splat.Surfels(*(torch.from_numpy(v) for v in values))
