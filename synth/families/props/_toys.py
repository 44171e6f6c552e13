# SPDX-License-Identifier: Apache-2.0
"""Shapes for close views, standing on z = 0, metres: bricks, a toy, a plant in a pot, a helmet."""

from dataclasses import replace

import numpy as np

from graycard.synth._mesh import Mesh, box, grid, lathe, merge
from graycard.synth.families.props._everyday import Profile, turned


def studded_brick(columns: int, rows: int, unit: float) -> Mesh:
    """Return a building brick with ``columns`` x ``rows`` round studs, ``unit`` apart and 1.2 units high."""
    body = box((columns * unit, rows * unit, 1.2 * unit), 0.04 * unit).moved((0, 0, 0.6 * unit))
    peg: Profile = [(0, 0), (0.3, 0), (0.3, 0.17), (0.27, 0.2), (0, 0.2)]
    stud = turned([(unit * r, unit * z) for r, z in peg], 0.01 * unit, 20)
    spots = [(c - (columns - 1) / 2, r - (rows - 1) / 2) for c in range(columns) for r in range(rows)]
    return merge([body, *(stud.moved((unit * x, unit * y, 1.2 * unit)) for x, y in spots)])


def ring_tower(rng: np.random.Generator, rings: int, width: float) -> list[Mesh]:
    """Return a child's tower: a foot, then rings that grow smaller, then a knob; one mesh for each."""
    foot = turned([(0, 0), (0.5 * width, 0), (0.5 * width, 0.1 * width), (0, 0.1 * width)], 0.01 * width, 64)
    parts, z = [foot], 0.1 * width
    for radius in np.linspace(0.48, 0.24, rings) * width:
        thick = rng.uniform(0.15, 0.2) * width
        angle = np.linspace(-np.pi / 2, np.pi / 2, 14)
        side = [(radius - thick / 2 + thick / 2 * np.cos(a), thick / 2 * (1 + np.sin(a))) for a in angle]
        parts.append(lathe([(0.0, 0.0), *side, (0.0, thick)]).moved((0, 0, z)))
        z += thick
    return [*parts, _ball(0.12 * width).moved((0, 0, z + 0.1 * width))]


def leaf(length: float, width: float, rise: float, droop: float) -> Mesh:
    """Return a leaf from the origin along +x that rises at first and droops at its tip; closed, so seen from
    below.

    Args:
        length: Metres.
        width: Metres, at its broadest.
        rise: Slope at the stem.
        droop: What the slope has lost at the tip.
    """
    around, along = np.meshgrid(np.linspace(0, 2 * np.pi, 17), np.linspace(0, 1, 17), indexing="ij")
    end = along < 1  # where sin(pi) is not quite 0
    broad = 0.5 * width * (np.sin(np.pi * along**0.8) * end) ** 0.9
    thick = 0.05 * width * (np.sin(np.pi * along) * end) ** 0.5
    across = broad * np.cos(around)
    fold = 0.9 * across**2 / width
    height = length * (rise * along - 0.5 * droop * along**2) + fold + thick * np.sin(around)
    points = np.stack([length * along, across, height], axis=-1)
    return grid(points, np.stack([around / (2 * np.pi), along], axis=-1))


def plant(rng: np.random.Generator, leaves: int, size: float) -> Mesh:
    """Return a rosette of leaves, each turned by the golden angle from the last, older ones longer
    and lower.
    """
    parts = []
    for k in range(leaves):
        age = 1 - k / leaves
        blade = leaf(
            size * (0.55 + 0.45 * age) * rng.uniform(0.9, 1.1),
            size * rng.uniform(0.26, 0.36),
            2.2 - 1.3 * age,
            1.3 + rng.uniform(0, 0.5),
        )
        parts.append(blade.moved((0, 0, 0.02 * size * (1 - age)), turn=2.39996 * k + rng.normal(0, 0.1)))
    return merge(parts)


def flower_pot(height: float, radius: float) -> Mesh:
    """Return a pot with a rim, filled with earth up to a little under it."""
    outside = [(0.72, 0), (0.94, 0.76), (1.04, 0.77), (1.08, 1), (0.98, 1), (0.93, 0.86)]
    profile = [(0.0, 0.0), *((radius * r, height * z) for r, z in outside), (0.0, 0.86 * height)]
    return turned(profile, 0.02 * radius, 64)


def helmet(radius: float) -> Mesh:
    """Return a hollow dome with a brim and a comb, as a fire brigade's."""
    angle = np.linspace(0.0, 0.5 * np.pi, 24)
    brim: Profile = [(1.38 * radius, 0.0), (1.4 * radius, 0.03 * radius), (1.02 * radius, 0.16 * radius)]
    dome = [(radius * np.cos(a), radius * (0.16 + 0.95 * np.sin(a))) for a in angle]
    inside = [(0.93 * radius * np.cos(a), radius * (0.07 + 0.93 * np.sin(a))) for a in angle[::-1]]
    # from the top of the cavity down, around the brim, up to the crown: outside is on the right hand
    shell = lathe([*inside, *brim, *dome])
    squashed = np.array([1.0, 1.12, 1.0])
    normals = shell.normals / squashed
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    shell = replace(shell, vertices=shell.vertices * squashed, normals=normals)
    return merge([shell, _comb(radius)])


def _comb(radius: float) -> Mesh:
    """Return a ridge over the dome from the brow to the neck."""
    around, along = np.meshgrid(np.linspace(0, 2 * np.pi, 17), np.linspace(0, 1, 33), indexing="ij")
    angle = np.pi * (0.12 + 0.76 * along)
    taper = (np.sin(np.pi * along) * (along < 1)) ** 0.6
    reach = radius * (0.95 + 0.12 * taper * (1 + np.sin(around)))
    x = 0.06 * radius * taper * np.cos(around)
    y, z = -1.12 * reach * np.cos(angle), 0.16 * radius + reach * np.sin(angle)
    return grid(np.stack([x, y, z], axis=-1)[::-1], np.stack([around / (2 * np.pi), along], axis=-1)[::-1])


def _ball(radius: float) -> Mesh:
    angle = np.linspace(-np.pi / 2, np.pi / 2, 20)
    return lathe([(max(radius * float(np.cos(a)), 0.0), radius * float(np.sin(a))) for a in angle], 40)
