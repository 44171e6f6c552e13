# SPDX-License-Identifier: Apache-2.0
"""The beam of a lamp, fitted to photographs of a white board, as in a laboratory (Zhang et al. 2024).

The paper fits a network of the angle, and an offset and a power of the squared distance. Here a table stands
in for the network. Either knows nothing of the formula by which a renderer draws a spot light.
"""

from dataclasses import dataclass

import numpy as np
import torch
from scipy.optimize import minimize

from graycard.methods._priors import Lamp
from graycard.methods.darkgs._lamp import LampProfile, exact_irradiance, off_axis

PICTURES, SIDE = 12, 24
"""Photographs of the board, and samples along each side of one."""
NEAREST, FARTHEST = 0.6, 3.5
"""Distances of the board ahead of the camera, metres."""
TILT = 35.0
"""Largest angle of the board, degrees."""
HALF_VIEW = 0.7
"""Tangent of half the angle of view."""
REFLECTANCE = 0.9
ELECTRONS, READ_NOISE = 10_000.0, 5.0
"""Electrons that a pixel holds at white, and standard deviation of the noise of reading it, electrons."""
KNOTS = 16
"""Angles in the table."""
_SEED = 0


@dataclass(frozen=True, eq=False)
class BoardSamples:
    """Samples of the photographs of the board; N of them."""

    points: np.ndarray
    """Shape ``(N, 3)``, camera axes, metres: known, as the board's pose is."""
    radiance: np.ndarray
    """Shape ``(N, 3)``, W/m²/sr, with the camera's noise."""
    sigma: np.ndarray
    """Shape ``(N, 3)``: standard deviation of that noise, estimated from the sample."""
    reflected: np.ndarray
    """Shape ``(N, 1)``: radiance over the irradiance of a surface that faces the lamp, the board's
    ``reflectance cos / pi``."""


def photograph_board(lamp: Lamp, seed: int = _SEED) -> BoardSamples:
    """Take photographs of a matte white board under a lamp, in a room that is dark else.

    Args:
        lamp: As it is, in camera axes.
        seed: Of the board's poses and the noise.
    """
    draws = np.random.default_rng(seed)
    across = np.linspace(-HALF_VIEW, HALF_VIEW, SIDE)
    rays = np.stack([*np.meshgrid(across, across), np.ones((SIDE, SIDE))], axis=-1).reshape(-1, 3)
    parts = [_picture(lamp, rays, distance, draws) for distance in np.geomspace(NEAREST, FARTHEST, PICTURES)]
    return BoardSamples(*(np.concatenate(found) for found in zip(*parts, strict=True)))


def _picture(
    lamp: Lamp, rays: np.ndarray, distance: float, draws: np.random.Generator
) -> tuple[np.ndarray, ...]:
    """Points, radiance, its standard deviation and reflected share of one photograph."""
    turn, tilt = draws.uniform(0, 2 * np.pi), np.radians(draws.uniform(0, TILT))
    normal = -np.array([np.sin(tilt) * np.cos(turn), np.sin(tilt) * np.sin(turn), np.cos(tilt)])
    points = rays * (distance * normal[2] / (rays @ normal))[:, None]
    toward = np.array(lamp.position) - points
    cosine = (toward @ normal) / np.linalg.norm(toward, axis=1)
    reflected = REFLECTANCE / np.pi * cosine.clip(min=0)[:, None]
    true = exact_irradiance(lamp, torch.from_numpy(points)).numpy() * reflected
    white = true.max()
    counted = draws.poisson(true / white * ELECTRONS) + draws.normal(0, READ_NOISE, true.shape)
    sigma = np.sqrt(counted.clip(min=0) + READ_NOISE**2)
    return points, counted * white / ELECTRONS, sigma * white / ELECTRONS, reflected


def fit_profile(lamp: Lamp, samples: BoardSamples) -> LampProfile:
    """Fit the beam of a lamp whose place and axis are known.

    For each offset and power of the squared distance the table is that of least squares, each sample weighted
    by its noise; these two are searched (Nelder and Mead 1965).

    Args:
        lamp: Its place and axis; its strength and beam are not looked at.
        samples: What the photographs say.
    """
    away = torch.from_numpy(samples.points - np.array(lamp.position))
    squared = (away * away).sum(dim=-1, keepdim=True).numpy()
    angles = off_axis(lamp, away).numpy()[:, 0]
    widest = float(angles.max())
    hats = np.maximum(0, 1 - np.abs(angles[:, None] / widest * (KNOTS - 1) - np.arange(KNOTS)))

    def table(numbers: np.ndarray) -> tuple[np.ndarray, float]:
        fall = samples.reflected * (np.exp(numbers[0]) + squared) ** -np.exp(numbers[1])
        found, loss = [], 0.0
        for channel in range(3):
            weight = 1 / samples.sigma[:, channel, None]
            rows, wanted = hats * fall * weight, samples.radiance[:, channel] * weight[:, 0]
            solution = np.linalg.lstsq(rows, wanted, rcond=None)[0]
            found.append(solution)
            loss += float(((rows @ solution - wanted) ** 2).mean())
        return np.stack(found, axis=1).clip(min=0), loss

    numbers = minimize(lambda x: table(x)[1], np.array([np.log(1e-2), 0.0]), method="Nelder-Mead").x
    shares = tuple((float(r), float(g), float(b)) for r, g, b in table(numbers)[0])
    return LampProfile(shares, widest, float(np.exp(numbers[0])), float(np.exp(numbers[1])))
