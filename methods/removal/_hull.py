# SPDX-License-Identifier: Apache-2.0
"""Holes that are all that lies in the grown hull of the object, as in the released code of GOR-IS."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.ndimage import median_filter
from scipy.spatial import Delaunay, QhullError

from graycard.methods.removal._behind import Behind
from graycard.methods.removal._filled import filled_depth
from graycard.methods.removal._target import widened, without_strays

GROWN = 1.5
"""Factor on the object's hull, about the mean of its points."""
_MEDIAN = 5
"""Pixels of the median filter on holes."""


def hull_holes(
    behind: Sequence[Behind], masks: Sequence[np.ndarray], grow: float, places: np.ndarray
) -> list[Behind]:
    """Return the views with other holes: pixels whose surface behind the object lies in the object's grown
    hull.

    Behind the object that surface goes on from around it. What of a hole was not in doubt is so now.

    Args:
        behind: The training views.
        masks: Of the object, one a view, shape ``(H, W)``, bool.
        grow: By which they are widened, a share of the width.
        places: Shape ``(M, 3)``: of the object's surfels, metres. If they span no volume, holes stay.
    """
    own = without_strays(places)
    middle = own.mean(axis=0)
    try:
        hull = Delaunay(middle + GROWN * (own - middle))
    except (QhullError, ValueError):
        return list(behind)
    found = []
    for one, mask in zip(behind, masks, strict=True):
        depth = filled_depth(one.depth, widened(mask, grow))
        inside = np.zeros(depth.shape, bool)
        known = np.isfinite(depth)
        inside[known] = hull.find_simplex(one.view.camera.unproject(depth)[known]) >= 0
        hole = median_filter(inside, _MEDIAN)
        found.append(replace(one, hole=hole, doubt=one.doubt | hole))
    return found
