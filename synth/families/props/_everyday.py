# SPDX-License-Identifier: Apache-2.0
"""Shapes of everyday objects, standing on z = 0 at the origin, metres."""

from dataclasses import replace
from itertools import pairwise

import numpy as np

from graycard.synth._mesh import Mesh, box, lathe, merge

Profile = list[tuple[float, float]]


def vase(rng: np.random.Generator, height: float, width: float) -> Mesh:
    """Return a hollow vase with a random belly and neck; ``width`` bounds its largest diameter."""
    share = np.array([0.55, rng.uniform(0.9, 1.35), rng.uniform(0.6, 1.3), rng.uniform(0.1, 0.5), 0.55])
    share = np.append(share, rng.uniform(0.4, 0.75))
    t = np.linspace(0, 1, 28)
    radius = _bezier(share, t)
    radius *= 0.5 * width / radius.max()
    wall = 0.07 * width
    outside = list(zip(radius, height * t, strict=True))
    inside = [(max(r - wall, 0.012 * width), z) for r, z in reversed(outside) if z > 0.2 * height]
    foot: Profile = [(0.0, 0.0), (0.9 * radius[0], 0.0)]
    return lathe([*foot, *outside, *inside, (0.0, inside[-1][1])])


def bottle(height: float, radius: float) -> Mesh:
    """Return a stoppered bottle with a shoulder."""
    neck = 0.36 * radius
    profile = [(0, 0), (radius, 0), (radius, 0.56 * height), (0.86 * radius, 0.66 * height)]
    profile += [(neck, 0.76 * height), (neck, 0.94 * height), (1.25 * neck, 0.94 * height)]
    return lathe(_bevelled([*profile, (1.25 * neck, height), (0, height)], 0.08 * radius), 40)


def jar(height: float, radius: float) -> Mesh:
    """Return a straight jar with a lid."""
    profile = [(0, 0), (radius, 0), (radius, 0.8 * height), (0.9 * radius, 0.82 * height)]
    profile += [(1.04 * radius, 0.84 * height), (1.04 * radius, height), (0, height)]
    return lathe(_bevelled(profile, 0.06 * radius), 40)


def barrel(height: float, radius: float) -> Mesh:
    """Return a steel drum with two raised rings."""
    ring, rib = 0.035 * height, 1.05 * radius
    profile: Profile = [(0, 0), (radius, 0)]
    for middle in (0.33, 0.66):
        z = middle * height
        profile += [(radius, z - ring), (rib, z - 0.5 * ring), (rib, z + 0.5 * ring), (radius, z + ring)]
    profile += [(radius, height), (0.94 * radius, height), (0.94 * radius, 0.97 * height)]
    return lathe(_bevelled([*profile, (0, 0.97 * height)], 0.02 * radius))


def bowl(radius: float) -> Mesh:
    """Return an open bowl."""
    angle = np.linspace(0.12 * np.pi, 0.5 * np.pi, 20)
    outside = [(radius * np.sin(a), 0.75 * radius * (1 - np.cos(a))) for a in angle]
    inside = [(0.92 * r, 0.92 * z + 0.06 * radius) for r, z in reversed(outside)]
    base = outside[0][1]
    points = [(0.0, base), *outside, *inside, (0.0, inside[-1][1])]
    return lathe([(r, z - base) for r, z in points])


def crate(width: float, depth: float, height: float, bevel: float = 0.012) -> Mesh:
    """Return a box on the floor."""
    return box((width, depth, height), bevel).moved((0, 0, height / 2))


def books(rng: np.random.Generator, count: int, width: float) -> Mesh:
    """Return a pile of books, each turned a little."""
    parts, z = [], 0.0
    for _ in range(count):
        thick, size = rng.uniform(0.1, 0.2) * width, width * rng.uniform(0.8, 1.0)
        book = box((size, 0.7 * size, thick), 0.05 * thick)
        parts.append(book.moved((0, 0, z + thick / 2), turn=rng.normal(0, 0.15)))
        z += thick
    return merge(parts)


def shelf(length: float, depth: float, heights: tuple[float, ...], board: float = 0.03) -> Mesh:
    """Return a rack along x: boards whose upper sides lie at ``heights``, between four posts."""
    parts = [box((length, depth, board), 0.004).moved((0, 0, z - board / 2)) for z in heights]
    top = heights[-1] + 0.12
    for x in (-1, 1):
        for y in (-1, 1):
            post = box((0.04, 0.04, top), 0.004)
            parts.append(post.moved((x * (length / 2 - 0.02), y * (depth / 2 - 0.02), top / 2)))
    return merge(parts)


def pipe(length: float, radius: float) -> Mesh:
    """Return a round pipe from the origin along +x."""
    upright = lathe(_bevelled([(0, 0), (radius, 0), (radius, length), (0, length)], 0.01), 24)
    axes = np.array([[0, 0, 1], [0, 1, 0], [-1, 0, 0]])
    return replace(upright, vertices=upright.vertices @ axes.T, normals=upright.normals @ axes.T)


def stool(height: float, radius: float) -> Mesh:
    """Return a round seat on three splayed legs."""
    seat = lathe(_bevelled([(0, 0), (radius, 0), (radius, 0.05), (0, 0.05)], 0.01)).moved(
        (0, 0, height - 0.05)
    )
    legs = []
    for k in range(3):
        leg = box((0.035, 0.035, height - 0.03), 0.006).tilted(0.16).moved((0, 0.62 * radius, 0))
        legs.append(leg.moved((0, 0, (height - 0.05) / 2), turn=2 * np.pi * k / 3 + 0.4))
    return merge([seat, *legs])


def _bezier(control: np.ndarray, t: np.ndarray) -> np.ndarray:
    """Return a Bézier curve by de Casteljau's scheme: smooth, and never outside its control values."""
    values = [np.full_like(t, c) for c in control]
    while len(values) > 1:
        values = [a * (1 - t) + b * t for a, b in pairwise(values)]
    return values[0]


def _bevelled(profile: Profile, width: float) -> Profile:
    """Return a profile whose corners are cut by ``width``, so that area-weighted normals leave its sides
    flat.
    """
    points = np.array(profile, dtype=np.float64)
    kept = [points[0]]
    for before, corner, after in zip(points[:-2], points[1:-1], points[2:], strict=True):
        for other in (before, after):
            edge = other - corner
            length = np.linalg.norm(edge)
            kept.append(corner + edge * (min(width, 0.4 * length) / length))
    return [(float(r), float(z)) for r, z in [*kept, points[-1]]]


def turned(profile: Profile, bevel: float, segments: int = 40) -> Mesh:
    """Return a body turned about z, its corners cut by ``bevel``; the profile starts and ends on the axis."""
    return lathe(_bevelled(profile, bevel), segments)
