# SPDX-License-Identifier: Apache-2.0
"""The space in which pictures are compared: the sRGB curve, going on above display white."""

import torch

_KNEE = 0.0031308


def encode(linear: torch.Tensor) -> torch.Tensor:
    """Display-like values of linear ones, any shape, differentiable.

    Domain: all numbers, 1 is display white. Range: all numbers; nothing is clipped, the power goes on above
    one and the linear piece below zero. Formula: IEC 61966-2-1:1999, piecewise.
    """
    power = 1.055 * linear.clamp(min=_KNEE) ** (1 / 2.4) - 0.055
    return torch.where(linear <= _KNEE, 12.92 * linear, power)


def decode(encoded: torch.Tensor) -> torch.Tensor:
    """Linear values of encoded ones; the inverse of :func:`encode`."""
    power = ((encoded.clamp(min=12.92 * _KNEE) + 0.055) / 1.055) ** 2.4
    return torch.where(encoded <= 12.92 * _KNEE, encoded / 12.92, power)
