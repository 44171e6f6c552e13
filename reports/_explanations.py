# SPDX-License-Identifier: Apache-2.0
"""Explanations: which property of a scene an error follows: the true layer with the highest rank
correlation.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import grey_dilation
from scipy.stats import rankdata

from graycard import View, luminance

EXPLAINS = 0.6
"""Least absolute rank correlation that counts: below it no layer is named.

Smooth patterns correlate by chance. In a region of 42 x 42 pixels the best of 18 unrelated ones (white noise
blurred by a Gaussian of 3, 4 or 6 pixels) reaches 0.6 in 0, 4 and 33 of 100 cases.
"""
LEAST_PIXELS = 32
"""With fewer no correlation is computed."""

Layers = Mapping[str, np.ndarray]


@dataclass(frozen=True, slots=True)
class Explanation:
    """A property of the scene that an error rises or falls with."""

    name: str
    correlation: float
    """Spearman's, in [-1, 1]: positive where the error grows with the property."""
    values: np.ndarray
    """The property, shape ``(H, W)``."""


def explain(error: np.ndarray, properties: Layers, region: tuple[slice, slice]) -> Explanation | None:
    """Return the property that an error follows most closely in a region; None where all stay below the bar.

    Args:
        error: shape ``(H, W)``; NaN outside the mask.
        properties: Of the same shape, as from :func:`scene_properties`.
        region: Rows and columns that are looked at.
    """
    found = [
        Explanation(name, rank_correlation(error[region], values[region]), values)
        for name, values in properties.items()
    ]
    best = max(found, key=lambda e: abs(e.correlation), default=None)
    return best if best and abs(best.correlation) >= EXPLAINS else None


def rank_correlation(a: np.ndarray, b: np.ndarray) -> float:
    """Spearman's rank correlation over the pixels where both are finite; 0 where one does not vary.

    Ties share their mean rank, so that a mask of 0 and 1 may be one of the two.
    """
    both = np.isfinite(a) & np.isfinite(b)
    if both.sum() < LEAST_PIXELS:
        return 0.0
    p, q = (rankdata(x[both]) - (both.sum() + 1) / 2 for x in (a, b))
    spread = np.sqrt((p @ p) * (q @ q))
    return float(p @ q / spread) if spread > 0 else 0.0


def scene_properties(layers: Layers, view: View) -> dict[str, np.ndarray]:
    """Return what may explain an error in a view, by name, each of shape ``(H, W)``; only what the truth has.

    Edges are the largest step to a neighbouring pixel, widened by a pixel: an error at an edge lies on
    either side of it.

    Args:
        layers: The true layers of the view.
        view: Where it is seen from.
    """
    found = {name: make(layers[layer]) for name, (layer, make) in _SINGLE.items() if layer in layers}
    for name, stems in _SUMS.items():
        parts = [luminance(v) for n, v in layers.items() if n.startswith(stems)]
        if parts:
            found[name] = np.sum(parts, axis=0)
    for layer, values in layers.items():
        if layer.startswith("visibility."):
            found[f"shadow of {layer.removeprefix('visibility.')}"] = 1.0 - values
    if "normal" in layers:
        found["grazing view"] = 1.0 - np.abs(np.sum(layers["normal"] * view.camera.rays(), axis=-1))
    return found


def steps(values: np.ndarray) -> np.ndarray:
    """Largest step from a pixel to one of its four neighbours, widened by a pixel, shape ``(H, W)``.

    Args:
        values: shape ``(H, W)`` or ``(H, W, C)``; over channels, the length of the difference.
    """
    channels = values[..., None] if values.ndim == 2 else values
    found = np.zeros(values.shape[:2])
    for axis in (0, 1):
        step = np.linalg.norm(np.diff(channels.astype(np.float64), axis=axis), axis=-1)
        for side in ((1, 0), (0, 1)):
            pad = [(0, 0), (0, 0)]
            pad[axis] = side
            found = np.maximum(found, np.pad(step, pad))
    return grey_dilation(found, size=(3, 3))


def _as_it_is(values: np.ndarray) -> np.ndarray:
    return values.astype(np.float64)


def _deviation(variance: np.ndarray) -> np.ndarray:
    return np.sqrt(variance.mean(axis=-1))


def _depth_steps(depth: np.ndarray) -> np.ndarray:
    """Return steps of the logarithm: an edge is as strong far away as near. Nothing is far behind
    everything.
    """
    seen = np.isfinite(depth) & (depth > 0)
    far = 2 * depth[seen].max() if seen.any() else 1.0
    return steps(np.log(np.where(seen, depth, far)))


_SINGLE: dict[str, tuple[str, Callable[[np.ndarray], np.ndarray]]] = {
    "shading": ("shading", luminance),
    "bright base colour": ("base_color", luminance),
    "edge of base colour": ("base_color", steps),
    "roughness": ("roughness", _as_it_is),
    "metal": ("metallic", _as_it_is),
    "depth edge": ("depth", _depth_steps),
    "crease or curved surface": ("normal", steps),
    "seen source of light": ("emitted", luminance),
    "noise of the truth": ("radiance.var", _deviation),
    "the target object": ("effect.footprint", _as_it_is),
    "shadow of the target": ("effect.shadow", _as_it_is),
    "mirror image of the target": ("effect.mirror", _as_it_is),
    "light bounced by the target": ("effect.bleeding", _as_it_is),
}
_SUMS = {
    "specular light": ("direct.specular", "indirect.specular"),
    "indirect light": ("indirect.diffuse",),
}
