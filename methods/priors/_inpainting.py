# SPDX-License-Identifier: Apache-2.0
"""Errors of inpainting networks: each view in its own way is off in colour, place and detail."""

from dataclasses import dataclass

import numpy as np

from graycard.methods.priors._draws import blurred, draws_of, gains, smooth_field

WARP = 0.1
"""Correlation length of how far things are displaced, a share of the width."""


@dataclass(frozen=True, slots=True)
class InpaintingErrors:
    """Errors of a filled hole."""

    gain: float = 0.0
    """Standard deviation of the log of a view's factor for each channel."""
    warp: float = 0.0
    """Standard deviation of a smooth displacement, each way, a share of the width."""
    blur: float = 0.0
    """A share of the width."""


LEVELS = (
    InpaintingErrors(),
    InpaintingErrors(0.01, 0.003, 0.002),
    InpaintingErrors(0.02, 0.006, 0.004),
    InpaintingErrors(0.05, 0.010, 0.008),
    InpaintingErrors(0.10, 0.018, 0.015),
    InpaintingErrors(0.20, 0.027, 0.025),
)
"""By severity."""


def corrupt_filling(
    without: np.ndarray, errors: InpaintingErrors, seed: int, view: str, is_colour: bool = True
) -> np.ndarray:
    """Return what a network would fill in, where the truth is a layer of the view without the object.

    All layers of a view are displaced alike, and all its colours have the same factors.

    Args:
        without: shape ``(H, W)`` or ``(H, W, 3)``, linear.
        errors: How wrong.
        seed: Of the draws.
        view: Name of the view.
        is_colour: Whether channels are colours, which a network gets wrong by a factor.

    Returns:
        The shape of ``without``, float64.
    """
    from scipy.ndimage import map_coordinates  # SciPy takes long to import

    draws = draws_of(seed, "inpainting", view)
    height, width = without.shape[:2]
    factors = gains(draws, errors.gain)
    away = errors.warp * width * smooth_field(draws, (height, width), 2, WARP)
    places = np.indices((height, width)) + np.moveaxis(away, -1, 0)
    channels = (without * factors if is_colour else without).reshape(height, width, -1)
    moved = np.stack(
        [map_coordinates(c, places, order=1, mode="nearest") for c in np.moveaxis(channels, -1, 0)], axis=-1
    )
    return blurred(moved, errors.blur, np.ones((height, width), bool)).reshape(without.shape)
