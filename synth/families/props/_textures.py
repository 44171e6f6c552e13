# SPDX-License-Identifier: Apache-2.0
"""Procedural surfaces with detail at every scale: plaster, brick, boards, tiles, stone, marble, metal, linen.

Each gives linear Rec.709 reflectances of shape ``(size, size, 3)`` that tile without a seam, between
:data:`DARKEST` and :data:`BRIGHTEST`.
"""

from collections.abc import Mapping, Sequence

import numpy as np

Vector = tuple[float, float, float]

DARKEST, BRIGHTEST = 0.015, 0.8
"""Dull paint is no darker, and brighter surfaces would let the principled material gain energy."""

SIZE = 256


def fractal_noise(
    rng: np.random.Generator, size: int = SIZE, slope: float = 1.6, stretch: float = 1.0
) -> np.ndarray:
    """Gaussian noise whose amplitude falls with frequency as ``f ** -slope``, shape ``(size, size)``.

    Args:
        rng: Source of randomness.
        size: Pixels along each side.
        slope: 0 is white; larger is smoother.
        stretch: How much longer its features are along u (columns) than along v (rows).

    Returns:
        Mean 0, standard deviation 1; tiles.
    """
    frequency = np.fft.fftfreq(size) * size
    radius = np.hypot(frequency[:, None], frequency[None, :] * stretch)
    radius[0, 0] = np.inf
    spectrum = np.fft.fft2(rng.normal(size=(size, size))) * np.maximum(radius, 1) ** -slope
    values = np.real(np.fft.ifft2(spectrum))
    return (values - values.mean()) / values.std()


def painted(base: Vector | np.ndarray, shade: np.ndarray) -> np.ndarray:
    """Return a base colour (``(3,)`` or ``(H, W, 3)``) times a shade ``(H, W)``, within the reflectance
    range.
    """
    return np.clip(np.asarray(base) * shade[..., None], DARKEST, BRIGHTEST)


def plaster(rng: np.random.Generator, color: Vector, contrast: float = 0.12) -> np.ndarray:
    """Painted plaster: broad stains and a fine grain."""
    stains, grain = fractal_noise(rng, slope=1.8), fractal_noise(rng, slope=0.6)
    return painted(color, 1 + contrast * stains + 0.5 * contrast * grain)


def stone(rng: np.random.Generator, colors: Sequence[Vector]) -> np.ndarray:
    """Mottled stone: a smooth passage through ``colors`` with fine specks."""
    levels = _rank(fractal_noise(rng, slope=1.5) + 0.25 * fractal_noise(rng, slope=0.4))
    at = levels * (len(colors) - 1)
    low = np.minimum(at.astype(int), len(colors) - 2)
    mix = (at - low)[..., None]
    table = np.array(colors)
    return painted(table[low] * (1 - mix) + table[low + 1] * mix, 1 + 0.08 * fractal_noise(rng, slope=0.2))


def wood(rng: np.random.Generator, color: Vector) -> np.ndarray:
    """One piece of wood, its grain along u."""
    warp = fractal_noise(rng, slope=2.2, stretch=6)
    rings = np.sin(2 * np.pi * (6 * _rows() + 0.6 * warp))
    fibre = fractal_noise(rng, slope=0.7, stretch=24)
    return painted(color, 1 + 0.16 * rings + 0.16 * fibre)


def marble(rng: np.random.Generator, ground: Vector, vein: Vector) -> np.ndarray:
    """Marble: clouds in the ground, and veins broad and hair-thin along the zero lines of warped noise."""
    broad = np.exp(-np.abs(fractal_noise(rng, slope=1.9)) / 0.10)
    thin = np.exp(-np.abs(fractal_noise(rng, slope=1.5)) / 0.035)
    mix = np.clip(0.75 * broad + 0.35 * thin, 0, 1)[..., None]
    clouds = 1 + 0.07 * fractal_noise(rng, slope=1.7) + 0.03 * fractal_noise(rng, slope=0.5)
    return painted(np.array(ground) * (1 - mix) + np.array(vein) * mix, clouds)


def brushed(rng: np.random.Generator, color: Vector) -> np.ndarray:
    """Brushed metal: hairlines along u, and the stains of use."""
    hairlines = fractal_noise(rng, slope=0.4, stretch=48)
    return painted(color, 1 + 0.07 * hairlines + 0.05 * fractal_noise(rng, slope=1.7))


def linen(rng: np.random.Generator, stripe: Vector, ground: Vector) -> np.ndarray:
    """Woven linen, checked: broad stripes both ways, darker where they cross, threads, and creases."""
    across, along = ((at * 4) % 1 < 0.42 for at in (_columns(), _rows()))
    share = 0.5 * across + 0.5 * along
    cloth = np.array(ground) * (1 - share[..., None]) + np.array(stripe) * share[..., None]
    threads = fractal_noise(rng, slope=0.3, stretch=24) + fractal_noise(rng, slope=0.3, stretch=24).T
    return painted(cloth, 1 + 0.04 * threads + 0.06 * fractal_noise(rng, slope=1.8))


