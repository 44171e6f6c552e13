# SPDX-License-Identifier: Apache-2.0
"""Ellipsoids of any orientation, spread over a box of the world."""

import numpy as np
import torch

from graycard.methods.splat import Gaussians


def random_gaussians(
    count: int,
    seed: int,
    scale: float = 0.1,
    opacities: tuple[float, float] = (0.02, 1.0),
    channels: int = 3,
) -> Gaussians:
    """Gaussians in float64, uniform in [-1, 1]^3 and in opacity and features, log-normal in size."""
    r = np.random.default_rng(seed)
    turn = r.normal(size=(count, 4))
    values = [
        r.uniform(-1, 1, (count, 3)),
        turn / np.linalg.norm(turn, axis=1, keepdims=True),
        scale * np.exp(r.normal(0, 0.8, (count, 3))),
        r.uniform(*opacities, count),
        r.uniform(0, 1, (count, channels)),
    ]
    return Gaussians(*(torch.from_numpy(value) for value in values))
