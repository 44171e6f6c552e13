# SPDX-License-Identifier: Apache-2.0
"""Errors of networks in masks: too wide or too narrow, a trembling border, a view without."""

from dataclasses import dataclass

import numpy as np

from graycard.methods.priors._draws import draws_of, smooth_field

TREMBLE = 0.02
"""Correlation length of the border's error, a share of the width."""


@dataclass(frozen=True, slots=True)
class MaskErrors:
    """Errors of a mask."""

    spread: float = 0.0
    """Standard deviation of how far a view's mask is dilated (or eroded), a share of the width."""
    tremble: float = 0.0
    """Standard deviation of a border's place around that, a share of the width."""
    misses: float = 0.0
    """Probability that nothing is found in a view."""


LEVELS = (
    MaskErrors(),
    MaskErrors(0.004, 0.003, 0.00),
    MaskErrors(0.008, 0.006, 0.02),
    MaskErrors(0.014, 0.010, 0.05),
    MaskErrors(0.022, 0.015, 0.10),
    MaskErrors(0.035, 0.022, 0.20),
)
"""By severity."""


def corrupt_mask(mask: np.ndarray, of: str, errors: MaskErrors, seed: int, view: str) -> np.ndarray:
    """Return what a network would say about where something is, shape ``(H, W)``, bool.

    Args:
        mask: shape ``(H, W)``, bool.
        of: What it is of: each has its own errors.
        errors: How wrong.
        seed: Of the draws.
        view: Name of the view.
    """
    from scipy.ndimage import distance_transform_edt  # SciPy takes long to import

    draws = draws_of(seed, f"mask/{of}", view)
    luck, spread = draws.random(), draws.standard_normal()
    border = smooth_field(draws, mask.shape, length=TREMBLE)[..., 0]
    if luck < errors.misses or not mask.any():
        return np.zeros_like(mask)
    if mask.all():
        return mask.copy()
    inside, outside = (np.asarray(distance_transform_edt(part)) for part in (mask, ~mask))
    from_border = np.where(mask, inside - 0.5, 0.5 - outside)  # the border lies between two pixels
    return from_border + mask.shape[1] * (errors.spread * spread + errors.tremble * border) > 0
