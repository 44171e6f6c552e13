# SPDX-License-Identifier: Apache-2.0
"""Rays that meet a surface, for tests of its material alone."""

from typing import Any

import numpy as np


def interaction(wi: np.ndarray) -> Any:
    """Rays that meet a surface from directions ``(3, N)`` in its own frame."""
    import drjit as dr
    import mitsuba as mi

    si: Any = dr.zeros(mi.SurfaceInteraction3f, wi.shape[1])
    si.wi = mi.Vector3f(wi.astype(np.float32))
    return si


def directions(seed: int, count: int = 20_000) -> np.ndarray:
    """Unit vectors above the surface, even in height, shape ``(3, count)``."""
    rng = np.random.default_rng(seed)
    z, azimuth = rng.uniform(0.02, 1, count), rng.uniform(0, 2 * np.pi, count)
    across = np.sqrt(1 - z * z)
    return np.stack([across * np.cos(azimuth), across * np.sin(azimuth), z])
