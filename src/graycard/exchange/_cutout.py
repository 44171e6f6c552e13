# SPDX-License-Identifier: Apache-2.0
"""Photographs whose layout says that what is transparent is empty: NeRF-synthetic's and its kin's.

Their colour is straight (not multiplied by alpha). Nothing sends no light, so it becomes black.
"""

from pathlib import Path

import numpy as np
from PIL import Image

from graycard._errors import DatasetError
from graycard.colour import srgb_decode
from graycard.exchange._photographs import check_photograph, read_photograph


def read_cutout(path: Path, width: int, height: int) -> tuple[np.ndarray, np.ndarray]:
    """Return linear light over black, ``(height, width, 3)``, and coverage, ``(height, width)``, float32.

    Raises:
        DatasetError: The file is missing, broken, or of another kind or size.
    """
    check_photograph(path, width, height)
    opaque = np.ones((height, width), np.float32)
    if path.suffix.lower() != ".png":
        return read_photograph(path, width, height), opaque
    with Image.open(path) as image:
        has_alpha = image.mode in ("RGBA", "LA")
    if not has_alpha:
        return read_photograph(path, width, height), opaque
    pixels = read_levels(path)
    coverage = pixels[..., 3].astype(np.float32) / 255
    light = srgb_decode(np.arange(256) / 255).astype(np.float32)[pixels[..., :3]]
    return light * coverage[..., None], coverage


def read_levels(path: Path) -> np.ndarray:
    """Return the 8-bit levels of a PNG that :func:`check_photograph` has passed, shape ``(H, W, 4)``.

    Raises:
        DatasetError: It breaks off.
    """
    try:
        with Image.open(path) as image:
            return np.asarray(image.convert("RGBA"))
    except (OSError, SyntaxError, ValueError, EOFError) as cause:
        raise DatasetError(f"expected a whole image at {path}, got one that breaks off: {cause}") from cause
