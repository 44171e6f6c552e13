# SPDX-License-Identifier: Apache-2.0
"""The sixteen real spherical harmonics up to degree three, and their slopes, as polynomials.

Order and signs are those of 3D Gaussian Splatting, whose files viewers read: m runs from -l to l, and
odd m have the sign of Condon and Shortley. The factors are the usual ones that make the functions
orthonormal on the sphere (e.g. Sloan 2008, "Stupid Spherical Harmonics Tricks", appendix A2).

The functions take numbers or arrays, and are compiled into the kernels as they stand.
"""

from math import pi, sqrt
from typing import Any

MAX_DEGREE = 3

_C0 = sqrt(1 / (4 * pi))
_C1 = sqrt(3 / (4 * pi))
_C2_XY = sqrt(15 / (4 * pi))
_C2_ZZ = sqrt(5 / (16 * pi))
_C2_XX = sqrt(15 / (16 * pi))
_C3_3 = sqrt(35 / (32 * pi))
_C3_XYZ = sqrt(105 / (4 * pi))
_C3_1 = sqrt(21 / (32 * pi))
_C3_0 = sqrt(7 / (16 * pi))
_C3_2 = sqrt(105 / (16 * pi))


def harmonics(x: Any, y: Any, z: Any) -> tuple[Any, ...]:
    """Values at a unit vector, degree by degree."""
    return (
        _C0,
        -_C1 * y,
        _C1 * z,
        -_C1 * x,
        _C2_XY * x * y,
        -_C2_XY * y * z,
        _C2_ZZ * (2 * z * z - x * x - y * y),
        -_C2_XY * x * z,
        _C2_XX * (x * x - y * y),
        -_C3_3 * y * (3 * x * x - y * y),
        _C3_XYZ * x * y * z,
        -_C3_1 * y * (4 * z * z - x * x - y * y),
        _C3_0 * z * (2 * z * z - 3 * x * x - 3 * y * y),
        -_C3_1 * x * (4 * z * z - x * x - y * y),
        _C3_2 * z * (x * x - y * y),
        -_C3_3 * x * (x * x - 3 * y * y),
    )


def slopes_x(x: Any, y: Any, z: Any) -> tuple[Any, ...]:
    """Return derivatives of the polynomials with respect to x."""
    return (
        0.0,
        0.0,
        0.0,
        -_C1,
        _C2_XY * y,
        0.0,
        -2 * _C2_ZZ * x,
        -_C2_XY * z,
        2 * _C2_XX * x,
        -6 * _C3_3 * x * y,
        _C3_XYZ * y * z,
        2 * _C3_1 * x * y,
        -6 * _C3_0 * x * z,
        -_C3_1 * (4 * z * z - 3 * x * x - y * y),
        2 * _C3_2 * x * z,
        -3 * _C3_3 * (x * x - y * y),
    )


def slopes_y(x: Any, y: Any, z: Any) -> tuple[Any, ...]:
    """Return derivatives of the polynomials with respect to y."""
    return (
        0.0,
        -_C1,
        0.0,
        0.0,
        _C2_XY * x,
        -_C2_XY * z,
        -2 * _C2_ZZ * y,
        0.0,
        -2 * _C2_XX * y,
        -3 * _C3_3 * (x * x - y * y),
        _C3_XYZ * x * z,
        -_C3_1 * (4 * z * z - x * x - 3 * y * y),
        -6 * _C3_0 * y * z,
        2 * _C3_1 * x * y,
        -2 * _C3_2 * y * z,
        6 * _C3_3 * x * y,
    )


def slopes_z(x: Any, y: Any, z: Any) -> tuple[Any, ...]:
    """Return derivatives of the polynomials with respect to z."""
    return (
        0.0,
        0.0,
        _C1,
        0.0,
        0.0,
        -_C2_XY * y,
        4 * _C2_ZZ * z,
        -_C2_XY * x,
        0.0,
        0.0,
        _C3_XYZ * x * y,
        -8 * _C3_1 * y * z,
        _C3_0 * (6 * z * z - 3 * x * x - 3 * y * y),
        -8 * _C3_1 * x * z,
        _C3_2 * (x * x - y * y),
        0.0,
    )
