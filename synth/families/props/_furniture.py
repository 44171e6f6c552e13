# SPDX-License-Identifier: Apache-2.0
"""Shapes of furniture and tools, standing on z = 0 at the origin, their front to -y, metres."""

import numpy as np

from graycard.synth._mesh import Mesh, box, grid, merge
from graycard.synth.families.props._everyday import Profile, crate, turned


def cylinder(height: float, radius: float) -> Mesh:
    """Return an upright round body with bevelled rims."""
    return turned([(0, 0), (radius, 0), (radius, height), (0, height)], min(0.1 * radius, 0.01), 32)


def block(size: tuple[float, float, float], center: tuple[float, float, float], bevel: float = 0.005) -> Mesh:
    """Return a box of these edge lengths around a centre."""
    return box(size, bevel).moved(center)


def table(width: float, depth: float, height: float) -> Mesh:
    """Return a top with an apron on four legs."""
    x, y = width / 2 - 0.06, depth / 2 - 0.06
    legs = [
        block((0.06, 0.06, height - 0.03), (a * x, b * y, (height - 0.03) / 2))
        for a in (-1, 1)
        for b in (-1, 1)
    ]
    apron = [block((2 * x, 0.025, 0.1), (0, b * y, height - 0.085)) for b in (-1, 1)]
    return merge([block((width, depth, 0.04), (0, 0, height - 0.02)), *legs, *apron])


def cabinet(width: float, depth: float, height: float, doors: int) -> Mesh:
    """Return a cupboard on a recessed plinth with doors in its front, each with a bar for a handle."""
    body = block((width, depth - 0.02, height - 0.08), (0, 0.01, 0.08 + (height - 0.08) / 2))
    parts = [body, block((width - 0.06, depth - 0.1, 0.1), (0, 0.03, 0.05))]
    share, front = width / doors, -depth / 2 + 0.01
    for number in range(doors):
        x = (number + 0.5) * share - width / 2
        parts.append(block((share - 0.016, 0.02, height - 0.12), (x, front, 0.08 + (height - 0.08) / 2)))
        side = x + (0.36 if number % 2 == 0 else -0.36) * share
        parts.append(block((0.014, 0.03, 0.16), (side, front - 0.022, 0.62 * height)))
    return merge(parts)


def chair(seat: float = 0.46) -> Mesh:
    """Return a plain chair; its back is at +y."""
    legs = [block((0.035, 0.035, seat), (0.18 * a, 0.18 * b, seat / 2)) for a in (-1, 1) for b in (-1, 1)]
    posts = [block((0.035, 0.03, 0.45), (0.18 * a, 0.185, seat + 0.22)) for a in (-1, 1)]
    slats = [block((0.36, 0.02, 0.09), (0, 0.185, seat + z)) for z in (0.2, 0.38)]
    return merge([block((0.42, 0.42, 0.035), (0, 0, seat)), *legs, *posts, *slats])


def ladder(height: float, reach: float) -> Mesh:
    """Return a ladder of length ``height`` that leans towards +y: feet at y = 0, top ``reach`` further."""
    rails = [block((0.035, 0.07, height), (0.2 * a, 0, height / 2)) for a in (-1, 1)]
    steps = np.arange(0.28, height - 0.1, 0.29)
    rungs = [block((0.38, 0.05, 0.028), (0, 0, z)) for z in steps]
    return merge([*rails, *rungs]).tilted(-float(np.arcsin(reach / height))).moved((0, 0, 0.008))


def monitor(width: float) -> Mesh:
    """Return a flat display on a foot; its screen lies 0.021 m in front of the origin."""
    height = 0.6 * width
    parts = [
        block((width, 0.04, height), (0, 0, 0.14 + height / 2)),
        block((0.05, 0.03, 0.2), (0, 0.03, 0.11)),
    ]
    return merge([*parts, block((0.5 * width, 0.2, 0.016), (0, 0.02, 0.008))])


def fume_hood(width: float, depth: float, height: float) -> Mesh:
    """Return a chamber that is open in front under a raised sash."""
    side, z = 0.05, height / 2
    parts = [block((side, depth, height), (a * (width - side) / 2, 0, z)) for a in (-1, 1)]
    parts += [block((width - 2 * side, 0.03, height), (0, depth / 2 - 0.015, z))]
    parts += [block((width - 2 * side, depth - 0.03, 0.04), (0, -0.015, 0.02))]
    parts += [block((width - 2 * side, depth - 0.03, 0.04), (0, -0.015, height - 0.02))]
    sash = 0.32 * height
    return merge(
        [*parts, block((width - 2 * side, 0.03, sash), (0, -depth / 2 + 0.03, height - 0.04 - sash / 2))]
    )


def gas_cylinder(height: float, radius: float) -> Mesh:
    """Return a tall bottle for gas with a domed shoulder and a valve."""
    angle = np.linspace(0, 0.42 * np.pi, 7)
    shoulder = 0.82 * height
    dome: Profile = [(radius * float(np.cos(a)), shoulder + 0.7 * radius * float(np.sin(a))) for a in angle]
    neck, top = 0.22 * radius, dome[-1][1]
    cap: Profile = [(neck, top + 0.01), (neck, 0.93 * height), (2 * neck, 0.94 * height), (2 * neck, height)]
    return turned([(0, 0), (radius, 0), *dome, *cap, (0, height)], 0.008)


