# SPDX-License-Identifier: Apache-2.0
"""Pictures of three spheres under an environment, seen from infinitely far along +y.

A mirror ball shows where the light comes from, a diffuse one how much of it arrives, a glossy one what lies
between (LeGendre et al. 2019 judge lighting by such spheres). A difference of the maps themselves would be
ruled by the few pixels of a sun.
"""

from functools import cache
from typing import Final

import numpy as np

from graycard import luminance

SPHERES = ("mirror", "glossy", "diffuse")
ALPHA = 0.25
"""GGX alpha of the glossy sphere: a lobe several times as wide as a cell of :data:`CELLS`."""
SIZE = 40
"""Side of a picture in pixels."""
CELLS = 32, 64
"""Rows and columns of directions in which the light that matte and glossy surfaces receive is summed up."""
GRAY = 0.18
"""Mean luminance that the true diffuse sphere is shown with."""
_TOWARDS: Final = np.array([0.0, -1.0, 0.0])
"""Direction of the camera."""


def render_spheres(environment: np.ndarray) -> dict[str, np.ndarray]:
    """Return the radiance of each pixel that shows a sphere.

    Args:
        environment: shape ``(H, W, 3)``, latitude-longitude, radiance, linear; rows from +z down, columns
            from +x towards +y, as of :class:`graycard.EnvironmentLight`.

    Returns:
        By name of :data:`SPHERES`, each ``(N, 3)``, float64, in the environment's unit: a perfect mirror; a
        Cook-Torrance surface with GGX (Walter et al. 2007), height-correlated masking and a Fresnel factor
        of 1; a Lambertian surface of reflectance 1.
    """
    values = np.asarray(environment, np.float64)
    normals, received = sphere_normals(), _light_of_cells(values)
    mirrored = 2 * (normals @ _TOWARDS)[:, None] * normals - _TOWARDS
    glossy, diffuse = _reflected()
    return {"mirror": _look_up(values, mirrored), "glossy": glossy @ received, "diffuse": diffuse @ received}


@cache
def _reflected() -> tuple[np.ndarray, np.ndarray]:
    """Return how much of each cell's light the pixels of the glossy and the diffuse sphere show, 1/sr.

    Each has shape ``(N, M)``, for N pixels and M cells, and takes 20 MB. They are the same under every
    environment, and take far longer than the rest.
    """
    normals, directions = sphere_normals(), _directions_of_cells()
    cosine = np.maximum(normals @ directions.T, 0)
    glossy, diffuse = _ggx(normals, directions, _TOWARDS) * cosine, cosine / np.pi
    glossy.flags.writeable = diffuse.flags.writeable = False
    return glossy, diffuse


def sphere_normals() -> np.ndarray:
    """Outward normals of the sphere at its pixels' centres, shape ``(N, 3)``: x right, z up, -y near."""
    steps = (np.arange(SIZE) + 0.5) / SIZE * 2 - 1
    x, z = np.meshgrid(steps, -steps)
    inside = x**2 + z**2 < 1
    x, z = x[inside], z[inside]
    return np.stack([x, -np.sqrt(1 - x**2 - z**2), z], axis=-1)


def scale_invariant_rmse(predicted: np.ndarray, true: np.ndarray) -> float:
    """Return the root of min_k Σ (k p - t)² / N over the N pixels of a sphere; the sum is over channels, too.

    StyleLight, evaluation/fast_rmse.py, si_rmse, 44eb430, where k may also be negative; so it may here.

    Args:
        predicted: p, shape ``(N, 3)``, linear radiance; not black.
        true: t, shape ``(N, 3)``, in the unit of the result.

    Examples:
        >>> scale_invariant_rmse(np.array([[1.0, 0, 0]]), np.array([[2.0, 0.5, 0]]))
        0.5
    """
    scale = (predicted * true).sum() / (predicted * predicted).sum()
    return float(np.sqrt(((scale * predicted - true) ** 2).sum() / len(true)))


def exposure_for(diffuse: np.ndarray) -> float:
    """Return the factor that shows a diffuse sphere, ``(N, 3)``, at luminance :data:`GRAY`; 1 if black."""
    mean = float(luminance(diffuse).mean())
    return GRAY / mean if mean > 0 else 1.0


def _light_of_cells(environment: np.ndarray) -> np.ndarray:
    """Return the light of each cell, ``(M, 3)``, radiance times sr.

    Solid angle is d(cos t) dp: what a pixel shares with a cell is exact for images of any size.
    """
    (height, width), (rows, columns) = environment.shape[:2], CELLS
    down = _shared(np.cos(np.pi * np.arange(rows + 1) / rows), np.cos(np.pi * np.arange(height + 1) / height))
    around = _shared(np.arange(columns + 1) / columns, np.arange(width + 1) / width) * 2 * np.pi
    return np.einsum("ih,hwc,jw->ijc", down, environment, around, optimize=True).reshape(-1, 3)


def _directions_of_cells() -> np.ndarray:
    """Return the direction of each cell's centre, shape ``(M, 3)``, unit."""
    rows, columns = CELLS
    t, p = np.pi * (np.arange(rows) + 0.5) / rows, 2 * np.pi * (np.arange(columns) + 0.5) / columns
    t, p = (a.ravel() for a in np.meshgrid(t, p, indexing="ij"))
    return np.stack([np.sin(t) * np.cos(p), np.sin(t) * np.sin(p), np.cos(t)], axis=-1)


def _shared(cells: np.ndarray, pixels: np.ndarray) -> np.ndarray:
    """Length that each interval between edges shares with each other one, shape ``(cells, pixels)``."""
    (low, high), (first, last) = (np.sort([e[:-1], e[1:]], axis=0) for e in (cells, pixels))
    return np.maximum(np.minimum(high[:, None], last) - np.maximum(low[:, None], first), 0)


def _look_up(environment: np.ndarray, directions: np.ndarray) -> np.ndarray:
    """Return the environment in unit directions ``(N, 3)``, bilinear.

    Around in azimuth, held at the poles.
    """
    height, width = environment.shape[:2]
    row = np.arccos(np.clip(directions[:, 2], -1, 1)) / np.pi * height - 0.5
    column = np.arctan2(directions[:, 1], directions[:, 0]) / (2 * np.pi) * width - 0.5
    top, left = np.floor(row).astype(int), np.floor(column).astype(int)
    down, right = (row - top)[:, None], (column - left)[:, None]
    upper, lower = np.clip(top, 0, height - 1), np.clip(top + 1, 0, height - 1)
    west, east = left % width, (left + 1) % width
    above = environment[upper, west] * (1 - right) + environment[upper, east] * right
    below = environment[lower, west] * (1 - right) + environment[lower, east] * right
    return above * (1 - down) + below * down


def _ggx(normals: np.ndarray, directions: np.ndarray, towards: np.ndarray) -> np.ndarray:
    """Return the reflectance D V of GGX for each normal and direction of light, shape ``(N, M)``, 1/sr."""
    half = directions + towards
    half /= np.maximum(np.linalg.norm(half, axis=-1, keepdims=True), 1e-9)
    n_h = np.maximum(normals @ half.T, 0)
    n_l, n_v = np.maximum(normals @ directions.T, 0), (normals @ towards)[:, None]
    a2 = ALPHA**2
    spread = a2 / (np.pi * (n_h**2 * (a2 - 1) + 1) ** 2)
    masking = n_l * np.sqrt(n_v**2 * (1 - a2) + a2) + n_v * np.sqrt(n_l**2 * (1 - a2) + a2)
    return spread / (2 * masking)
