# SPDX-License-Identifier: Apache-2.0
"""The multilight track: a corner of a potter's studio under several lamps and the sky."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from graycard import Camera, look_at
from graycard.synth._mesh import blob, torus
from graycard.synth._scene import Ball, Matte, Quad, Scene, Texture, Thing
from graycard.synth._sky import Window, room
from graycard.synth._spec import RenderSettings
from graycard.synth._spectra import CHART_COLUMNS, blackbody, chart_patches, illuminant, paint, scaled
from graycard.synth._stream import stream
from graycard.synth.families._family import interleaved
from graycard.synth.families._many_lights import ManyLights, Spots, Stand, lit
from graycard.synth.families.props import _everyday as props
from graycard.synth.families.props import _textures as textures

SIDE, HEIGHT = 3.6, 2.6
"""Length of each wall and height of the corner, metres; the walls meet at (-SIDE / 2, -SIDE / 2)."""


STANDS = (
    Stand((0.3, 0.2, 2.5), (-0.5, -0.5, 0.3), 5200),
    Stand((1.5, -0.6, 2.2), (0.1, -0.8, 0.3), 2700),
    Stand((-0.35, 1.75, 2.3), (-0.75, -0.3, 0.4), 3200),
    Stand((-1.2, 0.4, 2.1), (-0.9, 0.4, 0.0), 9000),
    Stand((-1.2, -1.3, 2.45), (-0.9, -0.7, 0.6), 4000),
    Stand((0.6, -1.35, 2.3), (0.5, -0.8, 0.4), 12000),
    Stand((1.5, 1.4, 2.3), (0.1, 0.0, 0.2), 2300),
    Stand((-1.3, 1.6, 1.9), (-1.2, 0.8, 0.4), 6500),
)
"""Above or beside what the cameras see; by turns they light one part of the corner each."""


@dataclass(frozen=True, slots=True)
class Studio(ManyLights):
    """The corner of a room with objects of mixed material under several lights of different colour.

    Raises:
        ValueError: A knob is out of its range.
    """

    track: ClassVar[str] = "multilight"
    name: ClassVar[str] = "studio"
    title: ClassVar[str] = "a corner of a potter's studio under several lamps and the sky"

    def build(self, seed: int, settings: RenderSettings) -> Scene:
        """Return the studio of a seed."""
        lamps = self.lamps(seed, STANDS)
        things = (
            *_walls(seed),
            _chart(),
            *_vase(self, seed),
            *_round_things(self, seed),
            _metal_ball(self, seed),
            *_carton(self, seed),
        )
        views = interleaved(_cameras(seed, settings), settings.test_views)
        return lit(things, lamps, views, _surroundings(seed, self.daylight))


def _metal_ball(knobs: ManyLights, seed: int) -> Thing:
    x, y = _SPOTS.at("metal ball", seed)
    return Thing("metal ball", Ball((x, y, 0.24), 0.24), knobs.metal())


_SPOTS = Spots(
    {
        "vase": (-0.95, -0.75),
        "sculpture": (-0.2, -1.1),
        "drum": (0.55, -0.75),
        "metal ball": (-0.95, 0.15),
        "bowl": (0.15, 0.0),
        "carton": (-1.3, 0.85),
        "ring": (-0.4, 0.5),
    },
    0.08,
)
"""Places of things on floor before the seed moves them a little, metres."""


def _vase(knobs: ManyLights, seed: int) -> Iterator[Thing]:
    """Yield a glazed vase on a plinth of oak."""
    rng = stream(seed, "vase")
    x, y = _SPOTS.at("vase", seed)
    oak = Texture(textures.wood(rng, (0.44, 0.30, 0.18)))
    yield Thing("plinth", props.crate(0.5, 0.5, 0.62).moved((x, y, 0), 0.1), Matte(oak))
    ground = (paint("blue sky"), paint("foliage"), paint("dark skin"))[rng.integers(3)]
    cream, ochre = (0.60, 0.57, 0.50), (0.45, 0.25, 0.08)
    glaze = textures.bands(rng, ground, [cream, ochre, cream])
    vase = props.vase(rng, 0.55, 0.36).moved((x, y, 0.62))
    yield Thing("vase", vase, knobs.surface(seed, "vase", Texture(glaze, (2, 1)), 0.32))


def _round_things(knobs: ManyLights, seed: int) -> Iterator[Thing]:
    """Yield a marble sculpture, a steel drum, a clay bowl and a ring of rubber."""
    rng = stream(seed, "round things")
    marble = textures.stone(rng, [(0.42, 0.40, 0.38), (0.60, 0.58, 0.55), (0.66, 0.64, 0.60)])
    sculpture = blob(0.3, rng, 0.2).moved((*_SPOTS.at("sculpture", seed), 0.28))
    yield Thing("sculpture", sculpture, knobs.surface(seed, "sculpture", Texture(marble, (2, 1)), 0.4))
    enamel = textures.plaster(rng, scaled(paint("foliage"), 1.6), 0.1)
    drum = props.barrel(0.62, 0.22).moved((*_SPOTS.at("drum", seed), 0))
    yield Thing("drum", drum, knobs.surface(seed, "drum", Texture(enamel), 0.45))
    clay = textures.plaster(rng, (0.45, 0.20, 0.12), 0.15)
    bowl = props.bowl(0.26).moved((*_SPOTS.at("bowl", seed), 0))
    yield Thing("bowl", bowl, knobs.surface(seed, "bowl", Texture(clay), 0.35))
    rubber = textures.plaster(rng, paint("moderate red"))
    ring = torus(0.17, 0.07).moved((*_SPOTS.at("ring", seed), 0.07))
    yield Thing("ring", ring, knobs.surface(seed, "ring", Texture(rubber), 0.5))


def _carton(knobs: ManyLights, seed: int) -> Iterator[Thing]:
    """Yield a pile of books on a carton."""
    rng = stream(seed, "carton")
    x, y = _SPOTS.at("carton", seed)
    board = Texture(textures.cardboard(rng, (0.42, 0.30, 0.18)), (2.4, 2.4))
    yield Thing("carton", props.crate(0.4, 0.32, 0.3).moved((x, y, 0), 0.5), Matte(board))
    covers = [paint(name) for name in ("blue sky", "orange", "light skin", "purple")]
    pile = props.books(rng, 5, 0.34).moved((x - 0.02, y, 0.3), 0.3)
    cloth = Texture(textures.tiles(rng, covers, 4), (0.4, 9))
    yield Thing("books", pile, knobs.surface(seed, "books", cloth, 0.4))


def _walls(seed: int) -> Iterator[Thing]:
    floor = textures.boards(stream(seed, "floor"), (0.38, 0.26, 0.16))
    blue = textures.plaster(stream(seed, "left wall"), (0.36, 0.42, 0.44))
    brick = textures.bricks(stream(seed, "right wall"), (0.45, 0.40, 0.36))
    half, z = SIDE / 2, HEIGHT / 2
    yield Thing("floor", Quad((0, 0, 0), (half, 0, 0), (0, half, 0)), Matte(Texture(floor, (2.2, 3))))
    left = Quad((-half, 0, z), (0, half, 0), (0, 0, z))
    yield Thing("painted wall", left, Matte(Texture(blue, (1.4, 1))))
    right = Quad((0, -half, z), (-half, 0, 0), (0, 0, z))
    yield Thing("brick wall", right, Matte(Texture(brick, (3, 2.6))))


def _chart() -> Thing:
    """Return a ColorChecker of 24 measured patches on the painted wall."""
    pixels = Texture(textures.chart(chart_patches(), CHART_COLUMNS), smooth=False)
    board = Quad((-SIDE / 2 + 0.015, 0.3, 1.2), (0.0, 0.36, 0.0), (0.0, 0.0, 0.24))
    return Thing("color chart", board, Matte(pixels))


def _surroundings(seed: int, strength: float) -> np.ndarray:
    """Dusk through a tall window behind the camera."""
    rng = stream(seed, "sky")
    blue, day = blackbody(12000), illuminant("D75")
    window = Window(rng.uniform(10, 80), 25, 40, 40, scaled(day, 0.7))
    return strength * room(scaled(blue, 0.055), scaled(blue, 0.04), scaled(day, 0.02), (window,))


def _cameras(seed: int, settings: RenderSettings) -> list[Camera]:
    """Return an arc in front of the corner, from the brick wall's side to the painted wall's."""
    phase = stream(seed, "path").uniform(0, 2 * np.pi)
    cameras = []
    for t in np.linspace(0, 1, settings.views):
        angle = np.radians(10 + 68 * t)
        radius = 2.9 + 0.15 * np.sin(8 * t + phase)
        at = np.array(
            [-0.9 + radius * np.cos(angle), -0.9 + radius * np.sin(angle), 1.35 + 0.3 * np.sin(6 * t + phase)]
        )
        pose = look_at(at, np.array([-0.45, -0.45, 0.6]))
        cameras.append(Camera.from_fov(settings.width, settings.height, 52.0, pose))
    return cameras
