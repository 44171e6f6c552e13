# SPDX-License-Identifier: Apache-2.0
"""Shared parts of the dark track: a closed room whose ceiling glows faintly, and a lamp on the camera."""

from abc import ABC, abstractmethod
from collections.abc import Iterable
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from graycard import Camera, PointLight, RectangleLight, SpotLight, look_at
from graycard.synth._scene import (
    MATERIALS,
    Color,
    Geometry,
    Material,
    Matte,
    Quad,
    Scene,
    Texture,
    Thing,
    Vector,
    polished,
    surface_of,
)
from graycard.synth._spec import RenderSettings
from graycard.synth._spectra import CHART_COLUMNS, blackbody, chart_patches, scaled
from graycard.synth.families._family import Knobs, choice, interleaved, knob
from graycard.synth.families.props import _textures as textures

_INTENSITY = 8.0
"""Intensity of the lamp along its axis, W/sr."""


@dataclass(frozen=True, slots=True)
class FlashRoom(Knobs, ABC):
    """A dark room, seen by a camera that carries its own lamp.

    Raises:
        ValueError: A knob is out of its range.
    """

    light_offset: float = knob(0.25, 0.02, 0.8)
    """Distance of the lamp to the right of the pinhole, metres."""
    light_cutoff: float = knob(38.0, 15.0, 80.0)
    """Half angle at which the spot light ends, degrees; a point light has none."""
    ambient: float = knob(0.02, 0.0, 2.0)
    """Radiance of the ceiling, W/m²/sr; the lamp gives about 3 W/m² at 1.5 m."""
    clutter: float = knob(0.75, 0.0, 1.0)
    """Share of the places for small objects that are taken."""
    gloss: float = knob(0.0, 0.0, 1.0)
    """Share of the objects that are glossy; the others are Lambertian."""
    lamp: str = choice("spot", "point")
    """A spot light that is toed in to the view, or a point light of the same intensity all around."""
    material: str = choice(*MATERIALS)
    """Material of glossy objects."""

    track: ClassVar[str] = "dark"

    @abstractmethod
    def build(self, seed: int, settings: RenderSettings) -> Scene:
        """Return the room of a seed."""

    def lit(self, things: Iterable[Thing], room: "Room", cameras: list[Camera], test_views: int) -> Scene:
        """Return the scene of these things under the lamp on the camera and the glowing ceiling of
        the room.
        """
        ceiling = room.glowing_ceiling(self.ambient)
        return Scene(
            things=(*things, surface_of(ceiling)),
            lights=(self.head_lamp(), ceiling),
            views=interleaved(cameras, test_views),
            light_weights={"lamp": 20.0},
        )

    def head_lamp(self) -> SpotLight | PointLight:
        """Return the lamp, in the frame of the camera."""
        position = (self.light_offset, -0.06, 0.0)
        color = scaled(blackbody(5000), _INTENSITY)
        if self.lamp == "point":
            return PointLight("lamp", position, color, "camera")
        toe_in = (-self.light_offset / 3.0, 0.03, 1.0)
        return SpotLight(
            "lamp", position, toe_in, color, 0.4 * self.light_cutoff, self.light_cutoff, "camera"
        )

    def thing(self, rng: np.random.Generator, name: str, shape: Geometry, color: Color) -> Thing:
        """Return an object that is glossy with a chance of ``gloss``; takes the same random numbers either
        way.
        """
        return Thing(name, shape, self.surface(rng, color))

    def surface(self, rng: np.random.Generator, color: Color) -> Material:
        """Return a material that is glossy with a chance of ``gloss``; takes the same random numbers either
        way.
        """
        glossy, roughness = rng.random() < self.gloss, float(rng.uniform(0.2, 0.5))
        return polished(self.material, color, roughness) if glossy else Matte(color)


@dataclass(frozen=True, slots=True)
class Room:
    """A closed box: x from 0 to ``length``, y from ``-width / 2`` to ``width / 2``, z from 0; metres."""

    length: float
    width: float
    height: float

    def floor(self) -> Quad:
        """Return the floor, seen from above."""
        x, y = self.length / 2, self.width / 2
        return Quad((x, 0, 0), (x, 0, 0), (0, y, 0))

    def wall(self, name: str) -> Quad:
        """Return a whole wall, seen from inside: ``"left"`` (+y), ``"right"``, ``"end"`` (+x) or
        ``"back"``.
        """
        across = name in ("end", "back")
        half = self.width / 2 if across else self.length / 2
        return self.hung(name, 0.0 if across else half, self.height / 2, (half, self.height / 2), 0.0)

    def hung(self, wall: str, along: float, z: float, half: tuple[float, float], gap: float = 0.015) -> Quad:
        """Return a flat picture on a wall, upright and readable from inside.

        Args:
            wall: See :meth:`wall`.
            along: x of its centre on the side walls, y on the others, metres.
            z: Height of its centre, metres.
            half: Half its width and half its height, metres.
            gap: Its distance from the wall, metres.
        """
        x, y = self.length, self.width / 2
        center, right = {
            "left": ((along, y - gap, z), (1, 0, 0)),
            "right": ((along, gap - y, z), (-1, 0, 0)),
            "end": ((x - gap, along, z), (0, -1, 0)),
            "back": ((gap, along, z), (0, 1, 0)),
        }[wall]
        return Quad(center, scaled(right, half[0]), (0.0, 0.0, half[1]))

    def glowing_ceiling(self, radiance: float) -> RectangleLight:
        """Return a glow from above; a glowing panel inside the room would cast shadows of its own."""
        sides = (0.0, self.width / 2, 0.0), (self.length / 2, 0.0, 0.0)
        color = scaled(blackbody(9000), radiance)
        return RectangleLight("ambient", (self.length / 2, 0.0, self.height), *sides, color)


def color_chart(board: Quad) -> Thing:
    """Return a ColorChecker of 24 measured patches on a board, upright and readable."""
    pixels = Texture(textures.chart(chart_patches(), CHART_COLUMNS), smooth=False)
    return Thing("color chart", board, Matte(pixels))


@dataclass(frozen=True, slots=True)
class Gait:
    """The movement of a walking camera beside its way forward."""

    sway: float = 0.3
    """Amplitude to either side, metres."""
    bob: float = 0.1
    """Amplitude up and down, metres."""
    glance: float = 0.6
    """Amplitude of the view's direction to either side; ahead is 2.6."""
    glances: float = 7.0
    """Angular frequency of that, radians a walk."""
    recentre: float = 0.5
    """Turn back to the middle of the room, for each metre beside it."""


def walk(
    rng: np.random.Generator, settings: RenderSettings, start: Vector, steps: float, gait: Gait | None = None
) -> list[Camera]:
    """Return cameras of 62 degrees on a walk along +x that sways and looks from side to side.

    Args:
        rng: Of the path.
        settings: Size and number of the views.
        start: Where the walk begins, metres.
        steps: How long it is, metres.
        gait: How the camera moves beside its way; None: as by default.
    """
    gait = gait or Gait()
    sway, glance, nod = rng.uniform(0, 2 * np.pi, size=3)
    cameras = []
    for t in np.linspace(0, 1, settings.views):
        beside = gait.sway * np.sin(5 * t + sway), gait.bob * np.sin(4 * t + nod)
        at = start + np.array([steps * t, *beside])
        aside = gait.glance * np.sin(gait.glances * t + glance) - gait.recentre * at[1]
        ahead = np.array([2.6, aside, -0.74])
        cameras.append(Camera.from_fov(settings.width, settings.height, 62.0, look_at(at, at + ahead)))
    return cameras
