# SPDX-License-Identifier: Apache-2.0
"""Colours that were measured or follow from physics, as linear Rec.709: paints, black bodies, daylight."""

import warnings
from functools import cache
from types import ModuleType
from typing import Any

import numpy as np

from graycard import luminance

Vector = tuple[float, float, float]

CHART_ROWS, CHART_COLUMNS = 4, 6


def chart_patches() -> dict[str, Vector]:
    """Reflectances of the 24 ColorChecker patches under D65, by name, row by row.

    Range: [0, 1], linear Rec.709 with a perfect white at (1, 1, 1); cyan lies outside the gamut and is
    clipped. Source: measured spectra "BabelColor Average" (Pascale 2006) in colour-science, integrated
    with the CIE 1931 2° observer.
    """
    return dict(_patches())


def paint(name: str) -> Vector:
    """Return the reflectance of one ColorChecker patch, as in ``"moderate red"``.

    Raises:
        ValueError: There is no such patch.
    """
    patches = chart_patches()
    if name not in patches:
        raise ValueError(f"expected a ColorChecker patch, got {name!r}: {', '.join(patches)}")
    return patches[name]


def blackbody(kelvin: float) -> Vector:
    """Colour of a black body at a temperature, linear Rec.709 of luminance 1 (Planck's law).

    Raises:
        ValueError: The temperature is not in [1000, 40000].
    """
    if not 1000 <= kelvin <= 40000:
        raise ValueError(f"expected a temperature of 1000 to 40000 K, got {kelvin}")
    return _unit_luminance(_rec709(_colour().sd_blackbody(kelvin)))


def illuminant(name: str) -> Vector:
    """Colour of a CIE illuminant, as in ``"D65"`` or ``"A"``; linear Rec.709 of luminance 1.

    Raises:
        ValueError: colour-science has no such illuminant.
    """
    known = _colour().SDS_ILLUMINANTS
    if name not in known:
        raise ValueError(f"expected a CIE illuminant, got {name!r}: {', '.join(known)}")
    return _unit_luminance(_rec709(known[name]))


def scaled(color: Vector, factor: float) -> Vector:
    """Return a colour times a factor."""
    return color[0] * factor, color[1] * factor, color[2] * factor


@cache
def _colour() -> ModuleType:
    """colour-science, imported late: it takes most of a second, and it warns about plotting."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        import colour
    return colour


@cache
def _patches() -> tuple[tuple[str, Vector], ...]:
    colour = _colour()
    spectra, white = colour.SDS_COLOURCHECKERS["BabelColor Average"], colour.SDS_ILLUMINANTS["D65"]
    return tuple((name.partition(" (")[0], _clip(_rec709(s, white))) for name, s in spectra.items())


def _rec709(spectrum: Any, white: Any = None) -> np.ndarray:
    """Linear Rec.709 of a reflectance under ``white``, or of a light by itself; shape ``(3,)``.

    A reflectance is integrated over the wavelengths at which it was measured; Y of ``white`` is 1.
    """
    colour = _colour()
    shape = spectrum.shape if white else colour.SpectralShape(380, 780, 5)
    observer = colour.MSDS_CMFS["CIE 1931 2 Degree Standard Observer"].copy().align(shape).values
    light = white.copy().align(shape).values if white else 1.0
    XYZ = (spectrum.copy().align(shape).values * light) @ observer
    norm = (light * observer[:, 1]).sum() if white else 1.0
    return colour.RGB_COLOURSPACES["ITU-R BT.709"].matrix_XYZ_to_RGB @ (XYZ / norm)


def _clip(rgb: np.ndarray) -> Vector:
    r, g, b = np.clip(rgb, 0, 1).tolist()
    return r, g, b


def _unit_luminance(rgb: np.ndarray) -> Vector:
    inside = np.maximum(rgb, 0)
    r, g, b = (inside / luminance(inside)).tolist()
    return r, g, b
