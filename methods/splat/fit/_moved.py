# SPDX-License-Identifier: Apache-2.0
"""A parameter as Adam takes it."""

from typing import NamedTuple

import torch

BETA_1, BETA_2 = 0.9, 0.999


class Moved(NamedTuple):
    """A parameter of a step: float32 tensors of one shape in C order, all but the gradient to be changed."""

    values: torch.Tensor
    gradient: torch.Tensor
    first: torch.Tensor
    """Running mean of the gradient."""
    second: torch.Tensor
    """Running mean of its square."""
    rate: float
    steps: int
    """Number of its moves, this one included."""
