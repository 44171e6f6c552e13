# SPDX-License-Identifier: Apache-2.0
"""Tile lists: which surfels touch which tile, nearest first."""

from typing import NamedTuple

import numpy as np
from numba import get_num_threads

from graycard.methods._numba import njit
from graycard.methods.splat.simd._parts import BORROWING, INLINED, UNWRAPPED, run_in, share, task

TILE = 16
"""Pixels on the side of a tile, which one thread draws at a time."""
INDEX_BITS = 28
"""Bits of a sorting key: the surfel. The depth has the rest."""
PASS_BITS = 12
"""Bits of the key, sorted at a time: as many piles fit the nearest cache."""


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
    """Start of the list."""
    past: np.int64
    """End of the list."""


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
    start = np.empty(columns * rows + 1, np.int32)
    _running_counts(bounds, columns, rows, start)
    surfels = np.empty(start[-1], np.int32)
    _fill(min(get_num_threads(), rows), order, bounds, columns, rows, start, surfels)
    return TileLists(start, surfels)


def tiles_touched(bounds: np.ndarray) -> np.ndarray:
    """Return where each surfel's pairs begin if they are counted surfel by surfel, shape ``(N + 1,)``,
    int64.
    """
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
    """Return the first tile that begins at or after a pixel."""
    return (pixel + TILE - 1) // TILE


@njit(**INLINED, **BORROWING)
def tiles_of(bounds, surfel):
    """Columns of tiles from and to (excluded), and rows, that a surfel touches; all zero if it does not."""
    left, right = bounds[surfel, 0] // TILE, past_tile(bounds[surfel, 1])
    return left, right, bounds[surfel, 2] // TILE, past_tile(bounds[surfel, 3])


@njit(cache=True)
def _running_counts(bounds, columns, rows, start):
    """Write where each tile's list begins.

    A surfel marks the four corners of its tiles. The sum of all marks above and to the left of a tile is the
    number of surfels that touch it: nothing need be done tile by tile for each of them.
    """
    marks, above = np.zeros((rows + 1, columns + 1), np.int32), np.zeros(columns, np.int32)
    for surfel in range(len(bounds)):
        left, right, top, bottom = tiles_of(bounds, surfel)
        marks[top, left] += 1
        marks[top, right] -= 1
        marks[bottom, left] -= 1
        marks[bottom, right] += 1
    start[0] = 0
    for row in range(rows):
        along = 0
        for column in range(columns):
            along += marks[row, column]
            above[column] += along
            tile = row * columns + column
            start[tile + 1] = start[tile] + above[column]


@njit(cache=True)
def _running_areas(bounds, slots):
    """Sum up tiles."""
    slots[0] = 0
    for surfel in range(len(bounds)):
        left, right, top, bottom = tiles_of(bounds, surfel)
        slots[surfel + 1] = slots[surfel] + (right - left) * (bottom - top)


@njit(**UNWRAPPED)
def _keys(bounds, depths):
    """Return the surfels that are seen, each with the leading bits of its depth above its index, unsorted.

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
    """Return indices of the surfels that are seen, int32, by depth."""
    keys = _sort(_keys(bounds, depths))
    order, mask = np.empty(len(keys), np.int32), np.uint64(2**INDEX_BITS - 1)
    for place in range(len(keys)):
        order[place] = keys[place] & mask
    return order


@njit(**UNWRAPPED)
def _fill_band(band, bands, order, bounds, columns, rows, start, surfels):
    """Write the lists of a band of rows of tiles, in the order that is given."""
    first, past = share(band, bands, rows)
    position = start[:-1].copy()
    for surfel in order:
        left, right, top, bottom = tiles_of(bounds, surfel)
        top, bottom = max(top, first), min(bottom, past)
        tile, across = top * columns + left, right - left
        column = left
        for _ in range(across * (bottom - top)):  # one loop, not two: where it ends is guessed wrong once
            surfels[position[tile]] = surfel
            position[tile] += 1
            column += 1
            is_last = column == right
            tile += columns - across + 1 if is_last else 1
            column = left if is_last else column


@njit(cache=True)
def _fill(bands, *given):
    """Write the lists of all tiles; the rest is given as to ``_fill_band``."""
    run_in(task(_fill_band, given), bands)
