# SPDX-License-Identifier: Apache-2.0
"""Blocks, shared by both kernels: tiles of sixteen blocks of 4 x 4 pixels, each one vector, and alpha
there.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
from numba import types
from numba.extending import overload

from graycard.methods._numba import njit
from graycard.methods.splat._maps import ALPHA_MIN, NEAR, TRANSMITTANCE_MIN
from graycard.methods.splat.raster._coefficients import (
    CENTRE_Z,
    HEIGHT,
    LOG2_E,
    LOG_OPACITY,
    REST,
    WHOLE,
    D,
    U,
    V,
)
from graycard.methods.splat.simd import _vector as simd
from graycard.methods.splat.simd import _words as words
from graycard.methods.splat.simd._parts import INLINED, UNWRAPPED

LANES = simd.LANES
BLOCK = 4
"""Pixels on the side of a block."""
BLOCKS = 16
"""Index of a tile, row-major."""
PIXELS = BLOCKS * LANES
GROUP = 16
"""Channels that are summed at a time."""
SIXTEEN = (0,) * GROUP
ONE, NORMAL, MOMENTS = (0,), (0,) * 3, (0,) * 4
"""Templates: one vector, the three of a normal, and the sums of w, w z, w / z and w / z^2."""
CENTRED = (0,) * 5
"""Gradients of depth and distortion: a constant, by z and by the square of 1/z, less their means; the
means."""
SHAPE_SUMS = 7
"""Sums beside those of the channels: three of the normal, then the moments."""
HUGE = 1e30
"""An exponent at which nothing is left."""
TINY = 1e-30
"""Denominators of discs that are met behind the camera, or nowhere, count as this."""
LOG_ALPHA_MIN = float(np.log2(ALPHA_MIN))


@njit(**INLINED)
def aligned(count):
    """So many floats, zero, from the start of a line of the cache: a vector never lies across two."""
    room = np.zeros(count + LANES, np.float32)
    first = (-room.ctypes.data % 64) // 4
    return room[first : first + count]


@njit(**UNWRAPPED)
def lane_positions():
    """Pixel centres from the tile's corner: 4 vectors of x by block column, 4 of y by block row."""
    positions = aligned(8 * LANES)
    for block in range(4):
        for lane in range(LANES):
            positions[block * LANES + lane] = block * BLOCK + lane % BLOCK + 0.5
            positions[(4 + block) * LANES + lane] = block * BLOCK + lane // BLOCK + 0.5
    return positions


@njit(**INLINED)
def centre_in_tile(rows, at, axis, corner):
    """Coordinate of the anchor from the tile's corner."""
    return (rows[at + WHOLE + axis] - np.float32(corner)) + rows[at + REST + axis]


@njit(**INLINED)
def linear_form(rows, at, x, y):
    """Value of one linear form at sixteen pixels."""
    across = simd.fma(simd.load_scalar(rows, at + 1), y, simd.load_scalar(rows, at + 2))
    return simd.fma(simd.load_scalar(rows, at), x, across)


@njit(**INLINED)
def meet(rows, at, x, y):
    """Return where sixteen rays meet a disc.

    Returns:
        u, v, reciprocal of the denominator, and the exponents (positive) of disc and low-pass.
    """
    below = simd.maximum(linear_form(rows, at + D, x, y), simd.broadcast(TINY))
    over = simd.broadcast(1.0) / below
    u = linear_form(rows, at + U, x, y) * over
    v = linear_form(rows, at + V, x, y) * over
    in_front = simd.load_scalar(rows, at + HEIGHT)
    disc = simd.where_at_least(in_front, below, simd.fma(u, u, v * v), simd.broadcast(HUGE))
    return u, v, over, disc, simd.fma(x, x, y * y)


@njit(**INLINED)
def exponent_of(rows, at, disc, low_pass):
    """Logarithm to base two of opacity times the larger Gaussian; the low-pass where the disc's is NaN."""
    less = simd.minimum(disc, low_pass)
    return simd.fnma(simd.broadcast(LOG2_E), less, simd.load_scalar(rows, at + LOG_OPACITY))


@njit(**INLINED)
def where_drawn(exponent, before, values):
    """Values where alpha and the transmittance before it are large enough, zero elsewhere."""
    zero = simd.broadcast(0.0)
    passing = simd.where_less(simd.broadcast(TRANSMITTANCE_MIN), before, values, zero)
    return simd.where_at_least(exponent, simd.broadcast(LOG_ALPHA_MIN), passing, zero)


@njit(**INLINED)
def depth_at(rows, at, met):
    """Weights of the disc's plane, or of the centre where the low-pass is the larger Gaussian; and of the
    plane.
    """
    z = simd.load_scalar(rows, at + HEIGHT) * simd.broadcast(NEAR) * met[2]
    return simd.where_at_least(met[4], met[3], z, simd.load_scalar(rows, at + CENTRE_Z)), z


@njit(**INLINED)
def block_columns(low, high, corner):
    """Blocks of a tile, from and to, that pixels from ``low`` to before ``high`` touch."""
    return max(low - corner, 0) // BLOCK, (min(high - corner, BLOCK * 4) + BLOCK - 1) // BLOCK


@njit(**INLINED)
def next_bit(bits):
    """Return the place of the lowest bit, and the bits without it."""
    return words.lowest_bit(bits), bits & (bits - np.uint64(1))


@njit(**INLINED)
def pixel_of(block, lane):
    """Row and column in the tile."""
    return block // 4 * BLOCK + lane // BLOCK, block % 4 * BLOCK + lane % BLOCK


def where_given(make: Callable[[Any], Any]) -> Callable[[Any], Any]:
    """Return a function for kernels that makes the same, and None of None: the type decides."""

    def made(user: Any) -> Any:  # Python must not call it, see ``UNWRAPPED``
        raise TypeError(f"expected a call from a kernel, got one from Python with {user}")

    @overload(made)
    def _made(user):  # no type hints: Numba compares signatures, hints included
        if isinstance(user, types.NoneType):
            return lambda user: None
        return lambda user: make(user)

    return made


def either(user: Any, value: Any, other: Any) -> Any:
    """Return a value if there is a user, else another; for kernels, as above."""
    return other if user is None else value


@overload(either)
def _either(user, value, other):  # no type hints, as above
    if isinstance(user, types.NoneType):
        return lambda user, value, other: other
    return lambda user, value, other: value
