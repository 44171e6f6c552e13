# SPDX-License-Identifier: Apache-2.0
"""Large arrays that are used again: new ones the system clears first, page by page, at every step."""

from collections import deque

import numpy as np

from graycard.methods.splat.raster._stage_arrays import Slots, rows_in, vectors

LEAST = 1 << 25
"""Bytes of the smallest array that is kept here; of smaller ones the C library keeps the memory itself."""
_idle: deque[np.ndarray] = deque(maxlen=2)
"""Arrays that wait, at most those of one backward pass; any thread may take them."""


def borrowed(count: int, width: int) -> np.ndarray:
    """Return rows as :func:`vectors` does, shape ``(count, width)``, in memory given back if they fit.

    Their numbers are not set: write each before it is read.
    """
    if count * width * 4 >= LEAST:
        try:
            return rows_in(_idle.popleft(), count, width)
        except (IndexError, ValueError):  # there are none, or those are too small and go
            pass
    return vectors(count, width)


def give_back(slots: Slots) -> None:
    """Let the arrays of slots be used again; nobody may read them any more."""
    for rows in (slots.geometry, slots.channels):
        room = None if rows is None or rows.nbytes < LEAST else rows.base
        if room is not None and not any(room is other for other in tuple(_idle)):
            _idle.append(room)


def forget() -> None:
    """Free the memory of arrays that wait."""
    _idle.clear()
