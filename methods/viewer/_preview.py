# SPDX-License-Identifier: Apache-2.0
"""Layers as pictures of eight bits, to be looked at and not measured."""

import numpy as np

from graycard import find_layer
from graycard.colour import srgb_encode

LIGHT = ("radiance", "irradiance", "direct", "indirect", "shading", "counterfactual", "visibility")
"""First words of the names of layers without an upper bound."""
BRIGHT = 99
"""Percentile that becomes white where there is no bound."""


def preview(layer: str, values: np.ndarray, white: float | None = None) -> np.ndarray:
    """Return a layer as a picture, uint8 ``(H, W, 3)``.

    Normals as x, y, z from -1 to 1; depths from near (white) to far; light and reflectance by the sRGB curve;
    anything else from 0 to 1 as it is.

    Args:
        layer: Its name.
        values: shape ``(H, W)`` or ``(H, W, 3)``.
        white: Value that becomes white, in light and depth; None takes one from the picture.
    """
    values = np.asarray(values, dtype=np.float64)
    if layer == "normal":
        return _bytes(0.5 + 0.5 * values)
    if layer in ("depth", "distance"):
        return _bytes(_nearness(values, white))
    if layer.partition(".")[0] in LIGHT:
        return _bytes(srgb_encode(values / (white or brightest(values))))
    return _bytes(srgb_encode(values) if len(find_layer(layer).channels) == 3 else values)


def _bytes(values: np.ndarray) -> np.ndarray:
    finite = np.nan_to_num(np.clip(values, 0, 1), nan=0.0)
    wide = finite if finite.ndim == 3 else np.repeat(finite[:, :, None], 3, axis=2)
    return np.rint(255 * wide).astype(np.uint8)


def brightest(values: np.ndarray) -> float:
    """Return the value that becomes white where there is no bound, above 0."""
    finite = values[np.isfinite(values)]
    return max(float(np.percentile(finite, BRIGHT)) if finite.size else 1.0, 1e-9)


def _nearness(depth: np.ndarray, far: float | None) -> np.ndarray:
    """1 in the camera, 0 at the furthest and where nothing is."""
    most = far or brightest(depth)
    return np.where(np.isfinite(depth), 1 - depth / most, 0.0)
