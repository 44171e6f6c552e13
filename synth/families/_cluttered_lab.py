# SPDX-License-Identifier: Apache-2.0
"""The dark track: a laboratory full of apparatus, lit by a lamp that is mounted beside the camera."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import ClassVar

import numpy as np

from graycard.synth._mesh import merge, torus
from graycard.synth._scene import Matte, Quad, Scene, Texture, Thing, Vector
from graycard.synth._spec import RenderSettings
from graycard.synth._spectra import paint, scaled
from graycard.synth._stream import stream
from graycard.synth.families._flash_room import FlashRoom, Room, color_chart, walk
from graycard.synth.families.props import _everyday as props
from graycard.synth.families.props import _furniture as furniture
from graycard.synth.families.props import _interior as interior
from graycard.synth.families.props import _small_goods as small_goods
from graycard.synth.families.props import _textures as textures

_ROOM = Room(6.6, 4.4, 3.1)
_BENCH, _HOOD_AT = 0.9, (6.2, 0.95)
"""Height of the benches; where the fume hood stands, for benches at the left wall; metres."""

_ENAMELS = ((0.46, 0.46, 0.42), (0.20, 0.30, 0.34), (0.40, 0.36, 0.26), (0.24, 0.33, 0.26))
_WALLS = ((0.50, 0.50, 0.46), (0.40, 0.46, 0.44), (0.50, 0.44, 0.36), (0.36, 0.40, 0.46))
_FLOORS = (
    ((0.24, 0.27, 0.24), (0.42, 0.42, 0.36)),
    ((0.30, 0.20, 0.15), (0.45, 0.36, 0.28)),
    ((0.20, 0.23, 0.29), (0.40, 0.42, 0.44)),
)
_ISLAND_PLACES = (
    (-0.54, -0.2), (-0.2, -0.22), (0.15, -0.2), (0.5, -0.22), (-0.42, 0.17), (0.0, 0.2), (0.4, 0.17)
)  # fmt: skip
"""Middles of the places on the island, from its own middle, metres."""
_ACCENTS = ("moderate red", "blue", "green", "orange", "purple", "cyan")


@dataclass(frozen=True, slots=True)
class ClutteredLab(FlashRoom):
    """A laboratory: benches with instruments, a fume hood, cabinets, cables, posters.

    Raises:
        ValueError: A knob is out of its range.
    """

    name: ClassVar[str] = "cluttered-lab"
    title: ClassVar[str] = (
        "a dark, cluttered laboratory, lit by a lamp beside the camera and a faintly glowing ceiling"
    )

    def build(self, seed: int, settings: RenderSettings) -> Scene:
        """Return the laboratory of a seed."""
        things = [
            *_shell(seed),
            *_on_the_walls(seed),
            *self._wall_bench(seed),
            *self._wall_shelf(seed),
            *self._fume_hood(seed),
            *self._island(seed),
            *self._on_the_floor(seed),
        ]
        cameras = walk(stream(seed, "path"), settings, (0.55, 0.0, 1.5), 1.5)
        return self.lit(things, _ROOM, cameras, settings.test_views)

    def _wall_bench(self, seed: int) -> Iterator[Thing]:
        """Cupboards under a worktop along a side wall, a monitor, and a row of instruments."""
        rng, side = stream(seed, "wall bench"), _side(seed)
        y, turn = side * 1.85, 0.0 if side > 0 else np.pi
        enamel = Texture(interior.sheet_metal(rng, _pick(rng, _ENAMELS), 1), (1.1, 1.1))
        body = furniture.cabinet(2.5, 0.64, _BENCH - 0.04, 5).moved((3.75, y, 0), turn)
        yield self.thing(rng, "wall bench", body, enamel)
        top = furniture.block((2.56, 0.69, 0.04), (3.75, y, _BENCH - 0.02))
        yield self.thing(rng, "worktop", top, Texture(_worktop(rng), (1, 1)))
        screen_at = int(rng.integers(1, 5))
        for number, x in enumerate(np.linspace(2.72, 4.78, 6)):
            at = (float(x), y - side * rng.uniform(-0.02, 0.05), _BENCH)
            if number == screen_at:
                yield from self._monitor(rng, at, turn)
            else:
                yield from self._apparatus(rng, f"bench place {number + 1}", at, (0.36, 0.44, 0.42), turn)

    def _monitor(self, rng: np.random.Generator, at: Vector, turn: float) -> Iterator[Thing]:
        grey = Texture(textures.plaster(rng, (0.09, 0.09, 0.1)))
        yield self.thing(rng, "monitor", furniture.monitor(0.46).moved(at, turn), grey)
        facing = 1.0 if turn == 0.0 else -1.0
        center = (at[0], at[1] - facing * 0.0215, at[2] + 0.14 + 0.138)
        glass = Quad(center, (0.21 * facing, 0.0, 0.0), (0.0, 0.0, 0.12))
        accents = (paint(str(name)) for name in rng.choice(_ACCENTS, 2, replace=False))
        notice = Texture(interior.poster(rng, *accents))
        yield self.thing(rng, "screen with a notice", glass, notice)

    def _wall_shelf(self, seed: int) -> Iterator[Thing]:
        """Yield a board above the wall bench with bottles and jars."""
        rng, side = stream(seed, "wall shelf"), _side(seed)
        x, y, z = rng.uniform(3.9, 4.1), side * (_ROOM.width / 2 - 0.13), 1.62
        board = furniture.block((1.7, 0.25, 0.03), (x, y, z - 0.015))
        brackets = [
            furniture.block((0.03, 0.22, 0.12), (x + dx, side * (_ROOM.width / 2 - 0.115), z - 0.08))
            for dx in (-0.6, 0.6)
        ]
        wood = Texture(textures.wood(rng, (0.34, 0.24, 0.15)), (1, 1))
        yield self.thing(rng, "wall shelf", merge([board, *brackets]), wood)
        for number, along in enumerate(np.linspace(-0.74, 0.74, 9)):
            at = (float(x + along), y, z)
            yield from self._apparatus(rng, f"shelf place {number + 1}", at, (0.165, 0.2, 0.32))

    def _apparatus(
        self, rng: np.random.Generator, where: str, at: Vector, room: Vector, turn: float = 0.0
    ) -> Iterator[Thing]:
        """One object, where the place is taken; of an empty place the same random numbers are drawn."""
        taken, kind = rng.random() < self.clutter, str(rng.choice(small_goods.APPARATUS))
        shape, color = small_goods.good(rng, kind, at, room, turn + rng.uniform(-0.15, 0.15))
        made = self.thing(rng, f"{kind} at {where}", shape, color)
        if taken:
            yield made

    def _fume_hood(self, seed: int) -> Iterator[Thing]:
        """Yield a fume hood on a cupboard at the end wall, glassware in it, and its duct to the ceiling."""
        rng, side = stream(seed, "fume hood"), _side(seed)
        x, y, turn = _HOOD_AT[0], side * _HOOD_AT[1], -np.pi / 2
        enamel = _pick(rng, _ENAMELS)
        base = Texture(interior.sheet_metal(rng, enamel, 1), (1.1, 1.1))
        yield self.thing(
            rng, "hood base", furniture.cabinet(1.5, 0.74, _BENCH, 3).moved((x, y, 0), turn), base
        )
        walls = Texture(textures.plaster(rng, scaled(enamel, 1.15), 0.1))
        hood = furniture.fume_hood(1.5, 0.74, 1.3).moved((x, y, _BENCH), turn)
        yield self.thing(rng, "fume hood", hood, walls)
        duct = furniture.cylinder(_ROOM.height - _BENCH - 1.3, 0.14).moved((x, y, _BENCH + 1.3))
        yield self.thing(rng, "duct", duct, Texture(interior.sheet_metal(rng, (0.3, 0.3, 0.3)), (2, 1)))
        for number, along in enumerate((-0.5, -0.17, 0.17, 0.5)):
            at = (x + float(rng.uniform(-0.1, 0.02)), float(y + along), _BENCH + 0.04)
            yield from self._apparatus(rng, f"hood place {number + 1}", at, (0.29, 0.34, 0.4), turn)

    def _island(self, seed: int) -> Iterator[Thing]:
        """Yield a table in the middle of the room, apparatus on it, and cables from it down to the floor."""
        rng, side = stream(seed, "island"), _side(seed)
        x, y = float(rng.uniform(4.05, 4.2)), float(-side * rng.uniform(0.6, 0.7))
        shape = furniture.table(1.4, 0.8, _BENCH).moved((x, y, 0))
        yield self.thing(rng, "island", shape, Texture(_worktop(rng), (1, 1)))
        for number, (dx, dy) in enumerate(
            ((-0.48, -0.17), (-0.02, -0.19), (0.46, -0.18), (-0.3, 0.2), (0.25, 0.2))
        ):
            at = (x + dx, y + dy, _BENCH)
            yield from self._apparatus(rng, f"island place {number + 1}", at, (0.33, 0.31, 0.5), -np.pi / 2)
        yield from self._under_the_island(rng, (x, y))
        for number, dx in enumerate((-0.15, 0.2)):
            curve = _cable_to_the_floor((x + dx, y + side * 0.36), side, rng.uniform(0.25, 0.5))
            rubber = scaled(paint(str(rng.choice(_ACCENTS))), 0.5)
            yield self.thing(rng, f"cable {number + 1}", furniture.hose(curve, 0.012), rubber)

    def _under_the_island(self, rng: np.random.Generator, at: tuple[float, float]) -> Iterator[Thing]:
        """Yield a board between the legs of the table with stores on it."""
        board = furniture.block((1.28, 0.62, 0.03), (*at, 0.285))
        yield self.thing(rng, "island shelf", board, Texture(textures.wood(rng, (0.3, 0.2, 0.12)), (1, 1)))
        for number, (dx, dy) in enumerate(((-0.4, -0.05), (0.0, 0.06), (0.4, -0.04)), start=1):
            taken, kind = rng.random() < self.clutter, str(rng.choice(("carton", "toolbox", "tray", "coil")))
            spot, turn = (at[0] + dx, at[1] + dy, 0.3), float(rng.uniform(-0.15, 0.15))
            shape, color = small_goods.good(rng, kind, spot, (0.36, 0.42, 0.42), turn)
            made = self.thing(rng, f"{kind} on island shelf {number}", shape, color)
            if taken:
                yield made

    def _on_the_floor(self, seed: int) -> Iterator[Thing]:
        """Yield a chair, gas cylinders, a tall cabinet, a bin, a carton, and a drain."""
        rng, side = stream(seed, "floor objects"), _side(seed)
        seat = Texture(textures.plaster(rng, paint(str(rng.choice(_ACCENTS)))))
        spot = (rng.uniform(2.85, 3.1), side * rng.uniform(0.85, 0.95), 0)
        yield self.thing(rng, "chair", furniture.chair().moved(spot, rng.uniform(-3, 3)), seat)
        for number, x in enumerate((2.95, 3.28)):
            steel = Texture(textures.bands(rng, paint(str(rng.choice(_ACCENTS))), [(0.5, 0.5, 0.46)]))
            bottle = furniture.gas_cylinder(rng.uniform(1.25, 1.45), 0.115).moved((x, -side * 2.03, 0))
            yield self.thing(rng, f"gas cylinder {number + 1}", bottle, steel)
        drawers = Texture(interior.drawer_fronts(rng, _pick(rng, _ENAMELS)), (1.7, 1.9))
        tall = furniture.cabinet(0.9, 0.5, rng.uniform(1.5, 1.9), 2).moved((6.32, -side * 1.6, 0), -np.pi / 2)
        yield self.thing(rng, "tall cabinet", tall, drawers)
        tray = furniture.tray(0.3, 0.3, 0.36).moved(
            (rng.uniform(2.5, 2.6), -side * 1.6, 0), rng.uniform(0, 1)
        )
        yield self.thing(rng, "bin", tray, Texture(interior.sheet_metal(rng, (0.15, 0.16, 0.18)), (3, 3)))
        shape, color = small_goods.good(
            rng, "carton", (5.3, -side * 1.75, 0), (0.55, 0.5, 0.5), rng.uniform(-0.3, 0.3)
        )
        yield self.thing(rng, "carton on floor", shape, color)
        yield from _drain((float(rng.uniform(2.7, 3.0)), float(-side * rng.uniform(0.1, 0.3))))


def _drain(at: tuple[float, float]) -> Iterator[Thing]:
    """Yield a floor drain: bars in a ring above a dark pit."""
    bars = [furniture.block((0.018, 0.2, 0.008), (x, 0, 0.007), 0.002) for x in np.linspace(-0.07, 0.07, 5)]
    grate = merge([torus(0.115, 0.012, 40).moved((0, 0, -0.004)), *bars]).moved((*at, 0))
    yield Thing("drain grate", grate, Matte((0.25, 0.25, 0.26)))
    yield Thing("drain", furniture.cylinder(0.003, 0.115).moved((*at, 0)), Matte((0.02, 0.02, 0.02)))


def _cable_to_the_floor(start: tuple[float, float], side: int, reach: float) -> np.ndarray:
    """Return a cable that hangs from a table top's edge and runs on along the floor, shape ``(40, 3)``."""
    t = np.linspace(0, 1, 40)
    fall = np.clip(t / 0.6, 0, 1)
    z = 0.012 + (_BENCH - 0.05) * (1 - fall) ** 2
    y = start[1] + side * (0.09 * np.sin(np.pi * np.clip(t / 0.5, 0, 0.5)) + reach * np.clip(t - 0.5, 0, 1))
    return np.stack([start[0] + 0.25 * reach * np.sin(4 * t), y, z], axis=1)


