# SPDX-License-Identifier: Apache-2.0
"""The dark track: a storage corridor, lit by a lamp that is mounted beside the camera."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from graycard.synth._mesh import Mesh, blob, merge
from graycard.synth._scene import (
    Ball,
    Color,
    Matte,
    Quad,
    Scene,
    Texture,
    Thing,
)
from graycard.synth._spec import RenderSettings
from graycard.synth._spectra import chart_patches, scaled
from graycard.synth._stream import stream
from graycard.synth.families._flash_room import FlashRoom, Gait, Room, color_chart, walk
from graycard.synth.families.props import _everyday as props
from graycard.synth.families.props import _textures as textures

LENGTH, WIDTH, HEIGHT = 7.0, 2.6, 3.4

_ROOM = Room(LENGTH, WIDTH, HEIGHT)
_GAIT = Gait(sway=0.38, bob=0.12, glance=0.55, glances=8.0, recentre=0.6)

_PAINTS = ("moderate red", "blue sky", "foliage", "orange", "purplish blue", "yellow green", "light skin")
_SHELF_HEIGHTS = (0.28, 0.82, 1.34)
_CRATES = ((0.62, 0.5, 0.46), (0.5, 0.42, 0.36), (0.36, 0.34, 0.26))


@dataclass(frozen=True, slots=True)
class Corridor(FlashRoom):
    """A dark corridor with shelves and clutter, seen by a camera that carries a spot light.

    Raises:
        ValueError: A knob is out of its range.
    """

    name: ClassVar[str] = "corridor"
    title: ClassVar[str] = (
        "a dark storage corridor, lit by a lamp beside the camera and a faintly glowing ceiling"
    )

    def build(self, seed: int, settings: RenderSettings) -> Scene:
        """Return the corridor of a seed."""
        things = (
            *_walls(seed),
            color_chart(_ROOM.hung("right", 3.55, 1.35, (0.33, 0.22))),
            *self._shelves(seed),
            *self._crates(seed),
            *self._floor_objects(seed),
        )
        cameras = walk(stream(seed, "path"), settings, (0.45, 0.0, 1.4), 2.0, _GAIT)
        return self.lit(things, _ROOM, cameras, settings.test_views)

    def _shelves(self, seed: int) -> Iterator[Thing]:
        rng = stream(seed, "shelves")
        wood = textures.wood(stream(seed, "shelf wood"), (0.30, 0.21, 0.13))
        for side, (x, length) in enumerate(((3.2, 1.7), (4.9, 1.6))):
            y = (WIDTH / 2 - 0.24) * (1 if side == 0 else -1)
            shift = rng.uniform(-0.15, 0.15)
            rack = props.shelf(length, 0.4, _SHELF_HEIGHTS).moved((x + shift, y, 0))
            yield Thing(f"shelf {side + 1}", rack, Matte(Texture(wood, (0.8, 0.8))))
            for level, z in enumerate(_SHELF_HEIGHTS):
                for place in np.linspace(-0.36, 0.36, 4) * length:
                    if rng.random() < self.clutter:
                        where = (x + shift + place + rng.normal(0, 0.02), y, z)
                        yield self._shelf_object(rng, f"shelf {side + 1}.{level + 1} at {place:+.1f}", where)

    def _shelf_object(self, rng: np.random.Generator, where: str, at: tuple[float, float, float]) -> Thing:
        kind = rng.choice(["carton", "jar", "bottle", "vase", "books", "ball", "stone"])
        turn = rng.uniform(-0.3, 0.3)
        color = chart_patches()[rng.choice(_PAINTS)]
        if kind == "ball":
            radius = rng.uniform(0.09, 0.14)
            center = (float(at[0]), float(at[1]), float(at[2] + radius))
            surface = Texture(textures.bands(rng, color, [(0.6, 0.58, 0.5)]))
            return Thing(f"ball on {where}", Ball(center, float(radius)), self.surface(rng, surface))
        shape = _shelf_shape(str(kind), rng).moved(at, turn)
        return Thing(f"{kind} on {where}", shape, self.surface(rng, _surface(str(kind), rng, color)))

    def _crates(self, seed: int) -> Iterator[Thing]:
        """Yield a stack of cartons by the plaster wall."""
        rng = stream(seed, "crates")
        x, z = rng.uniform(3.15, 3.4), 0.0
        for number, size in enumerate(_CRATES, start=1):
            brown = scaled((0.42, 0.29, 0.17), rng.uniform(0.8, 1.2))
            board = Texture(textures.cardboard(rng, brown), (1.6, 1.6))
            crate = props.crate(*size).moved((x, -0.92, z), rng.normal(0, 0.2))
            yield self.thing(rng, f"crate {number}", crate, board)
            z += size[2]

    def _floor_objects(self, seed: int) -> Iterator[Thing]:
        """Yield a rusty drum, a stool and a large vase."""
        rng = stream(seed, "floor objects")
        rust = textures.stone(
            rng, [(0.05, 0.16, 0.26), (0.06, 0.22, 0.36), (0.08, 0.26, 0.4), (0.3, 0.13, 0.05)]
        )
        drum = props.barrel(0.9, 0.29).moved((rng.uniform(4.5, 4.8), 0.88, 0))
        yield self.thing(rng, "drum", drum, Texture(rust, (2, 1)))
        seat = props.stool(0.5, 0.19).moved((rng.uniform(3.7, 4.1), rng.uniform(-0.2, 0.1), 0))
        yield self.thing(rng, "stool", seat, Texture(textures.wood(rng, (0.42, 0.17, 0.09)), (2, 1)))
        clay = textures.bands(rng, (0.45, 0.22, 0.13), [(0.6, 0.55, 0.45), (0.08, 0.07, 0.1)])
        pot = props.vase(rng, 0.62, 0.42).moved((rng.uniform(5.4, 5.8), 0.75, 0))
        yield self.thing(rng, "floor vase", pot, Texture(clay))


def _walls(seed: int) -> Iterator[Thing]:
    """Yield the shell of the corridor; each wall is seen from inside."""
    x, y, z = LENGTH / 2, WIDTH / 2, HEIGHT / 2
    floor = textures.tiles(stream(seed, "floor"), [(0.34, 0.31, 0.27), (0.16, 0.15, 0.15)])
    brick = textures.bricks(stream(seed, "brick"), (0.40, 0.20, 0.14))
    paint = textures.plaster(stream(seed, "plaster"), (0.46, 0.45, 0.38))
    end = textures.plaster(stream(seed, "end"), (0.24, 0.33, 0.30))
    door = textures.wood(stream(seed, "door"), (0.36, 0.22, 0.12))
    yield Thing("floor", Quad((x, 0, 0), (x, 0, 0), (0, y, 0)), Matte(Texture(floor, (4.3, 1.6))))
    yield Thing("brick wall", Quad((x, y, z), (x, 0, 0), (0, 0, z)), Matte(Texture(brick, (5, 3.4))))
    yield Thing("plaster wall", Quad((x, -y, z), (-x, 0, 0), (0, 0, z)), Matte(Texture(paint, (2.5, 1.2))))
    yield Thing("end wall", Quad((LENGTH, 0, z), (0, -y, 0), (0, 0, z)), Matte(Texture(end, (1, 1.3))))
    yield Thing("back wall", Quad((0, 0, z), (0, y, 0), (0, 0, z)), Matte((0.3, 0.3, 0.28)))
    leaf = props.crate(0.06, 0.9, 2.05).moved((LENGTH - 0.03, -0.55, 0))
    yield Thing("door", leaf, Matte(Texture(door, (1, 2))))
    skirting = props.crate(LENGTH, 0.02, 0.12, 0.004).moved((x, -y + 0.01, 0))
    yield Thing("skirting", skirting, Matte((0.2, 0.17, 0.13)))
    pipe = merge([props.pipe(LENGTH, 0.055).moved((0, y - 0.1, height)) for height in (2.25, 2.42)])
    lagging = textures.plaster(stream(seed, "pipe"), (0.38, 0.37, 0.34), 0.2)
    yield Thing("pipes", pipe, Matte(Texture(lagging, (2, 12))))


def _shelf_shape(kind: str, rng: np.random.Generator) -> Mesh:
    size = rng.uniform(0.75, 1.0)
    match kind:
        case "carton":
            return props.crate(0.34 * size, 0.28, 0.3 * size)
        case "jar":
            return props.jar(0.26 * size, 0.085)
        case "bottle":
            return props.bottle(0.36 * size, 0.075)
        case "vase":
            return props.vase(rng, 0.36 * size, 0.22)
        case "books":
            return props.books(rng, 4, 0.3)
        case _:
            return blob(0.12 * size, rng).moved((0, 0, 0.11 * size))


def _surface(kind: str, rng: np.random.Generator, color: tuple[float, float, float]) -> Color:
    match kind:
        case "carton":
            return Texture(textures.cardboard(rng, (0.44, 0.31, 0.19)), (3, 3))
        case "vase" | "jar":
            return Texture(textures.bands(rng, color, [(0.55, 0.52, 0.45), (0.1, 0.1, 0.14)]))
        case "stone":
            return Texture(textures.stone(rng, [(0.18, 0.17, 0.16), (0.34, 0.32, 0.29), (0.5, 0.48, 0.44)]))
        case _:
            return Texture(textures.plaster(rng, color))
