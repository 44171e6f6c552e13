# SPDX-License-Identifier: Apache-2.0
"""Masks as programs write them: black and white, 0 and 1, 16 bits, palettes, bool, alpha, floats."""

from pathlib import Path

import numpy as np

from graycard._errors import DatasetError
from graycard.exchange.pictures._pixels import Note, Pixels


def white_of(pixels: Pixels, path: Path) -> tuple[np.ndarray, tuple[Note, ...]]:
    """Return where a mask is white, shape ``(H, W)``, bool, as stored, and notes on how it was read.

    A mask of two values, one of them 0, is white where it is not 0, as one of 0 and 1. Of any other, white is
    from half of full scale. Colours count by their brightest channel. Where colours are the same everywhere
    and alpha is not, alpha is the mask.

    Raises:
        DatasetError: Alpha and colours differ both, values are not finite, or all are dark but several.
    """
    plane, top, notes = _plane(pixels, path)
    found = np.unique(plane[:: max(1, plane.shape[0] // 64)])
    if len(found) <= 2:  # a sample of rows is enough to tell that there are more
        found = np.unique(plane)
    if len(found) <= 2 and found[0] == 0:
        if 0 < found[-1] < top / 2:
            notes = (*notes, Note("masks", f"values 0 and {found[-1]:g}: what is not 0 is white"))
        return plane > 0, notes
    if len(found) == 1 or plane.max() >= top / 2:
        return plane >= top / 2, notes
    raise DatasetError(
        f"expected a mask of black and white in {path}, got values from {plane.min():g} to {plane.max():g} "
        f"of {top:g}, as of labels. Write 0 at the object and {top:g} elsewhere"
    )


def _plane(pixels: Pixels, path: Path) -> tuple[np.ndarray, float, tuple[Note, ...]]:
    """Return the channel that is the mask, the value that is white in full, and what is said of it."""
    values = pixels.values if pixels.values.ndim == 2 else pixels.values.max(axis=-1)
    top, notes = pixels.top, ()
    if pixels.alpha is not None and (pixels.alpha != pixels.alpha.flat[0]).any():
        shown = values[pixels.alpha > 0]
        if shown.size and (shown != shown.flat[0]).any():
            raise DatasetError(
                f"expected a mask in the colours or in the alpha of {path}, got both. Leave one of them out"
            )
        values, notes = pixels.alpha, (Note("masks", "the alpha channel is the mask"),)
    if not np.isfinite(values).all():
        raise DatasetError(f"expected a mask of finite values in {path}, got others. Write 0 and 1")
    if not pixels.bits and values.max(initial=0) > 1:
        top = 255.0 if values.max() <= 255 else float(values.max())
    return values, top, notes