def _pick(rng: np.random.Generator, colors: tuple[Vector, ...]) -> Vector:
    return colors[int(rng.integers(len(colors)))]


def _worktop(rng: np.random.Generator) -> np.ndarray:
    if rng.random() < 0.5:
        return textures.wood(rng, scaled((0.40, 0.27, 0.16), rng.uniform(0.7, 1.1)))
    return interior.linoleum(rng, (0.10, 0.10, 0.11), (0.26, 0.26, 0.27))


def _side(seed: int) -> int:
    """1 where the bench stands at the left wall, -1 where it stands at the right one."""
    return int(stream(seed, "side of the bench").choice([-1, 1]))


def _wall_name(side: float) -> str:
    return "left" if side > 0 else "right"


def _shell(seed: int) -> Iterator[Thing]:
    """Floor, walls, skirting, a pipe along the bench wall and cables above the others."""
    rng, side = stream(seed, "shell"), _side(seed)
    sheet, chip = _FLOORS[int(rng.integers(len(_FLOORS)))]
    tiled = rng.random() < 0.4
    floor = textures.tiles(rng, [chip, sheet]) if tiled else interior.linoleum(rng, sheet, chip)
    yield Thing("floor", _ROOM.floor(), Matte(Texture(floor, (4.4, 2.9))))
    color = _pick(rng, _WALLS)
    for name in ("left", "right", "end", "back"):
        glazed = name == _wall_name(side)
        pixels = textures.tiles(rng, [color], 8) if glazed else textures.plaster(rng, color)
        repeat = (5.5, 2.4) if glazed else (2.2, 1.0)
        yield Thing(f"{name} wall", _ROOM.wall(name), Matte(Texture(pixels, repeat)))
    y = side * (_ROOM.width / 2 - 0.07)
    pipes = merge([props.pipe(_ROOM.length, r).moved((0, y, z)) for z, r in ((2.3, 0.045), (2.45, 0.03))])
    yield Thing("pipes", pipes, Matte(scaled(paint(str(rng.choice(_ACCENTS))), 0.7)))
    edge = -side * (_ROOM.width / 2 - 0.02)
    hooks = np.linspace(0.0, _ROOM.length, 7)
    for number, z in enumerate((2.55, 2.45)):
        spans = [
            furniture.sagging((a, edge, z), (b, edge, z), 0.05 + 0.05 * number) for a, b in pairwise(hooks)
        ]
        cable = merge([furniture.hose(span, 0.012) for span in spans])
        yield Thing(f"wall cable {number + 1}", cable, Matte((0.05, 0.05, 0.06)))


