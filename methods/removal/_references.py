# SPDX-License-Identifier: Apache-2.0
"""Choose the inpainted views that tell the others, as GOR-IS's released code does."""

from collections.abc import Mapping
from itertools import combinations

import numpy as np

from graycard import srgb_encode
from graycard.methods.removal._behind import NEAR, points_in_picture
from graycard.methods.removal._filled import Choice, Target, filled_depth
from graycard.methods.removal._settings import RemovalSettings

CANDIDATES = 10
"""Views with the largest holes, out of which the released code chooses."""


def choice_of(settings: RemovalSettings) -> Choice | None:
    """Return the rule for references; None for those with the largest holes."""
    return Choice(CANDIDATES, chosen_references) if settings.reference_choice == "release" else None


def chosen_references(filled: Mapping[int, Target], count: int) -> dict[int, Target]:
    """Return the views out of some that differ most, by pairs.

    Of each pair count the difference of their inpainted colours, carried from one hole to the other view, and
    how far apart they look. The released code calls the former consistency and takes the largest sum, so the
    views are those that agree least.

    Args:
        filled: Inpainted views by their numbers.
        count: How many are chosen.
    """
    if len(filled) <= count:
        return dict(filled)
    depths = {number: filled_depth(one.behind.depth, one.behind.hole) for number, one in filled.items()}
    apart = {
        (a, b): _apart(filled[a], filled[b])
        * sum(_difference(filled[x], filled[y], depths[x], depths[y]) for x, y in ((a, b), (b, a)))
        for a, b in combinations(filled, 2)
    }
    best = max(
        combinations(filled, count), key=lambda group: sum(apart[pair] for pair in combinations(group, 2))
    )
    return {number: filled[number] for number in best}


def _apart(one: Target, other: Target) -> float:
    """0 for views in the same direction, 1 for opposite ones."""
    cosine = float(one.behind.view.camera.forward @ other.behind.view.camera.forward)
    return (1 - cosine) / 2


def _difference(one: Target, other: Target, depth: np.ndarray, its_depth: np.ndarray) -> float:
    """Mean absolute difference of displayed colours in a view's hole from another's; 0 if it sees none."""
    camera, shown = one.behind.view.camera, one.behind.hole & np.isfinite(depth)
    points = camera.unproject(depth)[shown]
    numbers, rows, columns, z = points_in_picture(other.behind.view.camera, points)
    same = np.abs(z / its_depth[rows, columns] - 1) <= NEAR
    if not same.any():
        return 0.0
    mine = srgb_encode(one.picture[shown][numbers[same]])
    return float(np.abs(mine - srgb_encode(other.picture[rows[same], columns[same]])).mean())
