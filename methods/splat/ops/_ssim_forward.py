# SPDX-License-Identifier: Apache-2.0
"""The forward kernel of the photometric losses: absolute difference and SSIM in one sweep.

With ``d = x - y`` SSIM is ``(1 - a) (1 - b)``, ``a = mean(d)^2 / (mean(x)^2 + mean(y)^2 + C1)`` and
``b = var(d) / (var(x) + var(y) + C2)``: the usual fraction, but equal images give one to the last bit,
and what is missing to one keeps its digits.

All deviations are taken from the window's middle, first down a column and then along the row of columns,
whose own variances add up with that of their means: ``mean(x^2) - mean(x)^2`` would lose all digits on a
bright wall, where it matters.

Rows lie flat, channels last: a step of one column is a step of ``channels`` floats, whatever their number.
"""

import numpy as np

from graycard.methods._numba import njit
from graycard.methods.splat.simd import _vector as simd
from graycard.methods.splat.simd._parts import BORROWING, INLINED, UNWRAPPED, run, share, task

LANES = simd.LANES
REACH = 5
"""Pixels from the middle of the window to its rim."""
WINDOW = 2 * REACH + 1
SIGMA = 1.5
"""Standard deviation of the Gaussian window, pixels."""
C1, C2 = 0.01**2, 0.03**2
"""Constants of SSIM, for values in [0, 1]."""
BAND = 8
"""Rows that a thread takes at a time."""
SAVED = 5
"""Lines a row that the backward kernel reads."""


def window() -> np.ndarray:
    """Return the Gaussian along one axis, float32, shape ``(WINDOW,)``, with the sum one."""
    weights = np.exp(-0.5 * (np.arange(-REACH, REACH + 1) / SIGMA) ** 2)
    return (weights / weights.sum()).astype(np.float32)


WEIGHTS = window()


@njit(**INLINED, **BORROWING)
def last_start(at, length):
    """Return where the sixteen floats from ``at`` begin: the last ones of a line overlap those before
    them.
    """
    return min(at, length - LANES)


@njit(**INLINED, **BORROWING)
def rows_beyond(first, past):
    """Weight of the window's rows that lie beyond the image, in all lanes."""
    if past - first == WINDOW:
        return simd.broadcast(0.0)
    beyond = np.float32(1)
    for tap in range(first, past):
        beyond -= WEIGHTS[tap]
    return simd.broadcast(beyond)


@njit(**INLINED, **BORROWING)
def column_statistics(image, target, begin, length, first, past):
    """Means of x and d, variances of x plus y and of d, down sixteen columns.

    ``begin`` is a place in the window's first row; the taps from ``first`` to before ``past`` lie in the
    image, beyond which all is zero.
    """
    middle, beyond = begin + REACH * length, rows_beyond(first, past)
    middle_x = simd.load(image, middle)
    middle_d = middle_x - simd.load(target, middle)
    middle_y = middle_x - middle_d
    more_x, more_d = simd.broadcast(0.0) - beyond * middle_x, simd.broadcast(0.0) - beyond * middle_d
    both = beyond * simd.fma(middle_x, middle_x, middle_y * middle_y)
    difference = beyond * middle_d * middle_d
    for tap in range(first, past):
        weight, x = simd.load_scalar(WEIGHTS, tap), simd.load(image, begin + tap * length)
        d = x - simd.load(target, begin + tap * length) - middle_d
        x = x - middle_x
        y = x - d
        more_x, more_d = simd.fma(weight, x, more_x), simd.fma(weight, d, more_d)
        both = simd.fma(weight, simd.fma(x, x, y * y), both)
        difference = simd.fma(weight, d * d, difference)
    more_y = more_x - more_d
    both = both - simd.fma(more_x, more_x, more_y * more_y)
    return middle_x + more_x, middle_d + more_d, both, simd.fnma(more_d, more_d, difference)


