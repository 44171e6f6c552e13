# SPDX-License-Identifier: Apache-2.0
"""The multilight track: a room of a museum, walked past along its open side."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from graycard import Camera, look_at
from graycard.synth._mesh import blob, box, torus
from graycard.synth._scene import Ball, Matte, Quad, Scene, Texture, Thing
from graycard.synth._sky import Window, room
from graycard.synth._spec import RenderSettings
from graycard.synth._spectra import blackbody, illuminant, paint, scaled
from graycard.synth._stream import stream
from graycard.synth.families._family import interleaved
from graycard.synth.families._many_lights import ManyLights, Spots, Stand, lit
from graycard.synth.families.props import _everyday as props
from graycard.synth.families.props import _textures as textures

WIDTH, DEPTH, HEIGHT = 4.6, 4.2, 2.9
"""Size of the room, metres: x is across, the back wall lies at y = DEPTH / 2, the side at -DEPTH / 2 is
open."""

STANDS = (
    Stand((-0.4, 0.4, 2.75), (-0.2, 0.9, 0.6), 4000),
    Stand((1.5, -1.3, 2.5), (1.1, 0.6, 0.7), 2700),
    Stand((-1.5, -1.4, 2.6), (-1.2, 0.6, 0.9), 3200),
    Stand((1.2, 1.2, 2.5), (1.3, 1.0, 0.3), 9000),
    Stand((0.6, 0.9, 2.7), (0.5, 2.0, 1.5), 5200),
    Stand((-1.3, 1.0, 2.6), (-1.2, 1.2, 0.4), 12000),
    Stand((0.3, -1.6, 2.5), (0.3, 0.2, 0.3), 2300),
    Stand((-1.4, 0.2, 2.5), (-2.2, 0.3, 1.4), 6500),
)
"""Under the ceiling that is not there, each aimed at a work of art."""

_SPOTS = Spots(
    {
        "urn": (-1.2, 0.75),
        "torso": (0.0, 1.1),
        "orb": (1.25, 0.7),
        "bench": (0.45, -0.15),
        "ring": (-0.55, 0.1),
    },
    0.1,
)
"""Places of things on floor before the seed moves them a little, metres."""


@dataclass(frozen=True, slots=True)
class Gallery(ManyLights):
    """A room with pictures on its walls and works of art on plinths, each under a light of its own.

    Raises:
        ValueError: A knob is out of its range.
    """

    track: ClassVar[str] = "multilight"
    name: ClassVar[str] = "gallery"
    title: ClassVar[str] = "a museum's room with pictures and sculptures under several lamps and the sky"

    def build(self, seed: int, settings: RenderSettings) -> Scene:
        """Return the gallery of a seed."""
        lamps = self.lamps(seed, STANDS)
        things = (
            *_room(seed),
            *_pictures(self, seed),
            *_urn(self, seed),
            *_torso(self, seed),
            *_orb(self, seed),
            *_on_the_floor(self, seed),
        )
        views = interleaved(_cameras(seed, settings), settings.test_views)
        return lit(things, lamps, views, _surroundings(seed, self.daylight))


def _room(seed: int) -> Iterator[Thing]:
    """Yield a floor of stone tiles, three plastered walls and a skirting of dark wood."""
    rng = stream(seed, "floor")
    grounds = [(0.42, 0.40, 0.36), (0.16, 0.17, 0.18)], [(0.40, 0.36, 0.30), (0.26, 0.16, 0.12)]
    floor = textures.tiles(rng, grounds[rng.integers(2)], 4)
    half, deep, z = WIDTH / 2, DEPTH / 2, HEIGHT / 2
    yield Thing("floor", Quad((0, 0, 0), (half, 0, 0), (0, deep, 0)), Matte(Texture(floor, (2.5, 2.3))))
    back = ((0.42, 0.16, 0.14), (0.16, 0.27, 0.24), (0.45, 0.38, 0.24))[rng.integers(3)]
    pale = (0.52, 0.50, 0.46)
    walls = {
        "back wall": (Quad((0, deep, z), (half, 0, 0), (0, 0, z)), back),
        "left wall": (Quad((-half, 0, z), (0, deep, 0), (0, 0, z)), pale),
        "right wall": (Quad((half, 0, z), (0, -deep, 0), (0, 0, z)), pale),
    }
    for name, (wall, color) in walls.items():
        plaster = textures.plaster(stream(seed, name), color, 0.1)
        yield Thing(name, wall, Matte(Texture(plaster, (1.5, 1))))
    wood = Texture(textures.wood(stream(seed, "skirting"), (0.16, 0.09, 0.05)), (0.5, 3))
    yield Thing("skirting", box((WIDTH, 0.04, 0.16), 0.01).moved((0, deep - 0.02, 0.08)), Matte(wood))


def _pictures(knobs: ManyLights, seed: int) -> Iterator[Thing]:
    """Five framed canvases: three on the back wall, one on each side wall."""
    back, side = DEPTH / 2, WIDTH / 2
    places = (
        ((-1.35, back, 1.55), 0.0, 0.40, 0.52),
        ((0.0, back, 1.6), 0.0, 0.56, 0.38),
        ((1.35, back, 1.55), 0.0, 0.38, 0.46),
        ((-side, 0.5, 1.5), np.pi / 2, 0.46, 0.36),
        ((side, 0.6, 1.5), -np.pi / 2, 0.36, 0.46),
    )
    for number, (at, turn, width, height) in enumerate(places, start=1):
        rng = stream(seed, f"picture {number}")
        gilt = Texture(textures.wood(rng, (0.45, 0.32, 0.12)), (1.5, 6))
        frame = box((2 * width + 0.14, 0.06, 2 * height + 0.14), 0.015).moved((0, -0.03, 0))
        name = f"frame {number}"
        yield Thing(name, frame.moved(at, turn), knobs.surface(seed, name, gilt, 0.45))
        across = np.array([np.cos(turn), np.sin(turn), 0.0])
        inwards = np.array([np.sin(turn), -np.cos(turn), 0.0])
        x, y, z = (np.array(at) + 0.065 * inwards).tolist()
        u, v, _ = (width * across).tolist()
        canvas = Quad((x, y, z), (u, v, 0.0), (0.0, 0.0, height))
        yield Thing(f"picture {number}", canvas, Matte(Texture(_painting(rng))))


def _painting(rng: np.random.Generator) -> np.ndarray:
    """Return a landscape of blots, or fields of colour: three paints of the ColorChecker."""
    names = "blue sky", "orange", "purplish blue", "moderate red", "foliage", "yellow green", "orange yellow"
    names += "blue flower", "light skin", "dark skin", "purple", "bluish green"
    chosen = [paint(names[k]) for k in rng.choice(len(names), 4, replace=False)]
    if rng.random() < 0.5:
        return textures.stone(rng, chosen)
    return textures.bands(rng, chosen[0], [*chosen[1:], chosen[1]])


def _plinth(seed: int, name: str, width: float, height: float) -> Thing:
    """Return a block of veined stone."""
    rng = stream(seed, f"plinth of {name}")
    stone = textures.stone(rng, [(0.34, 0.33, 0.31), (0.52, 0.50, 0.47), (0.60, 0.58, 0.55)])
    block = props.crate(width, width, height).moved((*_SPOTS.at(name, seed), 0), rng.uniform(-0.2, 0.2))
    return Thing(f"plinth of {name}", block, Matte(Texture(stone, (1.2, 1.2))))


def _urn(knobs: ManyLights, seed: int) -> Iterator[Thing]:
    rng = stream(seed, "urn")
    yield _plinth(seed, "urn", 0.46, 0.7)
    ground = (paint("dark skin"), (0.10, 0.08, 0.07), paint("blue sky"))[rng.integers(3)]
    glaze = textures.bands(rng, ground, [(0.55, 0.24, 0.10), (0.62, 0.57, 0.46), (0.55, 0.24, 0.10)])
    urn = props.vase(rng, 0.62, 0.42).moved((*_SPOTS.at("urn", seed), 0.7))
    yield Thing("urn", urn, knobs.surface(seed, "urn", Texture(glaze, (2, 1)), 0.3))


def _torso(knobs: ManyLights, seed: int) -> Iterator[Thing]:
    """Yield a carved stone of rounded forms."""
    rng = stream(seed, "torso")
    yield _plinth(seed, "torso", 0.56, 0.5)
    marble = textures.stone(rng, [(0.45, 0.43, 0.42), (0.64, 0.62, 0.60), (0.70, 0.68, 0.66)])
    torso = blob(0.34, rng, 0.26, 80).moved((*_SPOTS.at("torso", seed), 0.82), rng.uniform(0, 6))
    yield Thing("torso", torso, knobs.surface(seed, "torso", Texture(marble, (2, 1)), 0.4))


def _orb(knobs: ManyLights, seed: int) -> Iterator[Thing]:
    """Yield a ball of metal in a ring of the same."""
    yield _plinth(seed, "orb", 0.46, 0.6)
    x, y = _SPOTS.at("orb", seed)
    copper, brass = (0.64, 0.36, 0.24), (0.60, 0.44, 0.20)
    metal = knobs.metal((copper, brass)[stream(seed, "orb").integers(2)])
    yield Thing("socket", torus(0.14, 0.04).moved((x, y, 0.64)), metal)
    yield Thing("orb", Ball((x, y, 0.87), 0.22), metal)


def _on_the_floor(knobs: ManyLights, seed: int) -> Iterator[Thing]:
    """Yield a bench with a pile of catalogues, and a ring of glazed clay."""
    rng = stream(seed, "bench")
    x, y = _SPOTS.at("bench", seed)
    wood = Texture(textures.wood(rng, (0.36, 0.22, 0.12)), (1.4, 1.4))
    seat = props.shelf(0.95, 0.38, (0.40,), 0.05)
    yield Thing("bench", seat.moved((x, y, 0), 0.2), knobs.surface(seed, "bench", wood, 0.35))
    covers = [paint(name) for name in ("orange yellow", "light skin", "blue sky", "moderate red")]
    cloth = Texture(textures.tiles(rng, covers, 4), (0.4, 9))
    pile = props.books(rng, 3, 0.28).moved((x + 0.1, y, 0.40), 0.5)
    yield Thing("catalogues", pile, knobs.surface(seed, "catalogues", cloth, 0.4))
    glaze = textures.stone(rng, [(0.04, 0.16, 0.20), (0.07, 0.30, 0.33), (0.22, 0.45, 0.42)])
    ring = torus(0.2, 0.08).moved((*_SPOTS.at("ring", seed), 0.08))
    yield Thing("ring", ring, knobs.surface(seed, "ring", Texture(glaze, (2, 1)), 0.3))


def _surroundings(seed: int, strength: float) -> np.ndarray:
    """Return a dim hall before the open side, with one tall window."""
    day, warm = illuminant("D65"), blackbody(4200)
    window = Window(stream(seed, "sky").uniform(230, 310), 28, 36, 44, scaled(day, 0.7))
    return strength * room(scaled(day, 0.07), scaled(warm, 0.05), scaled(warm, 0.02), (window,))


def _cameras(seed: int, settings: RenderSettings) -> list[Camera]:
    """Return a walk along the open side, now nearer and now farther, eyes on what is in the middle."""
    phase = stream(seed, "path").uniform(0, 2 * np.pi)
    cameras = []
    for t in np.linspace(-1, 1, settings.views):
        at = np.array([1.5 * t, -2.05 + 0.15 * np.sin(5 * t + phase), 1.45 + 0.2 * np.sin(4 * t + phase)])
        pose = look_at(at, np.array([0.25 * t, 0.9, 0.85]))
        cameras.append(Camera.from_fov(settings.width, settings.height, 56.0, pose))
    return cameras
