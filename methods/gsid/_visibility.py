# SPDX-License-Identifier: Apache-2.0
"""Visibility of lamps as a unit vector of each surfel has it: the paper's way."""

import torch
from torch.nn.functional import normalize

from graycard.methods.gsid._settings import Visibility

VECTOR_FORMS: tuple[Visibility, ...] = ("vector", "vector_half", "vector_relu")
"""The ways to read it."""
_POWER = 8
"""Sharpness of the paper's vector in the reading that fits shadows of many lamps best."""


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


def first_vectors(
    form: Visibility, normals: torch.Tensor, toward: torch.Tensor, given: torch.Tensor, reached: torch.Tensor
) -> torch.Tensor:
    """Return the vectors that come nearest to what rays have found, shape ``(N, 3)``, unit.

    Of each surfel these are tried: along its normal and against it; to and from each lamp; and to and from
    the mean direction of the light that arrives, and of that which does not.

    Args:
        form: How a vector is read.
        normals: Shape ``(N, 3)``, unit.
        toward: Shape ``(N, K, 3)``, unit, to the lamps.
        given: Shape ``(N, K)``: irradiance of each lamp, were nothing in its way.
        reached: Shape ``(N, K)``: share of it that arrives.
    """
    lost = given * (1 - reached)
    means = [normalize((part[..., None] * toward).sum(dim=1), dim=-1) for part in (lost, given - lost)]
    ways = [*toward.unbind(dim=1), *means]
    best, least = -normals, torch.full(normals.shape[:1], torch.inf)
    for tried in (-normals, normals, *ways, *(-way for way in ways)):
        off = (given * (vector_visibility(form, tried, toward) - reached)).square().sum(dim=1)
        better = off < least
        best, least = torch.where(better[:, None], tried, best), torch.where(better, off, least)
    return best
