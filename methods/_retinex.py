# SPDX-License-Identifier: Apache-2.0
"""``retinex``: colour Retinex on single images, the classical baseline of intrinsic images."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.fft import dctn, idctn

from graycard import Capture, Progress
from graycard.methods._contract import Priors
from graycard.methods._lookup import Lookup, load_lookup, photographs

FLOOR = 1e-3
"""Display-range radiance below which a pixel is noise: keeps the logarithm finite."""


@dataclass(frozen=True, slots=True)
class RetinexSettings:
    """Settings of ``retinex``; the thresholds are steps between neighbouring pixels in natural log.

    Their defaults are the best of a grid on scenes that judge nobody (seeds 1000 and 1001 of each track).
    """

    brightness_step: float = 0.8
    """A larger step of log brightness is an edge of the paint."""
    colour_step: float = 0.1
    """A larger step of log chromaticity is an edge of the paint."""
    mean_albedo: float = 0.18
    """Geometric mean that each albedo image is scaled to (gray world): a single image leaves it open."""

    def __post_init__(self) -> None:
        """Check the ranges."""
        if self.brightness_step < 0 or self.colour_step < 0:
            raise ValueError(f"expected steps >= 0, got {self.brightness_step} and {self.colour_step}")
        if not 0 < self.mean_albedo <= 1:
            raise ValueError(f"expected a mean albedo in (0, 1], got {self.mean_albedo}")


class RetinexMethod:
    """Colour Retinex: small steps are shading, large or coloured steps are paint.

    Like ``input`` it sees the photograph of the scored view. Source of the algorithm: Grosse, Johnson,
    Adelson, Freeman, "Ground truth dataset and baseline evaluations for intrinsic image algorithms",
    ICCV 2009, §4.2 (after Land and McCann 1971, Horn 1974).
    """

    summary = "Colour Retinex on the photograph of the scored view (Grosse et al. 2009)"
    needs = ("radiance",)
    settings_type = RetinexSettings

    def fit(
        self, capture: Capture, priors: Priors, settings: RetinexSettings, seed: int, progress: Progress
    ) -> Lookup:
        """Split every photograph on its own.

        Raises:
            MethodError: A held-out photograph was not handed in.
        """
        images = {}
        taken = photographs(capture, priors)
        for done, (key, image) in enumerate(taken.items()):
            progress(done / len(taken), "splitting photographs")
            albedo = split(np.asarray(image, np.float64) * capture.exposure, settings)
            shading = np.asarray(image) / albedo
            images[key] = {"base_color": albedo.astype(np.float32), "shading": shading.astype(np.float32)}
        return Lookup("retinex", images)

    def load(self, folder: Path) -> Lookup:
        """Return a saved decomposition.

        Raises:
            MethodError: It is missing, damaged, or of another method.
        """
        return load_lookup(folder, "retinex")


def split(image: np.ndarray, settings: RetinexSettings) -> np.ndarray:
    """Return the albedo of one photograph.

    The log albedo of each channel is the least-squares solution whose steps are those of the log image
    where they are paint and 0 where they are shading.

    Args:
        image: shape ``(H, W, 3)``, linear, display range.
        settings: The thresholds.

    Returns:
        Albedo, shape ``(H, W, 3)``, (0, ∞), geometric mean ``settings.mean_albedo``.
    """
    log = np.log(np.maximum(image, FLOOR))
    across, down = (_paint_steps(np.diff(log, axis=axis), settings) for axis in (1, 0))
    albedo = np.exp(integrate_steps(across, down))
    return albedo * settings.mean_albedo


def integrate_steps(across: np.ndarray, down: np.ndarray) -> np.ndarray:
    """Return the image whose steps come closest to the given ones in least squares; each channel has mean 0.

    Solves the Poisson equation with free borders exactly, by the cosine transform.

    Args:
        across: steps along rows, shape ``(H, W - 1, C)``.
        down: steps along columns, shape ``(H - 1, W, C)``.

    Returns:
        shape ``(H, W, C)``.
    """
    height, width = across.shape[0], down.shape[1]
    divergence = np.diff(np.pad(across, ((0, 0), (1, 1), (0, 0))), axis=1)
    divergence = divergence + np.diff(np.pad(down, ((1, 1), (0, 0), (0, 0))), axis=0)
    waves = [2 * np.cos(np.pi * np.arange(n) / n) - 2 for n in (height, width)]
    laplacian = waves[0][:, None] + waves[1][None, :]
    laplacian[0, 0] = 1  # the mean is free: the steps do not tell it
    spectrum = dctn(divergence, axes=(0, 1)) / laplacian[..., None]
    spectrum[0, 0] = 0
    return np.asarray(idctn(spectrum, axes=(0, 1)))


def _paint_steps(steps: np.ndarray, settings: RetinexSettings) -> np.ndarray:
    """Return the steps that are paint, others 0; shape ``(H, W, 3)``."""
    brightness = steps.mean(axis=-1)
    chromaticity = np.linalg.norm(steps - brightness[..., None], axis=-1)
    paint = (np.abs(brightness) > settings.brightness_step) | (chromaticity > settings.colour_step)
    return steps * paint[..., None]
