# SPDX-License-Identifier: Apache-2.0
"""Procedural surfaces of workshops and stores: floors, sheet metal, pegboard, posters, instrument panels.

As in :mod:`graycard.synth.families.props._textures`: linear Rec.709 reflectances, ``(size, size, 3)``.
"""

import numpy as np

from graycard.synth.families.props._textures import BRIGHTEST, DARKEST, SIZE, Vector, fractal_noise, painted

_INK = (0.03, 0.03, 0.035)
_PAPER = (0.72, 0.70, 0.64)


def concrete(rng: np.random.Generator, color: Vector) -> np.ndarray:
    """Return a cast floor: broad stains, pores, and a joint along two sides."""
    v, u = _grid()
    stains = 0.16 * fractal_noise(rng, slope=1.7) + 0.05 * fractal_noise(rng, slope=0.3)
    image = painted(color, 1 + stains)
    image[fractal_noise(rng, slope=0.5) > 2.4] *= 0.45
    image[(u < 0.012) | (v < 0.012)] *= 0.3
    return np.clip(image, DARKEST, BRIGHTEST)


def linoleum(rng: np.random.Generator, color: Vector, chip: Vector) -> np.ndarray:
    """Sheet flooring with chips of a second colour and of black, and worn patches."""
    image = painted(color, 1 + 0.12 * fractal_noise(rng, slope=1.8))
    image[fractal_noise(rng, slope=0.3) > 1.4] = chip
    image[fractal_noise(rng, slope=0.3) > 2.0] = _INK
    return painted(image, 1 + 0.08 * fractal_noise(rng, slope=0.6))


def sheet_metal(rng: np.random.Generator, color: Vector, panels: int = 2) -> np.ndarray:
    """Painted sheets with dark seams, rivets beside them, scratches and a little dirt."""
    v, u = (values * panels % 1 for values in _grid())
    scratches = 0.07 * fractal_noise(rng, slope=0.8, stretch=12)
    image = painted(color, 1 + scratches + 0.10 * fractal_noise(rng, slope=1.7))
    beside = np.minimum(np.abs(u - 0.05), np.abs(u - 0.95))
    rivet = np.hypot(beside, (v * 8 % 1 - 0.5) / 8) < 0.016
    image[rivet] *= 1.6
    image[(u < 0.015) | (v < 0.015)] *= 0.25
    return np.clip(image, DARKEST, BRIGHTEST)


def pegboard(rng: np.random.Generator, color: Vector, holes: int = 16) -> np.ndarray:
    """Hardboard with a grid of holes."""
    v, u = (values * holes % 1 - 0.5 for values in _grid())
    image = painted(color, 1 + 0.1 * fractal_noise(rng, slope=1.3))
    image[np.hypot(u, v) < 0.2] = _INK
    return np.clip(image, DARKEST, BRIGHTEST)


def poster(rng: np.random.Generator, accent: Vector, second: Vector) -> np.ndarray:
    """Return a printed sheet: a heading, a chart of bars or of rings, and paragraphs of text."""
    v, u = _grid()
    image = np.broadcast_to(np.array(_PAPER), (SIZE, SIZE, 3)).copy()
    image[v < 0.17] = accent
    heading = (np.abs(v - 0.085) < 0.03) & (u > 0.08) & (u < 0.75) & ((u * 14 % 1) > 0.3)
    image[heading] = _PAPER
    _draw_figure(rng, image, accent, second)
    word = rng.random((12, 32))[(v * 36).astype(int) % 12, (u * 32).astype(int)] < 0.8
    text = (v > 0.66) & (v < 0.94) & (np.abs(u - 0.5) < 0.42) & ((v * 36 % 1) < 0.5) & word
    image[text] = _INK
    return painted(image, 1 + 0.03 * fractal_noise(rng, slope=1.5))


def instrument_panel(rng: np.random.Generator, color: Vector, lamp: Vector) -> np.ndarray:
    """Return the front of an apparatus: a dark display with a trace, a row of dials, and coloured buttons."""
    v, u = _grid()
    image = painted(color, 1 + 0.05 * fractal_noise(rng, slope=1.2))
    display = (np.abs(u - 0.32) < 0.24) & (np.abs(v - 0.34) < 0.22)
    image[display] = (0.02, 0.035, 0.03)
    trace = 0.34 + 0.1 * np.sin(2 * np.pi * (rng.uniform(3, 9) * u + rng.random()))
    image[display & (np.abs(v - trace) < 0.018)] = (0.25, 0.55, 0.2)
    for number in range(4):
        radius = np.hypot(u - 0.72 - 0.16 * (number % 2), v - 0.22 - 0.24 * (number // 2))
        image[radius < 0.06] = _INK
        image[(radius < 0.05) & (np.abs(u - v * rng.uniform(0.4, 1.4)) < 0.3) & (radius > 0.04)] = _PAPER
    button = (np.abs(v - 0.8) < 0.05) & (np.abs(u - 0.5) < 0.42) & ((u * 9 % 1) > 0.4)
    image[button] = np.where((u * 9).astype(int)[button, None] % 3 == 0, lamp, _PAPER)
    return np.clip(image, DARKEST, BRIGHTEST)


def drawer_fronts(rng: np.random.Generator, color: Vector, columns: int = 2, rows: int = 3) -> np.ndarray:
    """Fronts of drawers with dark gaps, a pale label and a handle each."""
    v, u = _grid()
    v, u = v * rows % 1, u * columns % 1
    image = painted(color, 1 + 0.1 * fractal_noise(rng, slope=1.5))
    image[(np.abs(u - 0.5) < 0.12) & (np.abs(v - 0.3) < 0.09)] = _PAPER
    image[(np.abs(u - 0.5) < 0.16) & (np.abs(v - 0.6) < 0.05)] = (0.10, 0.10, 0.11)
    image[(np.abs(u - 0.5) > 0.48) | (np.abs(v - 0.5) > 0.47)] = DARKEST
    return np.clip(image, DARKEST, BRIGHTEST)


def _draw_figure(rng: np.random.Generator, image: np.ndarray, accent: Vector, second: Vector) -> None:
    v, u = _grid()
    if rng.random() < 0.5:
        height = rng.uniform(0.08, 0.36, size=8)[(u * 8).astype(int)]
        bar = (v < 0.6) & (v > 0.6 - height) & ((u * 8 % 1) > 0.25) & (np.abs(u - 0.5) < 0.44)
        image[bar] = np.where((u * 8).astype(int)[bar, None] % 2 == 0, accent, second)
        return
    x, y = rng.uniform(0.35, 0.65), 0.41
    radius = np.hypot(u - x, v - y)
    for number, color in enumerate((second, _PAPER, accent, _INK)):
        image[radius < 0.19 - 0.05 * number] = color


def _grid() -> tuple[np.ndarray, np.ndarray]:
    """Return the places ``v, u`` of the pixel centres: from 0 at the top row and at the left column."""
    middle = (np.arange(SIZE) + 0.5) / SIZE
    v, u = np.meshgrid(middle, middle, indexing="ij")
    return v, u
