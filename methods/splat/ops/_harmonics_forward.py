# SPDX-License-Identifier: Apache-2.0
"""The kernel of spherical harmonics; numbers in between are double, which costs a scalar loop nothing."""

from typing import Any

import numpy as np

from graycard.methods._numba import njit
from graycard.methods.splat.ops._harmonics_basis import harmonics
from graycard.methods.splat.simd._parts import UNWRAPPED, run, share, task

_basis = njit(harmonics, **UNWRAPPED)


@njit(**UNWRAPPED)
def direction(centres: np.ndarray, surfel: int, eye: np.ndarray) -> tuple[float, float, float, float]:
    """Return unit vector from the eye to a centre, and one over their distance; zeros if they coincide."""
    x, y, z = centres[surfel, 0] - eye[0], centres[surfel, 1] - eye[1], centres[surfel, 2] - eye[2]
    square = x * x + y * y + z * z
    inverse = 1 / np.sqrt(square) if square > 0 else 0.0
    return x * inverse, y * inverse, z * inverse, inverse


@njit(**UNWRAPPED)
def colours_forward_part(
    part: int,
    parts: int,
    coefficients: np.ndarray,
    centres: np.ndarray,
    eye: np.ndarray,
    used: int,
    colours: np.ndarray,
) -> None:
    """Write the colours of ``(N, 3)`` from coefficients ``(N, K, 3)``, of which ``used`` are looked at."""
    start, stop = share(part, parts, len(centres))
    for i in range(start, stop):
        x, y, z, _ = direction(centres, i, eye)
        basis = _basis(x, y, z)
        red, green, blue = 0.0, 0.0, 0.0
        for k in range(used):
            red += basis[k] * coefficients[i, k, 0]
            green += basis[k] * coefficients[i, k, 1]
            blue += basis[k] * coefficients[i, k, 2]
        colours[i, 0], colours[i, 1], colours[i, 2] = red, green, blue


@njit(cache=True)
def colours_forward(*given: Any) -> None:
    """Write the colours; the arguments are those of ``colours_forward_part`` after its parts."""
    run(task(colours_forward_part, given))
