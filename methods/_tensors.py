# SPDX-License-Identifier: Apache-2.0
"""Conversions between NumPy arrays and tensors."""

import numpy as np
import torch


def float_tensor(values: np.ndarray) -> torch.Tensor:
    """Return values as a float32 tensor; memory is shared where they are float32 already."""
    return torch.from_numpy(np.asarray(values, np.float32))


def contiguous_float_tensor(values: np.ndarray) -> torch.Tensor:
    """Return values as a float32 tensor in C order; memory is shared where they are so already."""
    return torch.from_numpy(np.ascontiguousarray(values, dtype=np.float32))


def contiguous_array(values: torch.Tensor) -> np.ndarray:
    """Return a tensor as an array in C order, without its gradient."""
    return np.ascontiguousarray(values.detach().numpy())
