# SPDX-License-Identifier: Apache-2.0
"""Primaries of colours in files, as the chromaticities x and y of red, green, blue and white."""

from collections.abc import Sequence

REC709 = (0.64, 0.33, 0.30, 0.60, 0.15, 0.06, 0.3127, 0.3290)
"""Chromaticities of the primaries and of the white point D65 (ITU-R BT.709-6)."""
DISPLAY_P3 = (0.680, 0.320, 0.265, 0.690, 0.150, 0.060, 0.3127, 0.3290)
"""Primaries of SMPTE RP 431-2 with the white point D65 (SMPTE EG 432-1)."""
REC2020 = (0.708, 0.292, 0.170, 0.797, 0.131, 0.046, 0.3127, 0.3290)
"""ITU-R BT.2020-2."""

_NAMES = {
    REC709: "Rec.709",
    DISPLAY_P3: "Display P3",
    REC2020: "Rec.2020",
    (0.7347, 0.2653, 0.0, 1.0, 0.0001, -0.077, 0.32168, 0.33767): "ACES AP0",
    (0.713, 0.293, 0.165, 0.830, 0.128, 0.044, 0.32168, 0.33767): "ACES AP1 (ACEScg)",
    (0.64, 0.33, 0.21, 0.71, 0.15, 0.06, 0.3127, 0.3290): "Adobe RGB (1998)",
    (0.680, 0.320, 0.265, 0.690, 0.150, 0.060, 0.314, 0.351): "DCI-P3",
}
_ROUNDED = 1e-3
"""Difference up to which chromaticities are the same: files round them to three digits."""


def name_primaries(chromaticities: Sequence[float]) -> str:
    """Return the name of primaries with their white point, or their numbers."""
    for known, name in _NAMES.items():
        if _are_alike(known, chromaticities):
            return name
    return "primaries " + ", ".join(f"{x:.4g}" for x in chromaticities)


def are_rec709(chromaticities: Sequence[float]) -> bool:
    """Tell whether primaries are those of Rec.709, up to rounding."""
    return _are_alike(REC709, chromaticities)


def _are_alike(one: Sequence[float], other: Sequence[float]) -> bool:
    return len(one) == len(other) and all(
        abs(a - b) <= _ROUNDED for a, b in zip(one, other, strict=True)
    )  # NaN is like nothing