@njit(**INLINED, **BORROWING)
def row_statistics(lines, stride, at, channels):
    """Return the same over the windows around sixteen places.

    ``lines`` are those of the columns, each ``stride`` floats long, the windows' first column at ``at``.
    """
    middle = at + REACH * channels
    middle_x, middle_d = simd.load(lines, middle), simd.load(lines, middle + stride)
    more_x, more_d = simd.broadcast(0.0), simd.broadcast(0.0)
    both, difference = simd.broadcast(0.0), simd.broadcast(0.0)
    for tap in range(WINDOW):
        weight, place = simd.load_scalar(WEIGHTS, tap), at + tap * channels
        x, d = simd.load(lines, place) - middle_x, simd.load(lines, place + stride) - middle_d
        y = x - d
        more_x, more_d = simd.fma(weight, x, more_x), simd.fma(weight, d, more_d)
        squares = simd.fma(x, x, simd.fma(y, y, simd.load(lines, place + 2 * stride)))
        both = simd.fma(weight, squares, both)
        squares = simd.fma(d, d, simd.load(lines, place + 3 * stride))
        difference = simd.fma(weight, squares, difference)
    more_y = more_x - more_d
    both = both - simd.fma(more_x, more_x, more_y * more_y)
    return middle_x + more_x, middle_d + more_d, both, simd.fnma(more_d, more_d, difference)


@njit(**INLINED, **BORROWING)
def dissimilarity(statistics, saved, at, length, keep):
    """1 - SSIM from the statistics of windows; keeps what the backward kernel needs.

    That is: means of x and d; the derivatives of 1 - SSIM by the mean of x, by half the variance of d, and,
    its sign turned, by half that of x.
    """
    mean_x, mean_d, both, difference = statistics
    one, two = simd.broadcast(1.0), simd.broadcast(2.0)
    mean_y = mean_x - mean_d
    over_means = one / simd.fma(mean_x, mean_x, simd.fma(mean_y, mean_y, simd.broadcast(C1)))
    over_both = one / (both + simd.broadcast(C2))
    a, b = mean_d * mean_d * over_means, difference * over_both
    if keep:
        by_difference = two * (one - a) * over_both
        simd.store(saved, at, mean_x)
        simd.store(saved, at + length, mean_d)
        by_mean = two * (one - b) * over_means * simd.fnma(mean_x, a, mean_d)
        simd.store(saved, at + 2 * length, by_mean)
        simd.store(saved, at + 3 * length, by_difference)
        simd.store(saved, at + 4 * length, by_difference * b)
    return simd.fnma(a, b, a + b)


@njit(**UNWRAPPED)
def ssim_forward_part(part, parts, pictures, terms, values, saved):
    """Write ``base + absolute * |x - y| + dissimilar * (1 - SSIM)`` at every pixel and channel.

    Args:
        part: which of the
        parts: that work at a time.
        pictures: a ``_losses._Pictures``.
        terms: float32 ``(3,)``: base, absolute, dissimilar.
        values: float32, flat, to be written.
        saved: float32, flat, ``SAVED`` lines a row, to be written; empty if no gradient is wanted.
    """
    image, target, height, length, channels = pictures
    stride = length + 2 * REACH * channels
    start, stop = share(part, parts, (height + BAND - 1) // BAND)
    for band in range(start, stop):
        lines = np.zeros(4 * stride, np.float32)
        for row in range(band * BAND, min(band * BAND + BAND, height)):
            first, past = max(REACH - row, 0), min(WINDOW, height + REACH - row)
            for place in range(0, length, LANES):
                at = last_start(place, length)
                begin = (row - REACH) * length + at
                columns = column_statistics(image, target, begin, length, first, past)
                mean_x, mean_d, both, difference = columns
                middle = REACH * channels + at
                simd.store(lines, middle, mean_x)
                simd.store(lines, middle + stride, mean_d)
                simd.store(lines, middle + 2 * stride, both)
                simd.store(lines, middle + 3 * stride, difference)
            for place in range(0, length, LANES):
                at = last_start(place, length)
                statistics = row_statistics(lines, stride, at, channels)
                keep_at = row * SAVED * length + at
                lack = dissimilarity(statistics, saved, keep_at, length, saved.size > 0)
                d = simd.load(image, row * length + at) - simd.load(target, row * length + at)
                distance = simd.maximum(d, simd.broadcast(0.0) - d)
                value = simd.fma(simd.load_scalar(terms, 1), distance, simd.load_scalar(terms, 0))
                value = simd.fma(simd.load_scalar(terms, 2), lack, value)
                simd.store(values, row * length + at, value)


@njit(cache=True)
def ssim_forward(*given):
    """Compare images; the arguments are those of ``ssim_forward_part`` after its parts."""
    run(task(ssim_forward_part, given))
