# SPDX-License-Identifier: Apache-2.0
"""Directions to look along."""

import numpy as np
import pytest
import torch


@pytest.fixture
def hemisphere() -> tuple[torch.Tensor, torch.Tensor]:
    """A quadrature over directions above z = 0: unit vectors ``(N, 3)`` and their solid angles ``(N,)``."""
    height, weight = np.polynomial.legendre.leggauss(160)
    height, weight = (height + 1) / 2, weight / 2
    azimuth = 2 * np.pi * (np.arange(200) + 0.5) / 200
    across = np.sqrt(1 - height**2)[:, None]
    parts = across * np.cos(azimuth), across * np.sin(azimuth), height[:, None] + 0 * azimuth
    angles = np.broadcast_to(weight[:, None] * 2 * np.pi / 200, (160, 200))
    return torch.from_numpy(np.stack(parts, axis=-1).reshape(-1, 3)), torch.from_numpy(angles.reshape(-1))
