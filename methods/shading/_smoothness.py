# SPDX-License-Identifier: Apache-2.0
"""Smoothness: what regularisers lower."""

import torch


def unevenness(cubemap: torch.Tensor) -> torch.Tensor:
    """Mean absolute difference between neighbours in a cubemap, within its faces."""
    if cubemap.shape[1] == 1:
        return cubemap.sum() * 0
    return cubemap.diff(dim=1).abs().mean() + cubemap.diff(dim=2).abs().mean()


def unevenness_but_for_edges(
    layers: torch.Tensor, guide: torch.Tensor, squared: bool = False
) -> torch.Tensor:
    """Mean difference of neighbours, less where a picture differs too: ``|d layers| exp(-|d guide|)``.

    Args:
        layers: Shape ``(H, W, C)``.
        guide: Shape ``(H, W, 3)``; its difference is averaged over channels.
        squared: Whether ``|d layers|²`` is taken (GS-IR) in place of ``|d layers|`` (R3DG).
    """
    total = torch.zeros(())
    for axis in (0, 1):
        edge = torch.exp(-guide.diff(dim=axis).abs().mean(dim=-1, keepdim=True))
        step = layers.diff(dim=axis)
        total = total + ((step.square() if squared else step.abs()) * edge).mean()
    return total
