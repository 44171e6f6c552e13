# SPDX-License-Identifier: Apache-2.0
"""What is in the way of lamps as a unit vector of each surfel has it: the paper's way."""

import torch
from torch.nn.functional import normalize

from graycard.methods.gsid._settings import Visibility

VECTOR_FORMS: tuple[Visibility, ...] = ("vector", "vector_half", "vector_relu")
"""The ways to read it."""
_POWER = 8
"""Of the paper's vector in the reading that fits shadows of many lamps best."""


def vector_visibility(form: Visibility, vector: torch.Tensor, toward: torch.Tensor) -> torch.Tensor:
    """Share of the lamps' light that arrives, as a drawn vector has it, shape ``(..., K)``.

    Args:
        form: How the vector is read, see :class:`GsidSettings`.
        vector: Shape ``(..., 3)``, of any length.
        toward: Shape ``(..., K, 3)``, unit, to the lamps.
    """
    cosine = (normalize(vector, dim=-1, eps=1e-6)[..., None, :] * toward).sum(dim=-1)
    if form == "vector_half":
        return (1 + cosine) / 2
    if form == "vector_relu":
        return cosine.relu()
    return 1 - cosine.relu() ** _POWER
