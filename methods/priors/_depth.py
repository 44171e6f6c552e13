# SPDX-License-Identifier: Apache-2.0
"""Errors of networks in depth: scale, curvature, waves, soft edges, and light taken for relief."""

from dataclasses import dataclass

import numpy as np

from graycard.methods.priors._draws import blurred, draws_of, relief, smooth_field

FINE, COARSE = 0.01, 0.2
"""Scales between which light is taken for relief: a lamp's cone and shadows, neither grain nor the room."""
NEAREST = 0.05
"""Depth at the least, of the median: an offset must not bring a surface behind the camera."""


@dataclass(frozen=True, slots=True)
class DepthErrors:
    """Errors of a depth."""

    scale: float = 0.0
    """Standard deviation of the log of a view's scale."""
    curvature: float = 0.0
    """Standard deviation of a view's exponent around 1."""
    offset: float = 0.0
    """Standard deviation of a view's offset, of its median depth."""
    waves: float = 0.0
    """Standard deviation of the log of a smooth random field."""
    kappa: float = 0.0
    """Log depth for each natural log by which the image's light stands out, dark being deep."""
    blur: float = 0.0
    """Softness of edges, a share of the width."""


LEVELS = (
    DepthErrors(),
    DepthErrors(0.02, 0.01, 0.005, 0.01, 0.02, 0.002),
    DepthErrors(0.05, 0.03, 0.010, 0.02, 0.05, 0.004),
    DepthErrors(0.10, 0.06, 0.020, 0.04, 0.10, 0.007),
    DepthErrors(0.20, 0.10, 0.040, 0.07, 0.15, 0.011),
    DepthErrors(0.40, 0.20, 0.080, 0.12, 0.30, 0.018),
)
"""By severity."""


def corrupt_depth(
    depth: np.ndarray, light: np.ndarray, errors: DepthErrors, seed: int, view: str
) -> np.ndarray:
    """Return what a network would say about a depth when it is shown an image in some light.

    ``D' = a m (D / m)^g exp(s G - kappa B(ln S)) + b m`` with the median m, a view's own a, ln g and b, a
    smooth random field G, and a band-pass B of the light S that the image shows: a bright spot looks near, a
    shadow deep ("dark is deep", Langer and Bülthoff 2000). So an evenly lit image gives a better depth.

    Args:
        depth: shape ``(H, W)``, z-depth, metres; what is infinite stays so.
        light: shape ``(H, W, 3)``, of :func:`log_light`: what the network takes for relief.
        errors: How wrong.
        seed: Of the draws.
        view: Name of the view.

    Returns:
        Shape ``(H, W)``, float64, > 0.
    """
    seen = np.isfinite(depth)
    if not seen.any():
        return depth.astype(np.float64)
    draws = draws_of(seed, "depth", view)
    scale, exponent, offset = draws.standard_normal(3)
    waves = smooth_field(draws, depth.shape)[..., 0]
    middle = float(np.median(depth[seen]))
    log = np.log(np.where(seen, depth, middle).astype(np.float64) / middle)
    log = blurred(log, errors.blur, seen) * np.exp(errors.curvature * exponent)
    log += errors.waves * waves - errors.kappa * relief(light, FINE, COARSE) + errors.scale * scale
    wrong = middle * np.maximum(np.exp(log) + errors.offset * offset, NEAREST)
    return np.where(seen, wrong, np.inf)
