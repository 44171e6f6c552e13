# SPDX-License-Identifier: Apache-2.0
"""Which surfels touch which tile, nearest first."""

from typing import NamedTuple

import numpy as np
from numba import njit, prange

TILE = 16
"""Pixels on the side of a tile, which one thread draws at a time."""


class TileLists(NamedTuple):
    """A list of surfels for each tile, tiles in row-major order."""

    start: np.ndarray
    """Shape ``(tiles + 1,)``, int64: where each tile's list begins in ``surfels``."""
    surfels: np.ndarray
    """Shape ``(pairs,)``, int64: row of the footprint, nearest centre first within a tile."""
    slots: np.ndarray
    """Shape ``(n + 1,)``, int64: where each surfel's own pairs begin, in an order of pairs by surfel."""


def tile_lists(bounds: np.ndarray, depths: np.ndarray, width: int, height: int) -> TileLists:
    """Sort surfels by depth (equals as they come) and hand them to the tiles that their bounds touch.

    Args:
        bounds: as in ``Footprints.bounds``.
        depths: shape ``(n,)``, of the centres.
        width: of the image, pixels.
        height: of the image, pixels.
    """
    columns, rows = -(-width // TILE), -(-height // TILE)
    tiles = bounds // TILE
    tiles[:, 1::2] = -(-bounds[:, 1::2] // TILE)
    areas = (tiles[:, 1] - tiles[:, 0]).astype(np.int64) * (tiles[:, 3] - tiles[:, 2])
    order = np.argsort(depths, kind="stable")
    counts = np.zeros(columns * rows, np.int64)
    _count(order, tiles, columns, rows, counts)
    start = _running_sum(counts)
    surfels = np.empty(start[-1], np.int64)
    _fill(order, tiles, columns, rows, start, surfels)
    return TileLists(start, surfels, _running_sum(areas))


def _running_sum(counts: np.ndarray) -> np.ndarray:
    return np.concatenate([np.zeros(1, np.int64), np.cumsum(counts, dtype=np.int64)])


@njit(parallel=True, cache=True)
def _count(order, tiles, columns, rows, counts):
    """Surfels of each tile; a thread has whole rows of tiles to itself."""
    for row in prange(rows):
        for surfel in order:
            if tiles[surfel, 2] <= row < tiles[surfel, 3]:
                for column in range(tiles[surfel, 0], tiles[surfel, 1]):
                    counts[row * columns + column] += 1


@njit(parallel=True, cache=True)
def _fill(order, tiles, columns, rows, start, surfels):
    """Write the lists, in the order that is given."""
    for row in prange(rows):
        position = start[row * columns : (row + 1) * columns].copy()
        for surfel in order:
            if tiles[surfel, 2] <= row < tiles[surfel, 3]:
                for column in range(tiles[surfel, 0], tiles[surfel, 1]):
                    surfels[position[column]] = surfel
                    position[column] += 1