def flask(height: float, radius: float) -> Mesh:
    """Return a conical flask with a stopper."""
    neck = 0.3 * radius
    body: Profile = [
        (0, 0),
        (radius, 0),
        (radius, 0.05 * height),
        (neck, 0.68 * height),
        (neck, 0.92 * height),
    ]
    return turned([*body, (1.3 * neck, 0.93 * height), (1.3 * neck, height), (0, height)], 0.07 * radius)


def tube_rack(width: float, count: int = 6) -> Mesh:
    """Test tubes in a wooden stand."""
    pitch = width / count
    stand = [block((width, 0.09, 0.02), (0, 0, z)) for z in (0.01, 0.1)]
    ends = [block((0.015, 0.09, 0.11), (a * (width / 2 - 0.008), 0, 0.055)) for a in (-1, 1)]
    places = (np.arange(count) + 0.5) * pitch - width / 2
    tubes = [cylinder(0.15, 0.3 * pitch).moved((x, 0, 0.02)) for x in places]
    return merge([*stand, *ends, *tubes])


def microscope(height: float) -> Mesh:
    """Return a foot, a stage, a curved arm and an inclined tube."""
    h = height
    parts = [
        crate(0.42 * h, 0.55 * h, 0.1 * h, 0.01),
        block((0.14 * h, 0.12 * h, 0.75 * h), (0, 0.2 * h, 0.42 * h)),
    ]
    parts += [block((0.36 * h, 0.34 * h, 0.04 * h), (0, -0.02 * h, 0.38 * h))]
    parts += [block((0.14 * h, 0.4 * h, 0.12 * h), (0, 0.04 * h, 0.76 * h))]
    parts += [cylinder(0.26 * h, 0.05 * h).moved((0, -0.08 * h, 0.48 * h))]
    return merge([*parts, cylinder(0.28 * h, 0.06 * h).tilted(-0.6).moved((0, -0.06 * h, 0.76 * h))])


def toolbox(width: float) -> Mesh:
    """Return a box with a lid and a bar to carry it by."""
    depth, height = 0.5 * width, 0.42 * width
    parts = [
        crate(width, depth, 0.7 * height),
        block((1.02 * width, 1.02 * depth, 0.3 * height), (0, 0, 0.85 * height)),
    ]
    posts = [block((0.02, 0.03, 0.07), (0.28 * width * a, 0, height + 0.03)) for a in (-1, 1)]
    return merge([*parts, *posts, block((0.62 * width, 0.03, 0.02), (0, 0, height + 0.07))])


def tray(width: float, depth: float, height: float) -> Mesh:
    """Return a bin without a lid."""
    wall, z = 0.012, height / 2
    sides = [block((wall, depth, height), (a * (width - wall) / 2, 0, z), 0.003) for a in (-1, 1)]
    ends = [block((width - 2 * wall, wall, height), (0, b * (depth - wall) / 2, z), 0.003) for b in (-1, 1)]
    return merge([*sides, *ends, block((width - 2 * wall, depth - 2 * wall, wall), (0, 0, wall / 2), 0.003)])


def hammer(length: float) -> Mesh:
    """Return a hammer that hangs upright against a wall behind it at y = 0.02."""
    return merge(
        [block((0.028, 0.028, length), (0, 0, length / 2)), block((0.13, 0.036, 0.04), (0, 0, length))]
    )


def spanner(length: float) -> Mesh:
    """Return a double-ended spanner that hangs upright."""
    ends = [block((0.055, 0.014, 0.06), (0, 0, z)) for z in (0.03, length - 0.03)]
    return merge([block((0.022, 0.012, length - 0.08), (0, 0, length / 2)), *ends])


def saw(length: float) -> Mesh:
    """Return a saw that hangs upright, its handle at the top."""
    blade = block((0.09, 0.006, 0.75 * length), (0, 0, 0.375 * length), 0.002)
    return merge([blade, block((0.11, 0.026, 0.25 * length), (0, 0, 0.87 * length), 0.012)])


def hose(points: np.ndarray, radius: float, sides: int = 14) -> Mesh:
    """Return a cable or pipe along a smooth curve; its ends are open and belong inside something.

    Args:
        points: Places along the curve, shape ``(N, 3)``, N >= 2, metres.
        radius: Of its round section, metres.
        sides: Steps around the section.
    """
    tangent = np.gradient(points, axis=0)
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    across = np.empty_like(tangent)
    across[0] = np.eye(3)[np.argmin(np.abs(tangent[0]))]
    for k in range(len(points)):  # carried along, so that the section does not twist
        across[k] = across[max(k - 1, 0)]
        across[k] -= (across[k] @ tangent[k]) * tangent[k]
        across[k] /= np.linalg.norm(across[k])
    angle = np.linspace(0, 2 * np.pi, sides + 1)[:, None, None]
    ring = np.cos(angle) * across + np.sin(angle) * np.cross(tangent, across)
    u, v = np.meshgrid(angle.ravel() / (2 * np.pi), np.linspace(0, 1, len(points)), indexing="ij")
    return grid(points + radius * ring, np.stack([u, v], axis=-1))


def sagging(start: tuple[float, float, float], end: tuple[float, float, float], sag: float) -> np.ndarray:
    """Return a curve ``(24, 3)`` between two points, ``sag`` metres below their chord in the middle."""
    t = np.linspace(0, 1, 24)[:, None]
    chord = np.array(start) * (1 - t) + np.array(end) * t
    return chord - 4 * sag * t * (1 - t) * np.array([0, 0, 1])
