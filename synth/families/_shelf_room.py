# SPDX-License-Identifier: Apache-2.0
"""The dark track: a store room of shelves in several rows, lit by a lamp mounted beside the camera."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from graycard.synth._mesh import merge, turn_about_z
from graycard.synth._scene import Matte, Scene, Texture, Thing
from graycard.synth._spec import RenderSettings
from graycard.synth._spectra import scaled
from graycard.synth._stream import stream
from graycard.synth.families._flash_room import FlashRoom, Room, color_chart, walk
from graycard.synth.families.props import _everyday as props
from graycard.synth.families.props import _furniture as furniture
from graycard.synth.families.props import _interior as interior
from graycard.synth.families.props import _small_goods as small_goods
from graycard.synth.families.props import _textures as textures

_ROOM = Room(7.0, 4.2, 3.2)

_PAINTS = ((0.46, 0.45, 0.38), (0.34, 0.42, 0.44), (0.48, 0.38, 0.30), (0.36, 0.42, 0.33))


@dataclass(frozen=True, slots=True)
class ShelfRoom(FlashRoom):
    """A store room with racks along its walls and across its floor, full of goods.

    Raises:
        ValueError: A knob is out of its range.
    """

    name: ClassVar[str] = "shelf-room"
    title: ClassVar[str] = (
        "a dark store room of shelves, lit by a lamp beside the camera and a faintly glowing ceiling"
    )

    def build(self, seed: int, settings: RenderSettings) -> Scene:
        """Return the store room of a seed."""
        things = [*_shell(seed), *self._racks(seed), *self._table(seed), *self._on_the_floor(seed)]
        cameras = walk(stream(seed, "path"), settings, (0.6, 0.0, 1.45), 1.6)
        return self.lit(things, _ROOM, cameras, settings.test_views)

    def _racks(self, seed: int) -> Iterator[Thing]:
        for rack in _plan(seed):
            rng = stream(seed, rack.name)
            shape = props.shelf(rack.length, rack.depth, rack.heights, 0.03)
            boards = Texture(_rack_surface(rng), (0.8, 0.8))
            yield self.thing(rng, rack.name, shape.moved((*rack.at, 0), rack.turn), boards)
            yield from self._goods(rng, rack)

    def _goods(self, rng: np.random.Generator, rack: "_Rack") -> Iterator[Thing]:
        """One object for each place that is taken; those of a place left empty are drawn all the same."""
        count = round(rack.length / 0.36)
        pitch = (rack.length - 0.1) / count
        for level, z in enumerate(rack.heights):
            for place in range(count):
                taken, kind = rng.random() < self.clutter, str(rng.choice(small_goods.STORED))
                local = ((place + 0.5) * pitch - (rack.length - 0.1) / 2, rng.uniform(-0.03, 0.03), 0.0)
                x, y, _ = (turn_about_z(rack.turn) @ local).tolist()
                at = (rack.at[0] + x, rack.at[1] + y, z)
                room = (0.86 * pitch, 0.72 * rack.depth, rack.gap - 0.07)
                turn = rack.turn + rng.uniform(-0.08, 0.08)
                shape, color = small_goods.good(rng, kind, at, room, turn)
                made = self.thing(rng, f"{kind} on {rack.name}.{level + 1}.{place + 1}", shape, color)
                if taken:
                    yield made

    def _table(self, seed: int) -> Iterator[Thing]:
        """Yield a work table at a side wall with goods on it, a pegboard of tools above, and the chart."""
        rng, side = stream(seed, "table"), -_side(seed)
        x, y = rng.uniform(3.15, 3.3), side * 1.72
        oak = Texture(textures.wood(rng, (0.36, 0.23, 0.13)), (1.2, 1.2))
        yield self.thing(rng, "table", furniture.table(1.3, 0.62, 0.78).moved((x, y, 0)), oak)
        for number, along in enumerate((-0.44, -0.02, 0.4)):
            kind = str(rng.choice(("toolbox", "carton", "coil", "jar", "tray", "books")))
            at = (float(x + along), float(y + rng.uniform(-0.06, 0.06)), 0.78)
            shape, color = small_goods.good(rng, kind, at, (0.34, 0.34, 0.32), rng.uniform(-0.2, 0.2))
            yield self.thing(rng, f"{kind} {number + 1} on table", shape, color)
        wall = "left" if side > 0 else "right"
        board = Texture(interior.pegboard(rng, (0.40, 0.28, 0.17)), (2, 1.2))
        yield Thing("pegboard", _ROOM.hung(wall, x, 1.6, (0.5, 0.3)), Matte(board))
        yield from self._tools(rng, x - 0.4, side)
        yield color_chart(_ROOM.hung(wall, 4.35, 1.55, (0.33, 0.22)))

    def _tools(self, rng: np.random.Generator, start: float, side: float) -> Iterator[Thing]:
        for number in range(6):
            kind = str(rng.choice(("hammer", "spanner", "saw")))
            length = rng.uniform(0.24, 0.34)
            shape = getattr(furniture, kind)(length)
            at = (start + 0.16 * number, side * (_ROOM.width / 2 - 0.035), 1.6 - length / 2)
            steel = Texture(textures.plaster(rng, ((0.14, 0.14, 0.15), (0.30, 0.12, 0.07))[rng.integers(2)]))
            yield self.thing(rng, f"{kind} {number + 1}", shape.moved(at), steel)

    def _on_the_floor(self, seed: int) -> Iterator[Thing]:
        """Yield a ladder, a drum, a stack of cartons, a stool and a bin."""
        rng, side = stream(seed, "floor objects"), _side(seed)
        ladder = furniture.ladder(2.3, 0.5).moved((5.05, -side * 1.55, 0), 0.0 if side < 0 else np.pi)
        yield self.thing(rng, "ladder", ladder, Texture(textures.wood(rng, (0.45, 0.33, 0.19)), (2, 2)))
        rust = textures.stone(rng, [(0.05, 0.16, 0.26), (0.06, 0.22, 0.36), (0.3, 0.13, 0.05)])
        drum = props.barrel(0.85, 0.27).moved((rng.uniform(2.55, 2.75), side * 1.72, 0))
        yield self.thing(rng, "drum", drum, Texture(rust, (2, 1)))
        x, y, z = rng.uniform(3.05, 3.3), side * rng.uniform(0.4, 0.6), 0.0
        for number, (w, d, h) in enumerate(((0.5, 0.42, 0.34), (0.4, 0.34, 0.26)), start=1):
            board = Texture(
                textures.cardboard(rng, scaled((0.42, 0.29, 0.17), rng.uniform(0.8, 1.2))), (1.6, 1.6)
            )
            shape = props.crate(w, d, h).moved((x, y, z), rng.normal(0, 0.15))
            yield self.thing(rng, f"carton {number} on floor", shape, board)
            z += h
        stool = props.stool(0.48, 0.18).moved((rng.uniform(3.2, 3.6), -side * rng.uniform(0.7, 0.85), 0))
        yield self.thing(rng, "stool", stool, Texture(textures.wood(rng, (0.42, 0.17, 0.09)), (2, 1)))
        enamel = Texture(interior.sheet_metal(rng, (0.13, 0.2, 0.17)), (3, 3))
        tray = furniture.tray(0.44, 0.34, 0.24).moved((4.05, -side * 0.25, 0), rng.uniform(0, 3))
        yield self.thing(rng, "bin", tray, enamel)


@dataclass(frozen=True, slots=True)
class _Rack:
    name: str
    at: tuple[float, float]
    turn: float
    length: float
    depth: float
    levels: int
    gap: float

    @property
    def heights(self) -> tuple[float, ...]:
        """Upper sides of its boards."""
        return tuple(0.14 + self.gap * k for k in range(self.levels))


_PLAN = (
    ("wall rack", 3.85, 1.84, False, (1.4, 1.7), 0.44, (4, 6)),
    ("far rack", 5.75, 1.86, False, (1.5, 1.7), 0.4, (3, 5)),
    ("low rack", 4.55, 0.7, True, (0.9, 1.15), 0.42, (2, 4)),
    ("middle rack", 5.7, -0.45, True, (1.1, 1.4), 0.46, (3, 5)),
    ("end rack", 6.7, 0.35, True, (1.9, 2.3), 0.44, (4, 6)),
)
"""Two racks along a side wall, two across the floor one behind the other, one at the end wall: name, x, y
(for racks at the left wall), whether across, range of lengths, depth, range of levels; metres."""


def _plan(seed: int) -> Iterator[_Rack]:
    rng, side = stream(seed, "plan"), _side(seed)
    for name, x, y, across, lengths, depth, levels in _PLAN:
        at = (float(x + rng.uniform(-0.06, 0.06)), float(side * y))
        turn, gap = (np.pi / 2 if across else 0.0), float(rng.uniform(0.36, 0.46))
        yield _Rack(name, at, turn, rng.uniform(*lengths), depth, int(rng.integers(*levels)), gap)


def _side(seed: int) -> int:
    """1 where the racks stand at the left wall, -1 where they stand at the right one."""
    return int(stream(seed, "side").choice([-1, 1]))


def _rack_surface(rng: np.random.Generator) -> np.ndarray:
    if rng.random() < 0.5:
        return textures.wood(rng, scaled((0.32, 0.22, 0.13), rng.uniform(0.7, 1.3)))
    enamel = ((0.12, 0.17, 0.24), (0.13, 0.2, 0.15), (0.24, 0.24, 0.24))[rng.integers(3)]
    return interior.sheet_metal(rng, enamel)


def _shell(seed: int) -> Iterator[Thing]:
    """Floor, walls, a door and two pipes along the ceiling."""
    rng, side = stream(seed, "shell"), _side(seed)
    paints = rng.permutation(len(_PAINTS))
    floor = interior.concrete(rng, scaled((0.27, 0.26, 0.24), rng.uniform(0.8, 1.2)))
    yield Thing("floor", _ROOM.floor(), Matte(Texture(floor, (4.6, 2.8))))
    for number, name in enumerate(("left", "right", "end", "back")):
        paint = _PAINTS[paints[number]]
        brick = name in ("left", "end") and rng.random() < 0.5
        pixels = textures.bricks(rng, paint) if brick else textures.plaster(rng, paint)
        repeat = (5.0, 3.2) if brick else (2.2, 1.1)
        yield Thing(f"{name} wall", _ROOM.wall(name), Matte(Texture(pixels, repeat)))
    leaf = props.crate(0.06, 0.9, 2.05).moved((_ROOM.length - 0.03, -side * 1.4, 0))
    yield Thing("door", leaf, Matte(Texture(textures.wood(rng, (0.30, 0.19, 0.11)), (1, 2))))
    y = -side * (_ROOM.width / 2 - 0.09)
    pipes = merge([props.pipe(_ROOM.length, 0.05).moved((0, y, z)) for z in (2.4, 2.56)])
    yield Thing("pipes", pipes, Matte(Texture(textures.plaster(rng, (0.38, 0.36, 0.33), 0.2), (2, 12))))
