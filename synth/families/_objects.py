# SPDX-License-Identifier: Apache-2.0
"""The multilight track without lamps: a group of objects on a disc, under an environment alone."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from graycard import Camera, EnvironmentLight, look_at
from graycard.synth._mesh import blob, lathe
from graycard.synth._scene import MATERIALS, Matte, Scene, Texture, Thing
from graycard.synth._sky import Window, room
from graycard.synth._spec import RenderSettings
from graycard.synth._spectra import Vector, blackbody, illuminant, paint, scaled
from graycard.synth._stream import stream
from graycard.synth.families._family import Knobs, choice, count, interleaved, knob
from graycard.synth.families._gloss import BRASS, PartlyGlossy
from graycard.synth.families.props import _everyday as props
from graycard.synth.families.props import _textures as textures
from graycard.synth.families.props import _toys as toys

RADIUS = 1.1
"""Radius of the disc on which the objects stand, metres; its upper side is at z = 0."""

_STEEL = (0.56, 0.55, 0.53)

_PLACES = ((0.34, 0.3), (-0.36, 0.32), (-0.32, -0.34), (0.36, -0.3))
"""Places where the bricks, the tower, the plant and the helmet stand before the group is turned, metres."""


@dataclass(frozen=True, slots=True)
class Objects(PartlyGlossy, Knobs):
    """Objects of many shapes and materials under an environment, seen from half a circle around.

    Raises:
        ValueError: A knob is out of its range.
    """

    daylight: float = knob(1.0, 0.0, 10.0)
    """Factor on the environment."""
    windows: int = count(2, 1, 5)
    """Number of soft windows in the environment. Together they are as bright whatever their number: one
    casts shadows like a veiled sun, five nearly none."""
    gloss: float = knob(0.6, 0.0, 1.0)
    """Share of the objects that shine; at 0 no metal is left."""
    metal_roughness: float = knob(0.42, 0.1, 1.0)
    """Roughness of what is made of metal: square root of the GGX alpha."""
    material: str = choice(*MATERIALS)
    """Material of what shines: the papers' material, or Disney's."""

    track: ClassVar[str] = "multilight"
    name: ClassVar[str] = "objects"
    title: ClassVar[str] = "bricks, a toy, a plant and a helmet on a disc under an environment alone"

    def build(self, seed: int, settings: RenderSettings) -> Scene:
        """Return the objects of a seed."""
        things = (
            _disc(seed),
            *_bricks(self, seed),
            *_tower(self, seed),
            *_plant(self, seed),
            _helmet(self, seed),
            *_in_the_middle(self, seed),
        )
        return Scene(
            things=things,
            lights=(EnvironmentLight("sky", "environment.exr"),),
            views=interleaved(_cameras(seed, settings), settings.test_views),
            sky=_surroundings(seed, self.windows, self.daylight),
        )


def _place(number: int, seed: int) -> Vector:
    turn = stream(seed, "turn of the group").uniform(0, 2 * np.pi)
    x, y = np.array(_PLACES[number]) + stream(seed, f"place {number}").uniform(-0.04, 0.04, size=2)
    c, s = np.cos(turn), np.sin(turn)
    return float(c * x - s * y), float(s * x + c * y), 0.0


def _disc(seed: int) -> Thing:
    rng = stream(seed, "disc")
    slab = lathe([(0, -0.06), (RADIUS, -0.06), (RADIUS, -0.01), (RADIUS - 0.01, 0), (0, 0)], 96)
    # u, v of the floor plan: around a lathe's axis all rings of a texture would meet in one point
    plan = slab.vertices[:, :2] / (2 * RADIUS) + 0.5
    wood, slate = (0.40, 0.27, 0.16), (0.20, 0.22, 0.23)
    choices = (
        lambda: textures.boards(rng, wood),
        lambda: textures.tiles(rng, [slate, (0.36, 0.35, 0.33)]),
        lambda: textures.stone(rng, [(0.20, 0.19, 0.18), (0.38, 0.36, 0.33), (0.48, 0.45, 0.41)]),
    )
    ground = Texture(choices[rng.integers(3)](), (2, 2))
    return Thing("disc", type(slab)(slab.vertices, slab.faces, slab.normals, plan), Matte(ground))


def _bricks(knobs: Objects, seed: int) -> Iterator[Thing]:
    """Yield a wall of building bricks in three layers, each of its own colour."""
    rng, (x, y, _) = stream(seed, "bricks"), _place(0, seed)
    unit, turn = 0.075, rng.uniform(0, 2 * np.pi)
    names = rng.permutation(["moderate red", "orange yellow", "purplish blue", "yellow green", "orange"])
    layout = ((4, 2, 0.0), (2, 2, -1.0), (4, 2, -0.5), (2, 2, 0.5))
    for level, (columns, rows, aside) in enumerate(layout):
        offset = aside * unit * np.array([np.cos(turn), np.sin(turn)])
        at = (x + offset[0], y + offset[1], 1.2 * unit * level)
        color = textures.plaster(rng, paint(names[level]), 0.06)
        brick = toys.studded_brick(columns, rows, unit).moved(at, turn)
        name = f"brick {level + 1}"
        yield Thing(name, brick, knobs.surface(seed, name, Texture(color), 0.3))


def _tower(knobs: Objects, seed: int) -> Iterator[Thing]:
    rng, at = stream(seed, "tower"), _place(1, seed)
    colors = [paint(n) for n in rng.permutation(["red", "yellow", "green", "blue", "magenta", "orange"])]
    for number, part in enumerate(toys.ring_tower(rng, 4, 0.36)):
        lacquer = textures.wood(rng, scaled(colors[number], 0.9))
        name = f"ring {number}"
        yield Thing(name, part.moved(at), knobs.surface(seed, name, Texture(lacquer, (2, 0.4)), 0.32))


def _plant(knobs: Objects, seed: int) -> Iterator[Thing]:
    rng, (x, y, _) = stream(seed, "plant"), _place(2, seed)
    clay = textures.bands(rng, (0.45, 0.20, 0.12), [(0.55, 0.50, 0.42), (0.20, 0.08, 0.06)])
    pot = toys.flower_pot(0.26, 0.15).moved((x, y, 0))
    yield Thing("pot", pot, knobs.surface(seed, "pot", Texture(clay, (2, 1)), 0.4))
    greens = [(0.05, 0.16, 0.04), (0.12, 0.30, 0.07), (0.26, 0.42, 0.14)]
    leaves = toys.plant(rng, 14, 0.3).moved((x, y, 0.23), rng.uniform(0, 6))
    yield Thing("leaves", leaves, knobs.surface(seed, "leaves", Texture(textures.stone(rng, greens)), 0.45))


def _helmet(knobs: Objects, seed: int) -> Thing:
    rng, at = stream(seed, "helmet"), _place(3, seed)
    color = textures.plaster(rng, (_STEEL, BRASS)[rng.integers(2)], 0.08)
    shape = toys.helmet(0.17).moved(at, rng.uniform(0, 6))
    return Thing("helmet", shape, knobs.metal(Texture(color)))


def _in_the_middle(knobs: Objects, seed: int) -> Iterator[Thing]:
    """Yield a pebble and a cup between the others."""
    rng = stream(seed, "middle")
    x, y = rng.uniform(-0.05, 0.05, size=2)
    grays = textures.stone(rng, [(0.16, 0.15, 0.14), (0.36, 0.34, 0.31), (0.58, 0.56, 0.52)])
    stone = blob(0.1, rng).moved((x, y, 0.092))
    yield Thing("pebble", stone, knobs.surface(seed, "pebble", Texture(grays, (2, 1)), 0.35))
    angle = rng.uniform(0, 2 * np.pi)
    glaze = textures.bands(rng, paint("bluish green"), [(0.6, 0.57, 0.5), (0.08, 0.10, 0.2)])
    cup = props.bowl(0.11).moved((0.62 * np.cos(angle), 0.62 * np.sin(angle), 0))
    yield Thing("cup", cup, knobs.surface(seed, "cup", Texture(glaze, (2, 1)), 0.3))


def _surroundings(seed: int, windows: int, strength: float) -> np.ndarray:
    """Return a pale sky over dark ground, and windows spread around whose colours differ."""
    rng = stream(seed, "sky")
    first, colors = rng.uniform(0, 360), (illuminant("D65"), blackbody(3600), illuminant("D75"))
    shining = tuple(
        Window(
            first + 360 * k / windows + rng.uniform(-20, 20),
            rng.uniform(32, 50),
            26,
            26,
            scaled(colors[k % 3], 9.0 / windows),
        )
        for k in range(windows)
    )
    sky, ground = blackbody(8500), blackbody(4800)
    return strength * room(scaled(sky, 0.45), scaled(sky, 0.3), scaled(ground, 0.12), shining)


def _cameras(seed: int, settings: RenderSettings) -> list[Camera]:
    """More than half a circle around the group on a hemisphere, rising and falling."""
    start, phase = stream(seed, "path").uniform(0, 2 * np.pi, size=2)
    cameras = []
    for t in np.linspace(0, 1, settings.views):
        angle, lift = start + 3.4 * t, np.radians(36 + 9 * np.sin(7 * t + phase))
        out = np.array([np.cos(angle) * np.cos(lift), np.sin(angle) * np.cos(lift), np.sin(lift)])
        aim = np.array([0.0, 0.0, 0.12])
        pose = look_at(aim + 2.2 * out, aim)
        cameras.append(Camera.from_fov(settings.width, settings.height, 36.0, pose))
    return cameras
