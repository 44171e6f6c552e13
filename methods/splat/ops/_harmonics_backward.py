# SPDX-License-Identifier: Apache-2.0
"""The gradient of the kernel of spherical harmonics."""

from typing import Any

import numpy as np

from graycard.methods._numba import njit
from graycard.methods.splat.ops._harmonics_basis import harmonics, slopes_x, slopes_y, slopes_z
from graycard.methods.splat.ops._harmonics_forward import direction
from graycard.methods.splat.simd._parts import UNWRAPPED, run, share, task

_basis = njit(harmonics, **UNWRAPPED)
_slopes_x = njit(slopes_x, **UNWRAPPED)
_slopes_y = njit(slopes_y, **UNWRAPPED)
_slopes_z = njit(slopes_z, **UNWRAPPED)


@njit(**UNWRAPPED)
def colours_backward_part(
    part: int,
    parts: int,
    coefficients: np.ndarray,
    centres: np.ndarray,
    eye: np.ndarray,
    used: int,
    gradient: np.ndarray,
    to_coefficients: np.ndarray,
    to_centres: np.ndarray,
) -> None:
    """Write the gradients of the used coefficients and of the centres from that of the colours.

    A centre moves its direction d by ``(1 - d d^T) / distance``.
    """
    start, stop = share(part, parts, len(centres))
    for i in range(start, stop):
        x, y, z, inverse = direction(centres, i, eye)
        basis = _basis(x, y, z)
        by_x, by_y, by_z = _slopes_x(x, y, z), _slopes_y(x, y, z), _slopes_z(x, y, z)
        gx, gy, gz = 0.0, 0.0, 0.0
        for k in range(used):
            along = 0.0
            for channel in range(3):
                along += gradient[i, channel] * coefficients[i, k, channel]
                to_coefficients[i, k, channel] = basis[k] * gradient[i, channel]
            gx += along * by_x[k]
            gy += along * by_y[k]
            gz += along * by_z[k]
        radial = gx * x + gy * y + gz * z
        to_centres[i, 0] = (gx - radial * x) * inverse
        to_centres[i, 1] = (gy - radial * y) * inverse
        to_centres[i, 2] = (gz - radial * z) * inverse


@njit(cache=True)
def colours_backward(*given: Any) -> None:
    """Write the gradients; the arguments are those of ``colours_backward_part`` after its parts."""
    run(task(colours_backward_part, given))
