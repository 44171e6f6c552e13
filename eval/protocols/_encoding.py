# SPDX-License-Identifier: Apache-2.0
"""Files that images went through, and spaces in which they are compared."""

from collections.abc import Callable, Mapping
from typing import Literal

import numpy as np

from graycard import srgb_decode, srgb_encode

Storage = Literal["float", "8 bits", "8 bits, sRGB", "8 bits, gamma 2.2", "8 bits, gamma 2.2, rounded down"]
"""Formats in which a script's files hold a linear image; 8-bit files cut it to [0, 1]."""
Space = Literal["linear", "sRGB", "gamma 2.2"]
GAMMA = 2.2
"""Exponent of displays as many scripts have it, in place of sRGB."""


def _as_float(values: np.ndarray) -> np.ndarray:
    return values


def _in_8_bits(values: np.ndarray) -> np.ndarray:
    return np.round(np.clip(values, 0, 1) * 255) / 255


def _in_8_bits_of_srgb(values: np.ndarray) -> np.ndarray:
    return srgb_decode(_in_8_bits(srgb_encode(values)))


def _in_8_bits_of_gamma(values: np.ndarray) -> np.ndarray:
    return _in_8_bits(_gamma(values)) ** GAMMA


def _in_8_bits_of_gamma_rounded_down(values: np.ndarray) -> np.ndarray:
    return (np.floor(np.clip(_gamma(values), 0, 1) * 255) / 255) ** GAMMA


def _gamma(values: np.ndarray) -> np.ndarray:
    return np.maximum(values, 0) ** (1 / GAMMA)


STORED: Mapping[Storage, Callable[[np.ndarray], np.ndarray]] = {
    "float": _as_float,
    "8 bits": _in_8_bits,
    "8 bits, sRGB": _in_8_bits_of_srgb,
    "8 bits, gamma 2.2": _in_8_bits_of_gamma,
    "8 bits, gamma 2.2, rounded down": _in_8_bits_of_gamma_rounded_down,
}
"""From linear values to those that are linear again once the file is read."""
ENCODED: Mapping[Space, Callable[[np.ndarray], np.ndarray]] = {
    "linear": _as_float,
    "sRGB": srgb_encode,
    "gamma 2.2": _gamma,
}
"""From linear values to those that are compared."""
