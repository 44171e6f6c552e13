# SPDX-License-Identifier: Apache-2.0
"""The tabletop track: objects on a polished table, one of which is to be removed with its reflection."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

import graycard as gc
from graycard.synth import _props as props
from graycard.synth import _textures as textures
from graycard.synth._family import check_knobs, interleaved, knob, stream
from graycard.synth._mesh import blob, box, torus
from graycard.synth._scene import Ball, Glossy, Matte, Quad, Scene, Texture, Thing, surface_of
from graycard.synth._sky import Window, room
from graycard.synth._spec import RenderSettings
from graycard.synth._spectra import blackbody, illuminant, paint, scaled

TOP = 0.75
"""Height of the table top, metres."""


@dataclass(frozen=True, slots=True)
class GlossyTable:
    """A polished table in a room with windows, with four objects on it.

    Raises:
        ValueError: A knob is out of its range.
    """

    roughness: float = knob(0.1, 0.03, 0.8)
    """Of the table top: square root of the GGX alpha."""
    metallic: float = knob(0.0, 0.0, 1.0)
    """Of the table top: 0 lacquered wood, 1 metal."""
    daylight: float = knob(1.0, 0.0, 5.0)
    """Factor on the light of the room around."""
    lamp: float = knob(1.0, 0.0, 10.0)
    """Factor on the lamp above the table."""

    track: ClassVar[str] = "tabletop"
    name: ClassVar[str] = "glossy-table"
    title: ClassVar[str] = "objects on a polished table by a window; the vase is to be removed"

    def __post_init__(self) -> None:
        check_knobs(self)

    def build(self, seed: int, settings: RenderSettings) -> Scene:
        """The table of a seed."""
        lamp = _lamp(seed, self.lamp)
        return Scene(
            things=(*_floor(seed), self._table(seed), *_objects(seed), surface_of(lamp)),
            lights=(lamp, gc.EnvironmentLight("room", "environment.exr")),
            views=interleaved(_cameras(seed, settings), settings.test_views),
            sky=_room(seed, self.daylight),
            target="vase",
        )

    def _table(self, seed: int) -> Thing:
        rng = stream(seed, "table")
        tone = ((0.20, 0.085, 0.04), (0.13, 0.10, 0.075), (0.26, 0.15, 0.07))[rng.integers(3)]
        color = tone if self.metallic < 0.5 else scaled(tone, 2.5)
        top = box((1.5, 1.1, 0.05), 0.015).moved((0, 0, TOP - 0.025))
        polish = Glossy(
            Texture(textures.wood(rng, color), (1.3, 1.3)), self.roughness, self.metallic, specular=1.0
        )
        return Thing("table", top, polish)


def _objects(seed: int) -> Iterator[Thing]:
    """The vase in the middle and three objects around it, none of which touches another."""
    yield _vase(seed)
    rng = stream(seed, "objects")
    start, sense = rng.uniform(0, 2 * np.pi), rng.choice([-1, 1])
    angles = start + sense * (np.array([0.0, 2.1, 4.2]) + rng.uniform(-0.25, 0.25, size=3))
    ring, casket, pebble = ((0.36 * float(np.cos(a)), 0.27 * float(np.sin(a)), TOP) for a in angles)
    yield from _lime_on_ring(seed, ring)
    cover = textures.tiles(rng, [paint("orange yellow"), scaled(paint("purplish blue"), 1.1)], 4)
    box_ = props.crate(0.17, 0.13, 0.12, 0.008).moved(casket, rng.uniform(0, 6))
    yield Thing("casket", box_, Matte(Texture(cover, (6, 6))))
    grays = textures.stone(rng, [(0.16, 0.15, 0.14), (0.36, 0.34, 0.31), (0.58, 0.56, 0.52)])
    stone = blob(0.085, rng).moved(pebble).moved((0, 0, 0.082))
    yield Thing("stone", stone, Matte(Texture(grays, (2, 1))))


def _vase(seed: int) -> Thing:
    rng = stream(seed, "vase")
    cream, navy = (0.6, 0.55, 0.45), (0.05, 0.07, 0.16)
    clay = textures.bands(rng, scaled(paint("moderate red"), 0.9), [cream, navy, cream])
    x, y = rng.uniform(-0.04, 0.04, size=2)
    shape = props.vase(rng, rng.uniform(0.27, 0.32), 0.17).moved((x, y, TOP))
    return Thing("vase", shape, Glossy(Texture(clay, (2, 1)), 0.3))


def _lime_on_ring(seed: int, at: tuple[float, float, float]) -> Iterator[Thing]:
    rng = stream(seed, "ring")
    glaze = textures.stone(rng, [(0.04, 0.16, 0.20), (0.07, 0.27, 0.30), (0.20, 0.42, 0.40)])
    yield Thing("ring", torus(0.085, 0.035).moved(at).moved((0, 0, 0.035)), Matte(Texture(glaze)))
    peel = textures.plaster(rng, scaled(paint("yellow green"), 0.9))
    yield Thing("lime", Ball((at[0], at[1], TOP + 0.076), 0.046), Glossy(Texture(peel), 0.4))


def _floor(seed: int) -> Iterator[Thing]:
    pixels = textures.tiles(stream(seed, "floor"), [(0.34, 0.34, 0.32), (0.22, 0.25, 0.25)])
    yield Thing("floor", Quad((0, 0, 0), (4, 0, 0), (0, 4, 0)), Matte(Texture(pixels, (4.8, 4.8))))
    trestle = box((1.1, 0.7, TOP - 0.05), 0.02).moved((0, 0, (TOP - 0.05) / 2))
    yield Thing("trestle", trestle, Matte((0.12, 0.11, 0.11)))


def _lamp(seed: int, strength: float) -> gc.RectangleLight:
    """A square lamp above the table and to one side, out of all views."""
    rng = stream(seed, "lamp")
    angle = rng.uniform(0, 2 * np.pi)
    position = np.array([0.8 * np.cos(angle), 0.8 * np.sin(angle), TOP + 1.7])
    forward = np.array([0, 0, TOP]) - position
    pose = gc.look_at(position, position + forward)
    right, down = (0.16 * pose[:3, k] for k in (0, 1))
    return gc.RectangleLight(
        "lamp", _triple(position), _triple(right), _triple(down), scaled(blackbody(3400), 14.0 * strength)
    )


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


def _cameras(seed: int, settings: RenderSettings) -> list[gc.Camera]:
    """Half a walk around the table, rising and falling."""
    rng = stream(seed, "path")
    start, phase = rng.uniform(0, 2 * np.pi, size=2)
    cameras = []
    for t in np.linspace(0, 1, settings.views):
        angle, lift = start + 2.6 * t, np.radians(34 + 6 * np.sin(7 * t + phase))
        radius = 1.35 + 0.08 * np.cos(9 * t + phase)
        out = np.array([np.cos(angle) * np.cos(lift), np.sin(angle) * np.cos(lift), np.sin(lift)])
        aim = np.array([0, 0, TOP + 0.06])
        pose = gc.look_at(aim + radius * out, aim)
        cameras.append(gc.Camera.from_fov(settings.width, settings.height, 42.0, pose))
    return cameras


def _triple(v: np.ndarray) -> tuple[float, float, float]:
    x, y, z = v.tolist()
    return x, y, z
