# SPDX-License-Identifier: Apache-2.0
"""Surfels are brought to the cache before they are needed.

The surfels of a tile lie anywhere in memory, as depth orders them, and 30,000 of them fill the nearest
caches: without this the kernels spend a third of their time waiting. What is asked for changes no result.
"""

from graycard.methods._numba import njit
from graycard.methods.splat.raster._coefficients import COLUMNS
from graycard.methods.splat.simd import _words as words
from graycard.methods.splat.simd._parts import BORROWING, INLINED

LINE = 16
"""Floats in a line of the cache."""


@njit(**INLINED, **BORROWING)
def fetch_values(values, surfel, count):
    """So many numbers a surfel, which may begin anywhere in a line."""
    first = surfel * count
    for at in range(first, first + count, LINE):
        words.prefetch(values, at)
    words.prefetch(values, first + count - 1)


@njit(**INLINED, **BORROWING)
def fetch_surfel(surfel, prepared, deep):
    """Ask for all that drawing reads of a surfel."""
    words.prefetch(prepared.rows, surfel * COLUMNS)
    words.prefetch(prepared.bounds, surfel * 4)
    fetch_values(prepared.features, surfel, prepared.channels)
    if deep is not None:
        fetch_values(deep.normals, surfel, 3)


@njit(**INLINED, **BORROWING)
def fetch_listed(listed, first, past, prepared, deep):
    """Ask for the surfels of a part of a list."""
    for pair in range(first, past):
        fetch_surfel(listed[pair], prepared, deep)
