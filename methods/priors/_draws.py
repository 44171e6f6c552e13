# SPDX-License-Identifier: Apache-2.0
"""Draws that all corruptions are made of: draws of a view, smooth random fields, blur, the light in an image.

Lengths are shares of the image's width, for networks see every image at their own size. Draws depend on seed,
kind and view alone: not on the severity, so that errors grow with it in place; not on the image, so that two
answers about one view differ by what the images show; not on the order in which views are asked for.
"""

import hashlib

import numpy as np

DARKEST = 1e-4
"""Radiance, of the image's brightest, below which nothing is told apart."""
BLACK = 0.01
"""Base colour below which its share of the light cannot be told."""
RANGE = np.log(100.0)
"""Bounds: how far light may be from its mean, natural log: what is darker or brighter counts as this."""
CORRELATION = 0.06
"""Correlation length of random fields: about the size of a thing in a room."""


def seed_in(seed: int, scene: str) -> int:
    """Return a seed for one scene: views of other scenes bear the same names, and their errors are others."""
    return int.from_bytes(hashlib.sha256(f"{seed}/{scene}".encode()).digest()[:8], "big")


def draws_of(seed: int, kind: str, view: str) -> np.random.Generator:
    """Return the random numbers of a view's errors of one kind."""
    digest = hashlib.sha256(f"{seed}/{kind}/{view}".encode()).digest()
    return np.random.default_rng(int.from_bytes(digest[:16], "big"))


def smooth_field(
    draws: np.random.Generator, size: tuple[int, int], channels: int = 1, length: float = CORRELATION
) -> np.ndarray:
    """Return a Gaussian random field of mean 0 and variance 1 over each channel.

    Args:
        draws: Where its numbers come from.
        size: Height and width.
        channels: How many, independent of each other.
        length: Standard deviation of the kernel that blurs white noise, a share of the width.

    Returns:
        Shape ``(H, W, channels)``.
    """
    from scipy.ndimage import gaussian_filter  # SciPy takes long to import

    noise = draws.standard_normal((*size, channels))
    smooth = gaussian_filter(noise, length * size[1], axes=(0, 1), mode="wrap")
    smooth -= smooth.mean(axis=(0, 1))
    return smooth / np.maximum(smooth.std(axis=(0, 1)), 1e-12)


def blurred(image: np.ndarray, length: float, known: np.ndarray) -> np.ndarray:
    """Return an image blurred over the pixels that are known; the others stay as they are.

    Args:
        image: shape ``(H, W)`` or ``(H, W, C)``.
        length: Standard deviation, a share of the width.
        known: shape ``(H, W)``, bool.
    """
    from scipy.ndimage import gaussian_filter  # SciPy takes long to import

    sigma = length * image.shape[1]
    if sigma == 0 or not known.any():
        return image
    inside = known if image.ndim == known.ndim else known[..., None]
    total = gaussian_filter(np.where(inside, image, 0.0), sigma, axes=(0, 1), mode="nearest")
    weight = gaussian_filter(inside.astype(np.float64), sigma, axes=(0, 1), mode="nearest")
    return np.where(inside, total / np.maximum(weight, 1e-12), image)


def log_light(image: np.ndarray, base_color: np.ndarray) -> np.ndarray:
    """Return the light that an image shows beyond the paint: log of I / A, about its mean.

    An image of the base colour itself shows none, nor does one under even light, of whatever strength.

    Args:
        image: shape ``(H, W, 3)``, linear, of any scale.
        base_color: shape ``(H, W, 3)``, the true one; black where there is nothing.

    Returns:
        Shape ``(H, W, 3)``, natural log; 0 where there is nothing.
    """
    shown, paint = np.asarray(image, np.float64), np.asarray(base_color, np.float64)
    seen = (paint > 0).any(axis=-1, keepdims=True)
    floor = DARKEST * max(float(shown.max()), 1e-30)
    log = np.log(np.maximum(shown, floor) / np.maximum(paint, BLACK))
    mean = float(np.mean(log, where=seen)) if seen.any() else 0.0
    return np.where(seen, np.clip(log - mean, -RANGE, RANGE), 0.0)


def relief(light: np.ndarray, fine: float, coarse: float) -> np.ndarray:
    """Return what stands out in the light: what is between two scales, 0 under even light.

    Args:
        light: shape ``(H, W, 3)``, of :func:`log_light`.
        fine: Detail below this is smoothed away, a share of the width.
        coarse: Slopes wider than this are taken off, a share of the width.

    Returns:
        Shape ``(H, W)``, natural log.
    """
    from scipy.ndimage import gaussian_filter  # SciPy takes long to import

    log, width = light.mean(axis=-1), light.shape[1]
    narrow, wide = (gaussian_filter(log, s * width, mode="nearest") for s in (fine, coarse))
    return narrow - wide


def gains(draws: np.random.Generator, spread: float) -> np.ndarray:
    """Return a factor for each channel of a view, log-normal, shape ``(3,)``."""
    return np.exp(spread * draws.standard_normal(3))
