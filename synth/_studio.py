# SPDX-License-Identifier: Apache-2.0
"""The multilight track: a corner of a potter's studio under four lamps and the sky."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

import graycard as gc
from graycard.synth import _props as props
from graycard.synth import _textures as textures
from graycard.synth._family import check_knobs, interleaved, knob, stream
from graycard.synth._mesh import blob, torus
from graycard.synth._scene import Ball, Glossy, Matte, Quad, Scene, Texture, Thing, surface_of
from graycard.synth._sky import Window, room
from graycard.synth._spec import RenderSettings
from graycard.synth._spectra import CHART_COLUMNS, blackbody, chart_patches, illuminant, paint, scaled

SIDE, HEIGHT = 3.6, 2.6
"""Length of each wall and height of the corner, metres; the walls meet at (-SIDE / 2, -SIDE / 2)."""


@dataclass(frozen=True, slots=True)
class Studio:
    """The corner of a room with objects of mixed material under several lights of different colour.

    Raises:
        ValueError: A knob is out of its range.
    """

    softbox: float = knob(1.0, 0.0, 10.0)
    """Factor on the rectangular lamp overhead."""
    bulb: float = knob(1.0, 0.0, 10.0)
    """Factor on the spherical lamp."""
    spot: float = knob(1.0, 0.0, 10.0)
    """Factor on the spot light."""
    point: float = knob(1.0, 0.0, 10.0)
    """Factor on the point light."""
    daylight: float = knob(1.0, 0.0, 10.0)
    """Factor on the surroundings."""
    metal_roughness: float = knob(0.38, 0.1, 1.0)
    """Of the metal ball: square root of the GGX alpha. Low values focus lamps into noisy caustics."""

    track: ClassVar[str] = "multilight"
    name: ClassVar[str] = "studio"
    title: ClassVar[str] = "a corner of a potter's studio under four lamps and the sky"

    def __post_init__(self) -> None:
        check_knobs(self)

    def build(self, seed: int, settings: RenderSettings) -> Scene:
        """The studio of a seed."""
        softbox, bulb = self._softbox(seed), self._bulb(seed)
        things = (
            *_walls(seed),
            _chart(),
            *_vase(seed),
            *_round_things(seed),
            self._metal_ball(seed),
            *_carton(seed),
        )
        return Scene(
            things=(*things, surface_of(softbox), surface_of(bulb)),
            lights=(
                softbox,
                bulb,
                self._spot(seed),
                self._point(seed),
                gc.EnvironmentLight("sky", "environment.exr"),
            ),
            views=interleaved(_cameras(seed, settings), settings.test_views),
            sky=_surroundings(seed, self.daylight),
            light_weights={"sky": 0.5},
        )

    def _softbox(self, seed: int) -> gc.RectangleLight:
        x, y = stream(seed, "softbox").uniform(-0.25, 0.25, size=2)
        position = (float(0.3 + x), float(0.2 + y), HEIGHT - 0.05)
        half = (0.0, 0.4, 0.0), (0.3, 0.0, 0.0)
        return gc.RectangleLight("softbox", position, *half, scaled(blackbody(5200), 8.0 * self.softbox))

    def _bulb(self, seed: int) -> gc.SphereLight:
        shift = stream(seed, "bulb").uniform(-0.15, 0.15)
        position = (float(1.55 + shift), -0.55, 2.05)
        return gc.SphereLight("bulb", position, 0.09, scaled(blackbody(2700), 65.0 * self.bulb))

    def _spot(self, seed: int) -> gc.SpotLight:
        position = np.array([-0.35, 1.75, 2.3])
        aim = np.array([-0.75, -0.6, 0.5]) + stream(seed, "spot").uniform(-0.15, 0.15, size=3)
        direction = tuple((aim - position).tolist())
        color = scaled(blackbody(3200), 13.0 * self.spot)
        return gc.SpotLight("spot", tuple(position.tolist()), direction, color, 12.0, 24.0)

    def _point(self, seed: int) -> gc.PointLight:
        y = stream(seed, "point").uniform(0.3, 0.6)
        return gc.PointLight("point", (-1.3, float(y), 2.0), scaled(blackbody(8000), 0.7 * self.point))

    def _metal_ball(self, seed: int) -> Thing:
        x, y = _spot_of("metal ball", seed)
        brass = (0.60, 0.44, 0.20)
        return Thing("metal ball", Ball((x, y, 0.24), 0.24), Glossy(brass, self.metal_roughness, 1.0))


_SPOTS = {
    "vase": (-0.95, -0.75),
    "sculpture": (-0.2, -1.1),
    "drum": (0.55, -0.75),
    "metal ball": (-0.95, 0.15),
    "bowl": (0.15, 0.0),
    "carton": (-1.3, 0.85),
    "ring": (-0.4, 0.5),
}
"""Where things stand on the floor before the seed moves them a little, metres."""


def _spot_of(name: str, seed: int) -> tuple[float, float]:
    x, y = stream(seed, f"spot of {name}").uniform(-0.08, 0.08, size=2)
    return float(_SPOTS[name][0] + x), float(_SPOTS[name][1] + y)


def _vase(seed: int) -> Iterator[Thing]:
    """A glazed vase on a plinth of oak."""
    rng = stream(seed, "vase")
    x, y = _spot_of("vase", seed)
    oak = Texture(textures.wood(rng, (0.44, 0.30, 0.18)))
    yield Thing("plinth", props.crate(0.5, 0.5, 0.62).moved((x, y, 0), 0.1), Matte(oak))
    ground = (paint("blue sky"), paint("foliage"), paint("dark skin"))[rng.integers(3)]
    cream, ochre = (0.60, 0.57, 0.50), (0.45, 0.25, 0.08)
    glaze = textures.bands(rng, ground, [cream, ochre, cream])
    vase = props.vase(rng, 0.55, 0.36).moved((x, y, 0.62))
    yield Thing("vase", vase, Glossy(Texture(glaze, (2, 1)), 0.32))


def _round_things(seed: int) -> Iterator[Thing]:
    """A marble sculpture, a steel drum, a clay bowl and a ring of rubber."""
    rng = stream(seed, "round things")
    marble = textures.stone(rng, [(0.42, 0.40, 0.38), (0.60, 0.58, 0.55), (0.66, 0.64, 0.60)])
    sculpture = blob(0.3, rng, 0.2).moved((*_spot_of("sculpture", seed), 0.28))
    yield Thing("sculpture", sculpture, Matte(Texture(marble, (2, 1))))
    enamel = textures.plaster(rng, scaled(paint("foliage"), 1.6), 0.1)
    drum = props.barrel(0.62, 0.22).moved((*_spot_of("drum", seed), 0))
    yield Thing("drum", drum, Glossy(Texture(enamel), 0.45))
    clay = textures.plaster(rng, (0.45, 0.20, 0.12), 0.15)
    bowl = props.bowl(0.26).moved((*_spot_of("bowl", seed), 0))
    yield Thing("bowl", bowl, Matte(Texture(clay)))
    rubber = textures.plaster(rng, paint("moderate red"))
    ring = torus(0.17, 0.07).moved((*_spot_of("ring", seed), 0.07))
    yield Thing("ring", ring, Glossy(Texture(rubber), 0.5))


def _carton(seed: int) -> Iterator[Thing]:
    """A pile of books on a carton."""
    rng = stream(seed, "carton")
    x, y = _spot_of("carton", seed)
    board = Texture(textures.cardboard(rng, (0.42, 0.30, 0.18)), (2.4, 2.4))
    yield Thing("carton", props.crate(0.4, 0.32, 0.3).moved((x, y, 0), 0.5), Matte(board))
    covers = [paint(name) for name in ("blue sky", "orange", "light skin", "purple")]
    pile = props.books(rng, 5, 0.34).moved((x - 0.02, y, 0.3), 0.3)
    yield Thing("books", pile, Matte(Texture(textures.tiles(rng, covers, 4), (0.4, 9))))


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
    """A ColorChecker of 24 measured patches on the painted wall."""
    pixels = Texture(textures.chart(chart_patches(), CHART_COLUMNS), smooth=False)
    board = Quad((-SIDE / 2 + 0.015, 0.3, 1.2), (0.0, 0.36, 0.0), (0.0, 0.0, 0.24))
    return Thing("color chart", board, Matte(pixels))


def _surroundings(seed: int, strength: float) -> np.ndarray:
    """Dusk through a tall window behind the camera."""
    rng = stream(seed, "sky")
    blue, day = blackbody(12000), illuminant("D75")
    window = Window(rng.uniform(10, 80), 25, 40, 40, scaled(day, 0.7))
    return strength * room(scaled(blue, 0.055), scaled(blue, 0.04), scaled(day, 0.02), (window,))


def _cameras(seed: int, settings: RenderSettings) -> list[gc.Camera]:
    """An arc in front of the corner, from the brick wall's side to the painted wall's."""
    phase = stream(seed, "path").uniform(0, 2 * np.pi)
    cameras = []
    for t in np.linspace(0, 1, settings.views):
        angle = np.radians(10 + 68 * t)
        radius = 2.9 + 0.15 * np.sin(8 * t + phase)
        at = np.array(
            [-0.9 + radius * np.cos(angle), -0.9 + radius * np.sin(angle), 1.35 + 0.3 * np.sin(6 * t + phase)]
        )
        pose = gc.look_at(at, np.array([-0.45, -0.45, 0.6]))
        cameras.append(gc.Camera.from_fov(settings.width, settings.height, 52.0, pose))
    return cameras
