# SPDX-License-Identifier: Apache-2.0
"""A second truth: what a picture without noise would be compared with if it were rendered again.

Means of squares have a ceiling in closed form, SSIM has none: it looks at neighbourhoods. So the
score of a noise-free picture is made, not derived. The picture is the truth with most of its noise taken out;
where the filter cannot tell noise from texture it leaves both, and there noise matters little. Noise that is
left makes the ceiling a little too high, so a picture without any is not accused: by 0.0003 to 0.014 in
twelve trials with known noise. New noise is that of the truth's halves, fireflies and all.
"""

import numpy as np

import graycard as gc
from graycard.eval._readings import TrueView

WINDOW = 5
"""Side in pixels of the neighbourhood that is looked at."""


def second_truth(true: TrueView, layer: str) -> tuple[np.ndarray, np.ndarray] | None:
    """A picture nearly without noise, and the same with new noise of the truth's size.

    Args:
        true: A view of the truth.
        layer: One that has a variance and halves, linear.

    Returns:
        Both ``(H, W, 3)``, float64, in the unit of the layer; None where its noise is not known, or none.

    Raises:
        DatasetError: A layer is of another size, or not finite.
    """
    if not all(f"{layer}.{name}" in true.layers for name in ("var", "half_a", "half_b")):
        return None
    variance, a, b = (true.take(f"{layer}.{n}").astype(np.float64) for n in ("var", "half_a", "half_b"))
    if not variance.any():
        return None
    quiet = without_noise(true.take(layer).astype(np.float64), variance)
    return quiet, quiet + (a - b) / 2  # whose variance is that of the mean of the halves


def noise_as_displayed(true: TrueView, layer: str, mask: np.ndarray, exposure: float) -> float | None:
    """Mean variance over a mask of a layer as displayed; None where its noise is not known."""
    if f"{layer}.var" not in true.layers:
        return None
    variance = gc.display_variance(true.take(layer), true.take(f"{layer}.var"), exposure)
    return float(variance[mask].mean())


def without_noise(values: np.ndarray, variance: np.ndarray) -> np.ndarray:
    """What is left when each neighbourhood's variance is brought down to that of the picture without noise.

    As the filter of Lee 1980, but with the root of its gain 1 - noise / spread: the estimate of least error
    has less variance than the picture, and SSIM would take it for a smoother one.

    Args:
        values: With noise, shape ``(H, W, C)``, float64.
        variance: Of the noise, same shape, unit squared.

    Returns:
        Same shape: the local mean where values vary as noise does, the values where they vary far more.
    """
    mean, square, noise = (_local_mean(image) for image in (values, values**2, variance))
    spread = np.maximum(square - mean**2, 1e-300)
    return mean + np.sqrt(np.clip(1 - noise / spread, 0, 1)) * (values - mean)


def _local_mean(image: np.ndarray) -> np.ndarray:
    from scipy.ndimage import uniform_filter

    return uniform_filter(image, WINDOW, mode="nearest", axes=(0, 1))
