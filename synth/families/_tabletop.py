# SPDX-License-Identifier: Apache-2.0
"""Shared parts of the families of the tabletop track: their knobs, the room around, the walk of the
camera.
"""

from abc import ABC, abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from graycard import Camera, EnvironmentLight, RectangleLight, look_at
from graycard.synth._scene import (
    MATERIALS,
    Color,
    Material,
    Matte,
    Quad,
    Scene,
    Texture,
    Thing,
    polished,
    surface_of,
    triple,
)
from graycard.synth._sky import Window, room
from graycard.synth._spec import RenderSettings
from graycard.synth._spectra import blackbody, illuminant, scaled
from graycard.synth._stream import stream
from graycard.synth.families._family import Knobs, choice, count, interleaved, knob
from graycard.synth.families.props import _textures as textures
from graycard.synth.families.props._table_objects import Piece, others_of, places, target_of
from graycard.synth.families.props._table_surfaces import HEIGHT, Surface

_WALK = 2.6
"""Angle around the table that the camera covers, radians."""


@dataclass(frozen=True, slots=True)
class Tabletop(Knobs, ABC):
    """Objects on a surface in a room with windows; the tallest is the target.

    Raises:
        ValueError: A knob is out of its range.
    """

    objects: int = count(4, 3, 5)
    """On the surface, the target among them."""
    target_size: float = knob(1.0, 0.6, 1.6)
    """Factor on the size of the target."""
    occlusion: float = knob(0.35, 0.0, 1.0)
    """Share of the other objects that stand between the cameras and the target; 1 crowds it most."""
    daylight: float = knob(1.0, 0.0, 5.0)
    """Factor on the light of the room around."""
    lamp: float = knob(1.0, 0.0, 10.0)
    """Factor on the lamp above the table."""

    track: ClassVar[str] = "tabletop"

    @abstractmethod
    def surface(self) -> Surface:
        """Return the shape of what the objects stand on."""

    @abstractmethod
    def finish(self, seed: int) -> Material:
        """Material of the surface; texture coordinates are metres."""

    @abstractmethod
    def glaze(self, color: Color) -> Material:
        """Material of glazed objects."""

    def build(self, seed: int, settings: RenderSettings) -> Scene:
        """Return the table of a seed."""
        lamp = _lamp(seed, self.lamp)
        surface, target = self.surface(), target_of(seed, self.target_size)
        pieces = [target, *others_of(seed, self.objects - 1)]
        table = Thing("table", surface.top(), self.finish(seed))
        foot = Thing("foot", surface.foot(), Matte((0.12, 0.11, 0.11)))
        return Scene(
            things=(_floor(seed), foot, table, *self._stood(seed, surface, pieces), surface_of(lamp)),
            lights=(lamp, EnvironmentLight("room", "environment.exr")),
            views=interleaved(_cameras(seed, settings), settings.test_views),
            sky=_room(seed, self.daylight),
            target=target.name,
        )

    def _stood(self, seed: int, surface: Surface, pieces: list[Piece]) -> Iterator[Thing]:
        """Yield the pieces as things, each at its place."""
        start, _ = _path(seed)
        reaches = [piece.reach for piece in pieces]
        at = places(seed, reaches[0], reaches[1:], start + _WALK / 2, self.occlusion)
        turns = stream(seed, "turns").uniform(0, 2 * np.pi, size=len(pieces))
        for piece, (x, y), turn in zip(pieces, at, turns.tolist(), strict=True):
            material = self.glaze(piece.color) if piece.glazed else Matte(piece.color)
            yield Thing(piece.name, surface.stand(piece.shape, x, y, turn), material)


@dataclass(frozen=True, slots=True)
class PolishedTabletop(Tabletop):
    """A tabletop whose surface shines, and whose glazed objects do."""

    roughness: float = knob(0.2, 0.03, 0.8)
    """Roughness of the surface: square root of the GGX alpha."""
    material: str = choice(*MATERIALS)
    """Material of all that shines: shines is made of."""

    def glaze(self, color: Color) -> Material:
        """Return fired glaze, of roughness 0.35."""
        return polished(self.material, color, 0.35)


def _floor(seed: int) -> Thing:
    pixels = textures.tiles(stream(seed, "floor"), [(0.34, 0.34, 0.32), (0.22, 0.25, 0.25)])
    return Thing("floor", Quad((0, 0, 0), (4, 0, 0), (0, 4, 0)), Matte(Texture(pixels, (4.8, 4.8))))


def _lamp(seed: int, strength: float) -> RectangleLight:
    """Return a square lamp above the table and to one side, out of all views.

    It is as large as the lobe of a polished surface, so that light that the surface throws onto the objects
    is found by chance as well as by aiming at the lamp, and is no noise.
    """
    rng = stream(seed, "lamp")
    angle = rng.uniform(0, 2 * np.pi)
    position = np.array([0.8 * np.cos(angle), 0.8 * np.sin(angle), HEIGHT + 1.7])
    pose = look_at(position, np.array([0, 0, HEIGHT]))
    right, down = (0.25 * pose[:3, k] for k in (0, 1))
    color = scaled(blackbody(3400), 7.0 * strength)
    return RectangleLight("lamp", triple(position), triple(right), triple(down), color)


def _room(seed: int, strength: float) -> np.ndarray:
    """Walls and two windows, the larger of which lets in daylight."""
    rng = stream(seed, "room")
    day, warm = illuminant("D65"), blackbody(3800)
    side = rng.uniform(0, 360)
    windows = (
        Window(side, 24, 52, 36, scaled(day, 4.5)),
        Window(side + rng.uniform(110, 150), 18, 24, 44, scaled(warm, 2.0)),
    )
    wall = blackbody(5600)
    sky = room(scaled(wall, 0.40), scaled(wall, 0.30), scaled(wall, 0.10), windows)
    return strength * sky


def _path(seed: int) -> tuple[float, float]:
    """Azimuth at which the camera starts, and phase of its bobbing, radians."""
    start, phase = stream(seed, "path").uniform(0, 2 * np.pi, size=2).tolist()
    return start, phase


def _cameras(seed: int, settings: RenderSettings) -> list[Camera]:
    """Half a walk around the table, rising and falling."""
    start, phase = _path(seed)
    cameras = []
    for t in np.linspace(0, 1, settings.views):
        angle, lift = start + _WALK * t, np.radians(34 + 6 * np.sin(7 * t + phase))
        radius = 1.35 + 0.08 * np.cos(9 * t + phase)
        out = np.array([np.cos(angle) * np.cos(lift), np.sin(angle) * np.cos(lift), np.sin(lift)])
        aim = np.array([0, 0, HEIGHT + 0.06])
        pose = look_at(aim + radius * out, aim)
        cameras.append(Camera.from_fov(settings.width, settings.height, 38.0, pose))
    return cameras
