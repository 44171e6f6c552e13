# SPDX-License-Identifier: Apache-2.0
"""Two perceptually uniform colour maps: equal steps of a value look like equal steps of colour.

A few anchors in CIELAB, lightness rising throughout and all inside the sRGB gamut, joined by a smooth
curve and cut into pieces of equal colour difference (CIE 1976 ΔE*ab).
"""

from functools import cache
from typing import Literal

import numpy as np
from scipy.interpolate import PchipInterpolator
from skimage.color import lab2rgb

STEPS = 255
"""Colours in a map; the 256th index of a PNG palette is left for "no value"."""

ColourMap = Literal["error", "depth"]
COLOUR_MAPS: tuple[ColourMap, ...] = ("error", "depth")

_ANCHORS: dict[ColourMap, tuple[tuple[float, float, float], ...]] = {
    "error": ((1, 0, 0), (22, 30, -29), (41, 53, 9), (65, 47, 41), (80, 1, 47), (95, -14, 32)),
    "depth": ((18, 12, -30), (43, -10, -26), (67, -39, 0), (86, -4, 62)),
}


@cache
def colour_map(name: ColourMap) -> np.ndarray:
    """Return the colours of a map, shape ``(STEPS, 3)``, uint8, sRGB display values."""
    anchors = np.array(_ANCHORS[name], dtype=np.float64)
    curve = PchipInterpolator(_travelled(anchors), anchors)  # monotone: it overshoots no anchor
    fine = curve(np.linspace(0, _travelled(anchors)[-1], 1001))
    even = np.linspace(0, _travelled(fine)[-1], STEPS)
    lab = np.stack([np.interp(even, _travelled(fine), fine[:, i]) for i in range(3)], axis=-1)
    return np.rint(255 * lab2rgb(lab[None])[0]).astype(np.uint8)


def to_index(values: np.ndarray, low: float, high: float) -> np.ndarray:
    """Return where values lie in a map from ``low`` to ``high``, any shape, uint8; ``STEPS`` where NaN.

    What lies outside, infinities too, takes the colour of the end.
    """
    nothing = np.isnan(values)
    share = (np.clip(np.where(nothing, low, values), low, high) - low) / max(high - low, 1e-30)
    return np.where(nothing, STEPS, np.rint(share * (STEPS - 1))).astype(np.uint8)


def _travelled(points: np.ndarray) -> np.ndarray:
    """Length of the way to each of some points, shape ``(N, 3)`` to ``(N,)``."""
    return np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
