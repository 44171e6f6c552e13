# SPDX-License-Identifier: Apache-2.0
"""The appearance loss of GOR-IS: LPIPS between what is drawn in a hole and what was inpainted there."""

from collections.abc import Mapping

import torch

from graycard import WeightsError
from graycard.networks import lpips_layers, published_lpips

WEIGHT = 0.2
"""Weight of the appearance loss, beside 1 of the loss of materials (the paper's supplement, S1.5)."""
LEAST_SIDE = 32
"""Side in pixels to which smaller pictures are padded with black, as in the released code."""
NET = "vgg"
"""The released code trains with VGG-16; the paper names no trunk."""

Box = tuple[slice, slice]


def appearance_weights() -> Mapping[str, torch.Tensor]:
    """Return the weights of VGG-16 and of LPIPS, by name.

    Raises:
        WeightsError: They were not fetched, or are damaged.
    """
    try:
        return published_lpips(NET)
    except WeightsError as cause:
        raise WeightsError(f'{cause}, or fit with hole_loss "photometric"') from cause


def box_around(hole: torch.Tensor) -> Box:
    """Return the rows and columns of the least box that holds all pixels above 0; empty where there are none.

    Args:
        hole: shape ``(H, W)``.
    """
    rows, columns = (torch.nonzero((hole > 0).any(dim=axis)).flatten() for axis in (1, 0))
    if not len(rows):
        return slice(0, 0), slice(0, 0)
    return slice(int(rows[0]), int(rows[-1]) + 1), slice(int(columns[0]), int(columns[-1]) + 1)


def appearance_loss(drawn: torch.Tensor, painted: torch.Tensor, rough: torch.Tensor) -> torch.Tensor:
    """Return 0.2 times LPIPS of two pictures that are black outside of a mask (equation 8 of the supplement).

    Args:
        drawn: shape ``(H, W, 3)``, display values; gradients flow to it.
        painted: shape ``(H, W, 3)``, display values.
        rough: shape ``(H, W)``, 1 where radiance was inpainted.

    Returns:
        A scalar, 0 where nothing was inpainted.

    Raises:
        WeightsError: The weights were not fetched, or are damaged.
    """
    if not bool((rough > 0).any()):
        return torch.zeros(())
    pair = (torch.stack([drawn, painted]) * rough[..., None]).permute(0, 3, 1, 2)
    short = [max(LEAST_SIDE - side, 0) for side in rough.shape]
    around = [short[1] // 2, short[1] - short[1] // 2, short[0] // 2, short[0] - short[0] // 2]
    pair = torch.nn.functional.pad(pair, around)
    return WEIGHT * torch.stack([e.mean() for e in lpips_layers(pair, NET, appearance_weights())]).sum()
