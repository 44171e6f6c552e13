# SPDX-License-Identifier: Apache-2.0
"""A tree of boxes around surfels, in which a ray finds the few that it may meet."""

from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from graycard.methods.splat._surfels import Surfels
from graycard.methods.splat.simd._vector import LANES
from graycard.methods.splat.trace._bvh_kernels import (
    AXIS_BITS,
    BOX,
    COLUMNS,
    RECORD,
    fill_leaves,
    fill_level,
    prepare,
    sort_keys,
)


class Tree(NamedTuple):
    """Arrays of the kernels; :mod:`graycard.methods.splat.trace._bvh_kernels` gives the order of numbers."""

    records: np.ndarray
    """float32, flat: ``RECORD`` vectors a leaf."""
    boxes: np.ndarray
    """float32, flat: ``BOX`` vectors a group of sixteen, the surfels' own first, then level by level."""
    levels: np.ndarray
    """int64: the first group of each level, the leaves' level first."""
    order: np.ndarray
    """int32: the surfel in each place of the leaves, -1 where there is none."""
    reach: np.ndarray
    """float32 ``(BOX,)``: the box around everything."""
    leaf_size: float
    """Metres: the median longest side of a leaf's box."""


class Geometry(NamedTuple):
    """Surfels without features, float64."""

    centres: np.ndarray
    rotations: np.ndarray
    scales: np.ndarray
    opacities: np.ndarray


@dataclass(frozen=True, eq=False)
class Bvh:
    """The tree of certain surfels; it is no longer theirs once one of them has moved or changed."""

    tree: Tree
    geometry: Geometry

    def check(self, surfels: Surfels) -> None:
        """Compare the surfels with those of which the tree was made.

        Raises:
            ValueError: Their geometry or opacities are others.
        """
        theirs = _geometry(surfels)
        for name, own, other in zip(Geometry._fields, self.geometry, theirs, strict=True):
            if not np.array_equal(own, other):
                raise ValueError(
                    f"expected the surfels of which the tree was made, got others (in their {name}): "
                    "call build_bvh again when they have changed"
                )


def bvh_of(surfels: Surfels) -> Bvh:
    """Return result that :func:`graycard.methods.splat.build_bvh` gives."""
    if surfels.centres.device.type != "cpu":
        raise ValueError(f"expected surfels on the CPU, got them on {surfels.centres.device}")
    geometry = _geometry(surfels)
    rows, keys = np.empty((len(surfels), COLUMNS), np.float32), np.empty(len(surfels), np.uint32)
    prepare(geometry, *_curve(geometry.centres), rows, keys)
    levels = _levels(len(surfels))
    leaves = int(levels[1])
    order = np.full(leaves * LANES, -1, np.int32)
    order[: len(surfels)] = sort_keys(keys)
    records = np.empty(leaves * RECORD * LANES, np.float32)
    boxes = np.empty((int(levels[-1]) + 1) * BOX * LANES, np.float32)
    fill_leaves(rows, order, records, boxes)
    for below, above in pairwise(levels):
        fill_level(boxes, above - below, below, above)
    return Bvh(Tree(records, boxes, levels, order, *_extent(boxes, levels)), geometry)


def _geometry(surfels: Surfels) -> Geometry:
    """Return the numbers of the surfels, copied where they are not float64 already."""
    parts = (surfels.centres, surfels.rotations, surfels.scales, surfels.opacities)
    return Geometry(*(np.array(part.detach().numpy(), np.float64) for part in parts))


def _curve(centres: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Least centre, and steps of the curve per metre along each axis."""
    if len(centres) == 0:
        return np.zeros(3), np.zeros(3)
    columns = np.ascontiguousarray(centres.T)  # along rows of three NumPy is twenty times slower
    low = columns.min(axis=1)
    extent = columns.max(axis=1) - low
    return low, (2**AXIS_BITS - 1) / np.where(extent > 0, extent, 1.0)


def _levels(count: int) -> np.ndarray:
    """First group of each level of the tree of that many surfels: at least one leaf, below one group."""
    starts, groups = [0], max(-(-count // LANES), 1)
    while groups > 1 or len(starts) == 1:
        starts.append(starts[-1] + groups)
        groups = -(-groups // LANES)
    return np.array(starts, np.int64)


def _extent(boxes: np.ndarray, levels: np.ndarray) -> tuple[np.ndarray, float]:
    """Return the box around everything, and the size of a leaf."""
    groups = boxes.reshape(-1, BOX, LANES)
    low, high = groups[-1, :3].min(axis=1), groups[-1, 3:].max(axis=1)
    past = levels[2] if len(levels) > 2 else len(groups)
    leaves = groups[levels[1] : past]
    sides = (leaves[:, 3:] - leaves[:, :3]).max(axis=1)
    filled = sides[sides >= 0]
    return np.concatenate([low, high]), float(np.median(filled)) if filled.size else 0.0
