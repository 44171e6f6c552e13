# SPDX-License-Identifier: Apache-2.0
"""Find the side of masks that is the object, and the share of the pictures that it fills."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np

from graycard._errors import DatasetError
from graycard.exchange.pictures._pixels import Note

MaskObject = Literal["auto", "black", "white"]
"""Side of a mask that is the object; with auto black, unless masks look inverted, which is an error."""
MOST = 0.5
"""Share of pictures, and of their borders, above which an object looks like its surroundings."""


@dataclass(frozen=True, slots=True)
class MaskShape:
    """Shares of a mask in its picture."""

    share: float
    """Share of the picture that is black."""
    border: float
    """Share of the pixels along the border that are black."""


def shape_of_mask(black: np.ndarray) -> MaskShape:
    """Return how a mask ``(H, W)``, bool, lies in its picture."""
    border = np.concatenate([black[0], black[-1], black[:, 0], black[:, -1]])
    return MaskShape(float(black.mean()), float(border.mean()))


def judge_masks(
    shapes: Sequence[MaskShape], paths: Sequence[Path], chosen: MaskObject = "auto"
) -> tuple[bool, Note]:
    """Return whether white is the object, and how much of the pictures the object fills.

    Args:
        shapes: Of each mask, in the sense of black.
        paths: Of each mask, for messages.
        chosen: Which side is the object.

    Raises:
        DatasetError: The object is nowhere, everywhere in some picture, or the surroundings of something
            else: then masks look inverted.
    """
    white = chosen == "white"
    side, other = ("white", "black") if white else ("black", "white")
    advice = (
        f"Masks are {side} where the object is seen and {other} elsewhere: mend them, say --mask-object "
        f"{other}, or import without masks"
    )
    shares = [1 - shape.share if white else shape.share for shape in shapes]
    if (full := next((i for i, share in enumerate(shares) if share == 1), None)) is not None:
        raise DatasetError(
            f"expected a mask with an object in {paths[full]}, got one that is all {side}. {advice}"
        )
    if not any(shares):
        raise DatasetError(
            f"expected an object in some mask of {len(shares)}, as {paths[0]}, got masks without any {side}. "
            f"{advice}"
        )
    mean = float(np.mean(shares))
    edge = float(np.mean([1 - s.border if white else s.border for s in shapes]))
    if chosen == "auto" and mean > MOST and edge > MOST:
        raise DatasetError(
            f"expected masks that are black where the object is seen, as {paths[0]}, got black in {mean:.0%} "
            f"of the pictures and along {edge:.0%} of their borders: they look inverted. Say which side is "
            "the object: --mask-object white or black"
        )
    said = f"{side} is the object: {mean:.0%} of the pictures ({min(shares):.0%} to {max(shares):.0%})"
    return white, Note("masks", said, warns=mean > MOST)