def boards(rng: np.random.Generator, color: Vector, count: int = 6) -> np.ndarray:
    """Return a floor of boards along u with dark joints, each board of its own tone."""
    row = _rows() * count
    board = row.astype(int)
    column = (_columns() + rng.random(count)[board]) % 1
    tone = rng.normal(1, 0.14, size=count)[board]
    joint = (row % 1 < 0.045) | (column < 0.008)
    return np.where(joint[..., None], DARKEST, painted(wood(rng, color), tone))


def bricks(rng: np.random.Generator, color: Vector, rows: int = 10, columns: int = 5) -> np.ndarray:
    """Brickwork with mortar; every second row is shifted by half a brick, so ``rows`` is even."""
    y, across = _rows() * rows, _columns() * columns
    row = y.astype(int)
    x = (across + 0.5 * (row % 2)) % columns
    tone = rng.normal(1, 0.22, size=(rows, columns))[row, x.astype(int)]
    face = painted(color, tone * (1 + 0.12 * fractal_noise(rng, slope=0.7)))
    mortar = painted((0.36, 0.34, 0.31), 1 + 0.1 * fractal_noise(rng, slope=0.5))
    return np.where(((y % 1 < 0.12) | (x % 1 < 0.06))[..., None], mortar, face)


def tiles(rng: np.random.Generator, colors: Sequence[Vector], count: int = 4) -> np.ndarray:
    """Square tiles laid in turn in ``colors``, with grout, wear and stains; ``count`` is even."""
    y, x = _rows() * count, _columns() * count
    row, column = y.astype(int), x.astype(int)
    kind = (row + column) % len(colors)
    tone = rng.normal(1, 0.09, size=(count, count))[row, column]
    wear = 1 + 0.10 * fractal_noise(rng, slope=1.6) + 0.05 * fractal_noise(rng, slope=0.4)
    face = painted(np.array(colors)[kind], tone * wear)
    grout = (y % 1 < 0.035) | (x % 1 < 0.035)
    return np.where(grout[..., None], painted((0.12, 0.11, 0.10), wear), face)


def bands(rng: np.random.Generator, ground: Vector, colors: Sequence[Vector]) -> np.ndarray:
    """Glazed pottery: rings and zigzags of ``colors`` around a ground of slightly varying tone."""
    image = np.broadcast_to(np.array(ground), (SIZE, SIZE, 3)).copy()
    wave = np.abs((_columns() * 12) % 1 - 0.5)
    for color, middle in zip(colors, rng.permutation(np.linspace(0.2, 0.8, len(colors))), strict=True):
        width = rng.uniform(0.02, 0.05)
        zigzag = rng.choice([0.0, 0.08])
        inside = np.abs(_rows() - middle - zigzag * (wave - 0.25)) < width
        image[inside] = color
    return painted(image, 1 + 0.06 * fractal_noise(rng, slope=1.2))


def cardboard(rng: np.random.Generator, color: Vector) -> np.ndarray:
    """Corrugated board with a strip of tape and a printed label."""
    flutes = 0.03 * np.sin(2 * np.pi * 48 * _columns())
    image = painted(color, 1 + flutes + 0.08 * fractal_noise(rng, slope=1.2))
    y, x = _rows(), _columns()
    image[np.abs(y - 0.5) < 0.05] *= 1.35
    left, top = rng.uniform(0.1, 0.5), rng.choice([0.1, 0.65])
    label = (x > left) & (x < left + 0.3) & (y > top) & (y < top + 0.22)
    print_ = label & (((y - top) * 40 % 2) > 1.1) & (((x - left) * 3) % 1 > 0.15)
    image[label] = (0.72, 0.71, 0.68)
    image[print_] = (0.06, 0.06, 0.07)
    return np.clip(image, DARKEST, BRIGHTEST)


def chart(patches: Mapping[str, Vector], columns: int, cell: int = 32) -> np.ndarray:
    """Return a colour chart: one square per patch, row by row from the top left, on a black board.

    Args:
        patches: Linear reflectances by name.
        columns: Patches in a row.
        cell: Pixels along the side of a patch with its share of the board; an eighth on each side is board.

    Returns:
        Shape ``(rows * cell, columns * cell, 3)``; row 0 is the top.
    """
    colors = np.array(list(patches.values())).reshape(-1, columns, 3)
    image = np.repeat(np.repeat(colors, cell, axis=0), cell, axis=1)
    inside = np.abs((np.arange(cell) + 0.5) / cell - 0.5) < 0.375
    rows = np.tile(inside, colors.shape[0])[:, None] & np.tile(inside, columns)[None, :]
    return np.where(rows[..., None], image, 0.03)


def _rank(values: np.ndarray) -> np.ndarray:
    """Values replaced by their rank, so that they are spread evenly over [0, 1]."""
    order = np.argsort(np.argsort(values, axis=None, kind="stable"), kind="stable")
    return (order / (values.size - 1)).reshape(values.shape)


def _rows() -> np.ndarray:
    return np.broadcast_to(((np.arange(SIZE) + 0.5) / SIZE)[:, None], (SIZE, SIZE))


def _columns() -> np.ndarray:
    return np.broadcast_to(((np.arange(SIZE) + 0.5) / SIZE)[None, :], (SIZE, SIZE))
