# SPDX-License-Identifier: Apache-2.0
"""The backward kernel of the photometric losses: each pixel gathers from the windows that it lies in.

The derivative of 1 - SSIM of the window around p by the value at q is, but for the window's weight, ``M_p +
K_p (d_q - mean(d)_p) - L_p (x_q - mean(x)_p)``. As in the forward kernel only values that lie near one
another are subtracted: a column gathers with respect to the means of its own middle, a row then with respect
to its pixel.
"""

import numpy as np

from graycard.methods._numba import njit
from graycard.methods.splat.ops._ssim_forward import BAND, LANES, REACH, SAVED, WEIGHTS, WINDOW, last_start
from graycard.methods.splat.simd import _vector as simd
from graycard.methods.splat.simd._parts import BORROWING, INLINED, UNWRAPPED, run, share, task


@njit(**INLINED, **BORROWING)
def column_gather(saved, upstream, row, at, length, first, past):
    """Return sums down sixteen columns: of K, of L, and of the rest, taken from the means in this row."""
    of_k, of_l, rest = simd.broadcast(0.0), simd.broadcast(0.0), simd.broadcast(0.0)
    here = row * SAVED * length + at
    mean_x, mean_d = simd.load(saved, here), simd.load(saved, here + length)
    for tap in range(first, past):
        there = row - REACH + tap
        weight = simd.load_scalar(WEIGHTS, tap) * simd.load(upstream, there * length + at)
        place = there * SAVED * length + at
        k, l = simd.load(saved, place + 3 * length), simd.load(saved, place + 4 * length)  # noqa: E741
        of_k, of_l = simd.fma(weight, k, of_k), simd.fma(weight, l, of_l)
        term = simd.fma(l, simd.load(saved, place) - mean_x, simd.load(saved, place + 2 * length))
        term = simd.fnma(k, simd.load(saved, place + length) - mean_d, term)
        rest = simd.fma(weight, term, rest)
    return of_k, of_l, rest, mean_x, mean_d


@njit(**INLINED, **BORROWING)
def row_gather(lines, stride, at, channels, x, d):
    """Return sums of the columns' sums over the windows around sixteen places, whose values are x and d."""
    total = simd.broadcast(0.0)
    for tap in range(WINDOW):
        place = at + tap * channels
        term = simd.load(lines, place + 2 * stride)
        term = simd.fma(simd.load(lines, place), d - simd.load(lines, place + 4 * stride), term)
        term = simd.fnma(simd.load(lines, place + stride), x - simd.load(lines, place + 3 * stride), term)
        total = simd.fma(simd.load_scalar(WEIGHTS, tap), term, total)
    return total


@njit(**INLINED, **BORROWING)
def sign(values):
    """-1, 0 or 1."""
    zero = simd.broadcast(0.0)
    below = simd.where_less(values, zero, simd.broadcast(-1.0), zero)
    return simd.where_less(zero, values, simd.broadcast(1.0), below)


@njit(**UNWRAPPED)
def ssim_backward_part(part, parts, pictures, terms, saved, upstream, to_image):
    """Gradient of the image; the first arguments are those of ``ssim_forward``.

    Args:
        part: which of the
        parts: that work at a time.
        pictures: as above.
        terms: as above.
        saved: what ``ssim_forward`` wrote.
        upstream: float32, flat, gradients of its values.
        to_image: float32, flat, to be written.
    """
    image, target, height, length, channels = pictures
    stride = length + 2 * REACH * channels
    start, stop = share(part, parts, (height + BAND - 1) // BAND)
    for band in range(start, stop):
        lines = np.zeros(5 * stride, np.float32)
        for row in range(band * BAND, min(band * BAND + BAND, height)):
            first, past = max(REACH - row, 0), min(WINDOW, height + REACH - row)
            for place in range(0, length, LANES):
                at = last_start(place, length)
                of_k, of_l, rest, mean_x, mean_d = column_gather(
                    saved, upstream, row, at, length, first, past
                )
                middle = REACH * channels + at
                simd.store(lines, middle, of_k)
                simd.store(lines, middle + stride, of_l)
                simd.store(lines, middle + 2 * stride, rest)
                simd.store(lines, middle + 3 * stride, mean_x)
                simd.store(lines, middle + 4 * stride, mean_d)
            for place in range(0, length, LANES):
                at = last_start(place, length)
                x = simd.load(image, row * length + at)
                d = x - simd.load(target, row * length + at)
                lack = row_gather(lines, stride, at, channels, x, d)
                distance = simd.load(upstream, row * length + at) * sign(d)
                gradient = simd.load_scalar(terms, 1) * distance
                gradient = simd.fma(simd.load_scalar(terms, 2), lack, gradient)
                simd.store(to_image, row * length + at, gradient)


@njit(cache=True)
def ssim_backward(*given):
    """Find the gradient of the image; the arguments are those of ``ssim_backward_part`` after its parts."""
    run(task(ssim_backward_part, given))
