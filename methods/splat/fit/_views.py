# SPDX-License-Identifier: Apache-2.0
"""Schedule of views: which view a step of a fit looks at, and how large surfels are there."""

from collections.abc import Mapping
from functools import lru_cache

import numpy as np
import torch

from graycard import Camera
from graycard.methods.splat.fit._parameters import CENTRES, LOG_SCALES


def view_at(step: int, views: int, seed: int) -> int:
    """Return the number of the view of a step: each once in a round, in an order that the seed decides."""
    round_, place = divmod(step, views)
    return _order(round_, views, seed)[place]


@lru_cache(maxsize=1)
def _order(round_: int, views: int, seed: int) -> tuple[int, ...]:
    """Return the views of a round: kept, since to begin a generator takes longer than to draw all of them."""
    return tuple(np.random.default_rng((seed, round_)).permutation(views).tolist())


def no_offsets(of_surfels: torch.Tensor) -> torch.Tensor:
    """Return zeros of shape ``(N, 2)`` that require gradients, where what N surfels have lies."""
    return torch.zeros(len(of_surfels), 2, requires_grad=True, device=of_surfels.device)


@torch.no_grad()
def image_radius(values: Mapping[str, torch.Tensor], camera: Camera) -> torch.Tensor:
    """Three standard deviations on the image, in shares of its width, shape ``(N,)``, if surfels faced it."""
    centres = values[CENTRES]
    forward, eye = (centres.new_tensor(row, dtype=torch.float32) for row in (camera.forward, camera.position))
    z = ((centres - eye) @ forward).clamp(min=1e-3)
    largest = values[LOG_SCALES].amax(dim=1).exp()
    return 3 * largest / z * float(camera.K[0, 0] / camera.width)
