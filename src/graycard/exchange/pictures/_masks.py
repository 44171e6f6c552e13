# SPDX-License-Identifier: Apache-2.0
"""Masks as programs write them: black and white, 0 and 1, 16 bits, palettes, bool, alpha, floats."""

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from graycard._errors import DatasetError
from graycard.exchange.pictures._pixels import Note, Pixels


@dataclass(frozen=True, slots=True)
class MaskKind:
    """Kind of a set of masks, which tells what one of them means that is the same everywhere."""

    alpha: bool = False
    """True if alpha is the mask."""
    levels: frozenset[float] = frozenset()
    """Values below half of full scale that are white, beside 0, which is black."""


ANY_KIND = MaskKind()
"""Kind of a mask of which nothing else is known."""


def kind_of_masks(masks: Iterable[tuple[Pixels, Path]]) -> MaskKind:
    """Return the kind of a set of masks from those that show both sides.

    Raises:
        DatasetError: As of :func:`white_of`.
    """
    alpha, levels = False, set()
    for pixels, path in masks:
        plane, top, notes = _plane(pixels, path, ANY_KIND)
        alpha |= bool(notes)
        found = _few(plane)
        if len(found) == 2 and found[0] == 0 and found[1] < top / 2:
            levels.add(float(found[1]))
    return MaskKind(alpha, frozenset(levels))


def white_of(pixels: Pixels, path: Path, kind: MaskKind = ANY_KIND) -> tuple[np.ndarray, tuple[Note, ...]]:
    """Return where a mask is white, shape ``(H, W)``, bool, as stored, and notes on how it was read.

    A mask of two values, one of them 0, is white where it is not 0, as one of 0 and 1. Of any other, white is
    from half of full scale. Colours count by their brightest channel. Where colours are the same everywhere
    and alpha is not, alpha is the mask. One without an object, all of one value, follows the others.

    Args:
        pixels: As stored.
        path: Of the file, for messages.
        kind: Kind of the set that it is one of.

    Raises:
        DatasetError: Alpha and colours differ both, values are not finite, or all are dark but several.
    """
    plane, top, notes = _plane(pixels, path, kind)
    found = _few(plane)
    low = len(found) == 1 and found[0] in kind.levels
    if low or (len(found) <= 2 and found[0] == 0):
        if 0 < found[-1] < top / 2:
            notes = (*notes, Note("masks", f"values 0 and {found[-1]:g}: what is not 0 is white"))
        return plane > 0, notes
    if len(found) == 1 or plane.max() >= top / 2:
        return plane >= top / 2, notes
    raise DatasetError(
        f"expected a mask of black and white in {path}, got values from {plane.min():g} to {plane.max():g} "
        f"of {top:g}, as of labels. Write 0 at the object and {top:g} elsewhere"
    )


def _few(plane: np.ndarray) -> np.ndarray:
    """Return the values of a mask in order, all of them where they are one or two."""
    found = np.unique(plane[:: max(1, plane.shape[0] // 64)])
    return np.unique(plane) if len(found) <= 2 else found  # a sample tells that there are more


def _plane(pixels: Pixels, path: Path, kind: MaskKind) -> tuple[np.ndarray, float, tuple[Note, ...]]:
    """Return the channel that is the mask, the value that is white in full, and what is said of it."""
    values = pixels.values if pixels.values.ndim == 2 else pixels.values.max(axis=-1)
    top, notes, alpha = pixels.top, (), pixels.alpha
    if alpha is not None and (kind.alpha or (alpha != alpha.flat[0]).any()):
        shown = values[alpha > 0]
        varied = bool(shown.size) and (shown != shown.flat[0]).any()
        if varied and (alpha != alpha.flat[0]).any():
            raise DatasetError(
                f"expected a mask in the colours or in the alpha of {path}, got both. Leave one of them out"
            )
        if not varied:
            values, notes = alpha, (Note("masks", "the alpha channel is the mask"),)
    if not np.isfinite(values).all():
        raise DatasetError(f"expected a mask of finite values in {path}, got others. Write 0 and 1")
    if not pixels.bits and values.max(initial=0) > 1:
        top = 255.0 if values.max() <= 255 else float(values.max())
    return values, top, notes