def _on_the_walls(seed: int) -> Iterator[Thing]:
    """Posters, a pegboard with tools, and the chart between the hood and the cabinet."""
    rng, side = stream(seed, "wall hangings"), _side(seed)
    places = [(_wall_name(side), 2.6, 1.75), (_wall_name(-side), 3.1, 1.9), (_wall_name(-side), 5.3, 1.5)]
    for number, (wall, along, z) in enumerate(places, start=1):
        accents = (paint(str(name)) for name in rng.choice(_ACCENTS, 2, replace=False))
        size = rng.uniform(0.24, 0.3)
        sheet = _ROOM.hung(wall, along + rng.uniform(-0.1, 0.1), z, (size, 1.35 * size), 0.006)
        yield Thing(f"poster {number}", sheet, Matte(Texture(interior.poster(rng, *accents))))
    board = Texture(interior.pegboard(rng, (0.42, 0.32, 0.2)), (2, 1.2))
    yield Thing("pegboard", _ROOM.hung(_wall_name(-side), 4.2, 1.55, (0.5, 0.3)), Matte(board))
    for number in range(6):
        tool = (furniture.hammer, furniture.spanner, furniture.saw)[rng.integers(3)]
        shape, steel = tool(rng.uniform(0.22, 0.34)), scaled((0.16, 0.16, 0.17), rng.uniform(0.5, 2))
        at = (3.8 + 0.16 * number, -side * (_ROOM.width / 2 - 0.035), 1.4)
        yield Thing(f"tool {number + 1}", shape.moved(at), Matte(steel))
    yield color_chart(_ROOM.hung("end", -side * 0.45, 1.6, (0.36, 0.24)))
