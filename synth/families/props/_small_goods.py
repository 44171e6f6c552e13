# SPDX-License-Identifier: Apache-2.0
"""Small goods that stand on shelves and benches: cartons, jars, tins, tools, flasks, instruments."""

import numpy as np

from graycard.synth._mesh import Mesh, merge, torus
from graycard.synth._scene import Ball, Color, Geometry, Texture, Vector
from graycard.synth._spectra import chart_patches, paint, scaled
from graycard.synth.families.props import _everyday as props
from graycard.synth.families.props import _furniture as furniture
from graycard.synth.families.props import _interior as interior
from graycard.synth.families.props import _textures as textures

PAINTS = ("moderate red", "blue sky", "foliage", "orange", "purplish blue", "yellow green", "light skin")

STORED = (
    "carton",
    "carton",
    "jar",
    "bottle",
    "tins",
    "toolbox",
    "books",
    "folders",
    "tray",
    "coil",
    "vase",
    "ball",
)
APPARATUS = (
    "flask",
    "flasks",
    "tube rack",
    "meter",
    "meter",
    "microscope",
    "centrifuge",
    "ball",
    "jar",
    "bottle",
    "books",
    "tins",
)


def good(
    rng: np.random.Generator, kind: str, at: Vector, room: Vector, turn: float = 0.0
) -> tuple[Geometry, Color]:
    """One object and its colours.

    Args:
        rng: Of its size and its surface.
        kind: One of :data:`STORED` or :data:`APPARATUS`.
        at: Where it stands, metres.
        room: Width, depth and height that it must not leave, before it is turned; metres.
        turn: About z, radians.
    """
    color = scaled(chart_patches()[rng.choice(PAINTS)], rng.uniform(0.75, 1.1))
    width = rng.uniform(0.8, 1.0) * room[0]
    if kind == "ball":
        radius = float(min(0.4 * width, 0.4 * room[2], 0.13))
        return Ball((at[0], at[1], at[2] + radius), radius), _cover(rng, kind, color)
    shape = _shape(rng, kind, width, room[1], rng.uniform(0.65, 1.0) * room[2])
    return shape.moved(at, turn), _cover(rng, kind, color)


def _shape(rng: np.random.Generator, kind: str, width: float, depth: float, height: float) -> Mesh:
    slim = min(width, depth)
    match kind:
        case "carton":
            return props.crate(width, min(0.9 * width, depth), height)
        case "toolbox":
            return furniture.toolbox(min(width, 1.5 * height))
        case "tray":
            return furniture.tray(width, min(0.9 * width, depth), 0.45 * height)
        case "books":
            return props.books(rng, 4, min(0.85 * width, 1.2 * depth, 1.5 * height))
        case "folders":
            return _folders(rng, width, min(0.75 * depth, 0.26), min(height, 0.33))
        case "tins":
            return _tins(rng, min(0.42 * slim, 0.1), height)
        case "coil":
            ring, cable = min(0.3 * slim, 0.12), min(0.09 * slim, 0.03)
            return merge([torus(ring, cable, 40).moved((0, 0, cable * (1 + 1.8 * k))) for k in range(3)])
        case "meter":
            return props.crate(width, 0.7 * min(width, depth), min(0.6 * width, height))
        case _:
            return _glassware(rng, kind, slim, height)


def _glassware(rng: np.random.Generator, kind: str, slim: float, height: float) -> Mesh:
    """Goods that are turned on a lathe, in reality too, and instruments of glass and steel."""
    match kind:
        case "jar":
            return props.jar(min(height, 0.8 * slim), 0.36 * slim)
        case "bottle":
            return props.bottle(min(height, 1.4 * slim), min(0.3 * slim, 0.08))
        case "vase":
            return props.vase(rng, min(height, 1.3 * slim), 0.8 * slim)
        case "flask":
            return furniture.flask(min(height, 0.95 * slim), 0.42 * slim)
        case "flasks":
            small = min(height, 0.6 * slim)
            places = ((-0.22, -0.1), (0.22, -0.14), (0.02, 0.24))
            return merge(
                furniture.flask(small * rng.uniform(0.7, 1), 0.19 * slim).moved((x * slim, y * slim, 0))
                for x, y in places
            )
        case "tube rack":
            return furniture.tube_rack(slim)
        case "microscope":
            return furniture.microscope(min(height, 1.1 * slim))
        case "centrifuge":
            drum = furniture.cylinder(0.5 * min(height, slim), 0.45 * slim)
            lid = furniture.cylinder(0.08 * slim, 0.36 * slim).moved((0, 0, 0.5 * min(height, slim)))
            return merge([drum, lid])
        case _:
            raise ValueError(f"expected one of {', '.join(sorted({*STORED, *APPARATUS}))}, got {kind!r}")


def _folders(rng: np.random.Generator, width: float, depth: float, height: float) -> Mesh:
    parts, x = [], -width / 2
    while x < width / 2 - 0.09:
        thick = float(rng.uniform(0.04, 0.08))
        spine = furniture.block((thick - 0.003, depth, height * rng.uniform(0.8, 1)), (0, 0, 0))
        parts.append(spine.moved((x + thick / 2, 0, -spine.vertices[:, 2].min())))
        x += thick
    return merge(parts)


def _tins(rng: np.random.Generator, radius: float, height: float) -> Mesh:
    each = min(2.1 * radius, height / 2)
    count = int(rng.integers(1, 3)) if each * 2 <= height else 1
    return merge(furniture.cylinder(each, radius).moved((0, 0, each * k), 1.3 * k) for k in range(count))


def _cover(rng: np.random.Generator, kind: str, color: Vector) -> Color:
    cream, navy = (0.55, 0.52, 0.45), (0.10, 0.10, 0.14)
    match kind:
        case "carton":
            brown = scaled((0.44, 0.31, 0.19), rng.uniform(0.7, 1.2))
            return Texture(textures.cardboard(rng, brown), (3, 3))
        case "vase" | "jar" | "tins" | "ball" | "flask" | "flasks":
            return Texture(textures.bands(rng, color, [cream, navy]))
        case "folders" | "books":
            covers = [color, scaled(chart_patches()[rng.choice(PAINTS)], 0.8), cream]
            return Texture(textures.tiles(rng, covers, 6), (1.7, 1.7))
        case "meter":
            return Texture(interior.instrument_panel(rng, cream, paint("red")), (4, 4))
        case "toolbox" | "tray" | "centrifuge":
            return Texture(interior.sheet_metal(rng, color), (3, 3))
        case "tube rack":
            return Texture(textures.wood(rng, (0.42, 0.28, 0.16)), (3, 3))
        case _:
            return Texture(textures.plaster(rng, color))
