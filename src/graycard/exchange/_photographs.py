# SPDX-License-Identifier: Apache-2.0
"""Photographs and masks as an export writes them: 8-bit sRGB in PNG."""

from pathlib import Path

import numpy as np
from PIL import Image

from graycard.colour import srgb_encode
from graycard.io import atomic_path


def write_photograph(path: Path, linear: np.ndarray, *, opaque: bool = False) -> None:
    """Write linear light, where 1 is display white, as an 8-bit sRGB PNG, shape ``(H, W, 3)``.

    Args:
        path: The file.
        linear: The light.
        opaque: Add a channel of alpha that covers all.

    Raises:
        OutputError: The folder cannot be written to, or the disk is full.
    """
    pixels = np.rint(255 * srgb_encode(linear)).astype(np.uint8)
    write_png(path, np.dstack([pixels, np.full_like(pixels[..., :1], 255)]) if opaque else pixels)


def write_mask(path: Path, ignored: np.ndarray) -> None:
    """Write a mask that is black where ``ignored``, shape ``(H, W)``, bool.

    Raises:
        OutputError: The folder cannot be written to, or the disk is full.
    """
    write_png(path, np.where(ignored, 0, 255).astype(np.uint8))


def write_png(path: Path, pixels: np.ndarray) -> None:
    """Write 8-bit pixels as PNG, shape ``(H, W)``, ``(H, W, 3)`` or ``(H, W, 4)``, whole or not at all.

    Raises:
        OutputError: The folder cannot be written to, or the disk is full.
    """
    with atomic_path(path) as partial:
        Image.fromarray(pixels).save(partial, format="PNG")
