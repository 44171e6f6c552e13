# SPDX-License-Identifier: Apache-2.0
"""Errors of networks in base colour: light left in the paint, a view's own gain and tint, blur."""

from dataclasses import dataclass

import numpy as np

from graycard.methods.priors._draws import blurred, draws_of, gains, log_light


@dataclass(frozen=True, slots=True)
class ColorErrors:
    """Errors of base colours."""

    gain: float = 0.0
    """Standard deviation of the log of a view's factor for each channel."""
    leak: float = 0.0
    """Exponent with which light stays in the paint: 0 none, 1 all."""
    blur: float = 0.0
    """A share of the width."""


LEVELS = (
    ColorErrors(),
    ColorErrors(0.03, 0.05, 0.002),
    ColorErrors(0.05, 0.10, 0.004),
    ColorErrors(0.10, 0.20, 0.006),
    ColorErrors(0.15, 0.50, 0.010),
    ColorErrors(0.25, 1.00, 0.015),
)
"""By severity."""


def corrupt_base_color(
    color: np.ndarray, image: np.ndarray, errors: ColorErrors, seed: int, view: str
) -> np.ndarray:
    """Return what a network would say about base colours when it is shown an image.

    ``A' = c A (S / mean S)^leak``, clipped, with the light S that the image shows beyond the paint, I / A,
    its geometric mean, and a view's own c. An image without light in it, the base colour itself, leaves none.

    Args:
        color: shape ``(H, W, 3)``, [0, 1]; black where there is nothing.
        image: shape ``(H, W, 3)``, linear, of any scale: what the network sees.
        errors: How wrong.
        seed: Of the draws.
        view: Name of the view.

    Returns:
        Shape ``(H, W, 3)``, [0, 1], float64.
    """
    paint = color.astype(np.float64)
    factors = gains(draws_of(seed, "base_color", view), errors.gain)
    wrong = paint * factors * np.exp(errors.leak * log_light(image, paint))
    everywhere = np.ones(paint.shape[:2], bool)
    return np.clip(blurred(wrong, errors.blur, everywhere), 0, 1)
