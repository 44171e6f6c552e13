# SPDX-License-Identifier: Apache-2.0
"""Surroundings at infinity, made as an image on the sky grid.

The sky grid is the one between whose values the renderer interpolates: row ``k`` of ``H`` lies at the
polar angle ``pi k / (H - 1)`` from +z (so the poles have a row), column ``j`` of ``W`` at the azimuth
``2 pi (j + 0.5) / W``. Where the light is recorded, rows lie at ``pi (i + 0.5) / H`` as
:class:`graycard.EnvironmentLight` says; :func:`recorded` gives exactly what the renderer sees there.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

Vector = tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class Window:
    """A bright patch with soft edges in the surroundings."""

    azimuth: float
    """Degrees from +x towards +y."""
    elevation: float
    """Degrees above the horizon."""
    width: float
    """Degrees, full."""
    height: float
    """Degrees, full."""
    radiance: Vector
    """W/m²/sr."""


def room(
    zenith: Vector, horizon: Vector, ground: Vector, windows: Sequence[Window] = (), height: int = 64
) -> np.ndarray:
    """Return a dim room with windows, shape ``(height, 2 * height, 3)`` on the sky grid, W/m²/sr.

    Args:
        zenith: Radiance straight up.
        horizon: Radiance all around.
        ground: Radiance below the horizon.
        windows: What shines in.
        height: Rows.
    """
    elevation = 90 - 180 * np.arange(height)[:, None] / (height - 1)
    azimuth = 360 * (np.arange(2 * height)[None, :] + 0.5) / (2 * height)
    up = np.clip(elevation / 90, 0, 1)[..., None]
    above = np.array(horizon) * (1 - up) + np.array(zenith) * up
    below = _step(-elevation / 12)[..., None]
    image = np.broadcast_to(above * (1 - below) + np.array(ground) * below, (height, 2 * height, 3)).copy()
    for window in windows:
        image += _shine(window, elevation, azimuth)[..., None] * np.array(window.radiance)
    return image


def recorded(sky: np.ndarray) -> np.ndarray:
    """Return the environment as :class:`graycard.EnvironmentLight` records it, of the same shape as
    ``sky``.
    """
    height = len(sky)
    at = (np.arange(height) + 0.5) / height * (height - 1)
    low = np.minimum(at.astype(int), height - 2)
    mix = (at - low)[:, None, None]
    return (sky[low] * (1 - mix) + sky[low + 1] * mix).astype(np.float32)


def _shine(window: Window, elevation: np.ndarray, azimuth: np.ndarray) -> np.ndarray:
    """1 inside a window, 0 outside, with edges about 4 degrees wide."""
    aside = np.abs((azimuth - window.azimuth + 180) % 360 - 180)
    above = np.abs(elevation - window.elevation)
    return _step((window.width / 2 - aside) / 4 + 0.5) * _step((window.height / 2 - above) / 4 + 0.5)


def _step(x: np.ndarray) -> np.ndarray:
    """Smooth step from 0 at ``x <= 0`` to 1 at ``x >= 1``."""
    t = np.clip(x, 0, 1)
    return t * t * (3 - 2 * t)
