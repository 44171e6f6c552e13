# SPDX-License-Identifier: Apache-2.0
"""Masks of other programs, black where they ignore a pixel: on ``tabletop``, the object to be removed."""

from collections.abc import Sequence

import numpy as np

from graycard._errors import DatasetError
from graycard.exchange._cameras import PosedPhotograph
from graycard.exchange._doctor import ImportRow
from graycard.exchange._photographs import read_mask

MOST = 0.5
"""Share of the pictures above which an object looks like its surroundings: an inverted mask."""
_ADVICE = "Masks are black where the object is seen and white elsewhere: mend them, or import without masks"


def survey_masks(train: Sequence[PosedPhotograph]) -> ImportRow:
    """Return a row about the masks of training photographs.

    Raises:
        DatasetError: None shows an object, or one shows nothing else.
    """
    shares = [_share(shot) for shot in train]
    if not any(shares):
        raise DatasetError(
            f"expected an object in some mask of {len(train)}, as {train[0].mask}, got masks without any "
            f"black. {_ADVICE}"
        )
    mean = float(np.mean(shares))
    said = f"black, the object, is {mean:.0%} of the pictures"
    if mean > MOST:
        return ImportRow("masks", len(train), f"{said}: are they inverted? {_ADVICE}", warns=True)
    return ImportRow("masks", len(train), said)


def _share(shot: PosedPhotograph) -> float:
    assert shot.mask is not None, "there is one for each"
    share = float(read_mask(shot.mask, *shot.size).mean())
    if share == 1:
        raise DatasetError(
            f"expected a mask with an object in {shot.mask}, got one that is all black. {_ADVICE}"
        )
    return share
