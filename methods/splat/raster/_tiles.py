# SPDX-License-Identifier: Apache-2.0
"""Which surfels touch which tile, nearest first."""

from typing import NamedTuple

import numpy as np
from numba import get_num_threads

from graycard.methods._numba import njit
from graycard.methods.splat.simd._parts import INLINED, UNWRAPPED, run_in, share, task

TILE = 16
"""Pixels on the side of a tile, which one thread draws at a time."""
INDEX_BITS = 28
"""Of a sorting key: the surfel. The depth has the rest."""
PASS_BITS = 12
"""Of the key, sorted at a time: as many piles fit the nearest cache."""


class TileLists(NamedTuple):
    """A list of surfels for each tile, tiles in row-major order."""

    start: np.ndarray
    """Shape ``(tiles + 1,)``, int32: where each tile's list begins in ``surfels``."""
    surfels: np.ndarray
    """Shape ``(pairs,)``, int32: nearest centre first within a tile."""


class Tile(NamedTuple):
    """One tile, and the part of ``TileLists.surfels`` that is its list."""

    x: int
    """Its left-most column of pixels, as ``y`` is its upper-most row."""
    y: int
    first: np.int64
    """Where the list begins."""
    past: np.int64
    """Where it has ended."""


def tile_lists(bounds: np.ndarray, depths: np.ndarray, width: int, height: int) -> TileLists:
    """Sort surfels by depth (equals as they come) and hand them to the tiles that their bounds touch.

    Depths count as equal when they differ by less than 2^-36 of the range.

    Args:
        bounds: shape ``(N, 4)``, int32, pixels, ends excluded; empty ones are left out.
        depths: shape ``(N,)``, float64, of the centres, positive where the bounds are not empty.
        width: of the image, pixels.
        height: of the image, pixels.
    """
    columns, rows = -(-width // TILE), -(-height // TILE)
    order = _nearest_first(bounds, depths)
    bands = min(get_num_threads(), rows)
    counts = np.empty(columns * rows, np.int32)
    _count(bands, order, bounds, columns, rows, counts)
    start = np.zeros(counts.size + 1, np.int32)
    np.cumsum(counts, out=start[1:])
    surfels = np.empty(start[-1], np.int32)
    _fill(bands, order, bounds, columns, rows, start, surfels)
    return TileLists(start, surfels)


def tiles_touched(bounds: np.ndarray) -> np.ndarray:
    """Where each surfel's pairs begin if they are counted surfel by surfel, shape ``(N + 1,)``, int64."""
    slots = np.empty(len(bounds) + 1, np.int64)
    _running_areas(bounds, slots)
    return slots


@njit(**INLINED)
def tile_of(number, columns, start):
    """Return so manyth ``Tile`` of an image that is so many tiles wide."""
    first, past = np.int64(start[number]), np.int64(start[number + 1])
    return Tile(number % columns * TILE, number // columns * TILE, first, past)


@njit(**INLINED)
def past_tile(pixel):
    """The first tile that begins at or after a pixel."""
    return (pixel + TILE - 1) // TILE


@njit(cache=True)
def _running_areas(bounds, slots):
    """Sum up tiles."""
    slots[0] = 0
    for surfel in range(len(bounds)):
        left, right, top, bottom = bounds[surfel]
        tiles = (past_tile(right) - left // TILE) * (past_tile(bottom) - top // TILE)
        slots[surfel + 1] = slots[surfel] + (tiles if right > left else 0)


@njit(**UNWRAPPED)
def _keys(bounds, depths):
    """The surfels that are seen, each with the leading bits of its depth above its index, unsorted.

    Positive floats sort as the integers that their bits are.
    """
    bits, keys = depths.view(np.uint64), np.empty(len(depths), np.uint64)
    least, most, seen = np.uint64(2**63), np.uint64(0), 0
    for surfel in range(len(depths)):
        if bounds[surfel, 1] > bounds[surfel, 0]:
            keys[seen] = surfel
            seen += 1
            least, most = min(least, bits[surfel]), max(most, bits[surfel])
    spread, shift = most - least, np.uint64(0)
    while seen > 0 and spread >> shift >= np.uint64(2 ** (64 - INDEX_BITS)):
        shift += np.uint64(1)
    for place in range(seen):
        depth = (bits[keys[place]] - least) >> shift
        keys[place] |= depth << np.uint64(INDEX_BITS)
    return keys[:seen]


@njit(**UNWRAPPED)
def _sort(keys):
    """Sort by all bits above ``INDEX_BITS``, least significant first; equals stay as they are."""
    piles, mask = 2**PASS_BITS, np.uint64(2**PASS_BITS - 1)
    passes = (64 - INDEX_BITS) // PASS_BITS
    counts = np.zeros((passes, piles), np.int32)
    for key in keys:
        for digit in range(passes):
            counts[digit, (key >> np.uint64(INDEX_BITS + digit * PASS_BITS)) & mask] += 1
    other = np.empty_like(keys)
    for digit in range(passes):
        position = 0
        for pile in range(piles):
            position, counts[digit, pile] = position + counts[digit, pile], position
        shift = np.uint64(INDEX_BITS + digit * PASS_BITS)
        for key in keys:
            pile = (key >> shift) & mask
            other[counts[digit, pile]] = key
            counts[digit, pile] += 1
        keys, other = other, keys
    return keys


@njit(cache=True)
def _nearest_first(bounds, depths):
    """Indices of the surfels that are seen, int32, by depth."""
    keys = _sort(_keys(bounds, depths))
    order, mask = np.empty(len(keys), np.int32), np.uint64(2**INDEX_BITS - 1)
    for place in range(len(keys)):
        order[place] = keys[place] & mask
    return order


@njit(**UNWRAPPED)
def _count_band(band, bands, order, bounds, columns, rows, counts):
    """Count the surfels of each tile of a band of rows of tiles."""
    first, past = share(band, bands, rows)
    counts[first * columns : past * columns] = 0
    for surfel in order:
        left, right = bounds[surfel, 0] // TILE, past_tile(bounds[surfel, 1])
        top, bottom = max(bounds[surfel, 2] // TILE, first), min(past_tile(bounds[surfel, 3]), past)
        for row in range(top, bottom):
            for column in range(left, right):
                counts[row * columns + column] += 1


@njit(**UNWRAPPED)
def _fill_band(band, bands, order, bounds, columns, rows, start, surfels):
    """Write the lists of a band of rows of tiles, in the order that is given."""
    first, past = share(band, bands, rows)
    position = start[:-1].copy()
    for surfel in order:
        left, right = bounds[surfel, 0] // TILE, past_tile(bounds[surfel, 1])
        top, bottom = max(bounds[surfel, 2] // TILE, first), min(past_tile(bounds[surfel, 3]), past)
        for row in range(top, bottom):
            for column in range(left, right):
                surfels[position[row * columns + column]] = surfel
                position[row * columns + column] += 1


@njit(cache=True)
def _count(bands, *given):
    """Count the surfels of each tile; the rest is given as to ``_count_band``."""
    run_in(task(_count_band, given), bands)


@njit(cache=True)
def _fill(bands, *given):
    """Write the lists of all tiles; the rest is given as to ``_fill_band``."""
    run_in(task(_fill_band, given), bands)
