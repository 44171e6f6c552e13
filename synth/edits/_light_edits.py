# SPDX-License-Identifier: Apache-2.0
"""Changes of a scene's lights that a method is to foretell: which there are follows from the scene.

=====================  ===================================================================================
``without-<light>``    each light switched off, one by one, where there are two or more
``flash-moved``        a light on the camera, mounted on its other side
``flash-recoloured``   the same light in another colour
``recoloured-<light>`` the strongest other local light in another colour
``moved-<light>``      the strongest other local light some decimetres away
``environment-<n>``    all lights off, and surroundings that were not there when the photographs were taken
=====================  ===================================================================================

Scenes of which an object is to be removed have neither of the last two: their question is another one.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from graycard import (
    EnvironmentLight,
    GaussianLight,
    Light,
    LightEdit,
    LocalLight,
    PointLight,
    RectangleLight,
    SphereLight,
    SpotLight,
    View,
    luminance,
    world_position,
)
from graycard.synth._scene import Scene, Thing, surface_of, triple
from graycard.synth._sky import Window, room
from graycard.synth._spectra import Vector, blackbody, illuminant, scaled
from graycard.synth._stream import stream
from graycard.synth.edits._free_space import Obstacles, is_seen, looked_at, obstacles

_COLORS = {"2600 K": 2600.0, "4200 K": 4200.0, "7500 K": 7500.0, "15000 K": 15000.0}
"""Temperatures of the black bodies whose colours lights are given."""
_CLEAR = 0.8
"""Least change of ln(red / blue): from 4200 K to 6500 K it is 0.8."""
_TRIES = 400


@dataclass(frozen=True, slots=True)
class Edit:
    """A change of the lights, and the scene after it."""

    record: LightEdit
    scene: Scene
    factors: Mapping[str, Vector] | None = None
    """By which the light of each source is multiplied, per channel, 1 where it is not named; None where
    light comes from another place, so that the picture does not follow from that of the lights before."""


def light_edits(scene: Scene, seed: int) -> tuple[Edit, ...]:
    """Return the changes of a scene's lights, as the table above says.

    Args:
        scene: As it was photographed.
        seed: Of the scene; what is drawn is drawn from it.
    """
    edits = list(_switched_off(scene))
    flash = next((light for light in _local(scene) if light.frame == "camera"), None)
    if flash is not None:
        edits += [*_flash_moved(scene, flash, seed), *_recoloured(scene, flash, "flash-recoloured", seed)]
        return tuple(edits)
    lamps = sorted(_local(scene), key=lambda light: -_strength(light, looked_at(scene.views)))
    if lamps:
        edits += _recoloured(scene, lamps[0], f"recoloured-{lamps[0].name}", seed)
    if not scene.target:
        edits += [*_moved(scene, lamps, seed), *_environments(scene, seed)]
    return tuple(edits)


def _switched_off(scene: Scene) -> Iterator[Edit]:
    if len(scene.lights) < 2:
        return
    for light in scene.lights:
        record = LightEdit(f"without-{light.name}", f"The light {light.name!r} is switched off.")
        kept = tuple(other for other in scene.lights if other.name != light.name)
        yield Edit(record, _relit(scene, kept), {light.name: (0.0, 0.0, 0.0)})


def _recoloured(scene: Scene, light: LocalLight, name: str, seed: int) -> Iterator[Edit]:
    """Yield the light in a clearly different colour of the same luminance."""
    before = light.axial_intensity
    if not (before > 0).all():
        return
    choices = {
        words: color
        for words, kelvin in _COLORS.items()
        if abs(_warmth(color := blackbody(kelvin)) - _warmth(before)) > _CLEAR
    }
    words = str(stream(seed, f"recoloured {light.name}").choice(list(choices)))
    r, g, b = (np.array(choices[words]) * luminance(before) / before).tolist()
    changed = tuple(scaled_light(x, (r, g, b)) if x is light else x for x in scene.lights)
    summary = (
        f"The light {light.name!r} has the colour of a black body of {words}, and its luminance as before."
    )
    yield Edit(LightEdit(name, summary), _relit(scene, changed), {light.name: (r, g, b)})


def _flash_moved(scene: Scene, flash: LocalLight, seed: int) -> Iterator[Edit]:
    """Yield the light on the other side of the camera, aimed at the point of its optical axis as before."""
    rng = stream(seed, "flash moved")
    solids = obstacles(scene)
    side = -1.0 if flash.position[0] >= 0 else 1.0
    for _ in range(_TRIES):
        x, y = side * rng.uniform(0.2, 0.4), rng.uniform(-0.25, 0.1)
        moved = _aimed(flash, np.array([x, y, flash.position[2]]))
        places = [world_position(moved, v.camera) for v in scene.views if v.split == "test"]
        if solids.leave_free(np.array(places), 0.04):
            words = f"{100 * x:+.0f} cm, {100 * y:+.0f} cm"
            before = ", ".join(f"{100 * c:+.0f} cm" for c in flash.position[:2])
            summary = (
                f"The light {flash.name!r} on the camera is at {words} (right, down) instead of {before}."
            )
            record = LightEdit("flash-moved", summary)
            yield Edit(record, _relit(scene, _with(scene.lights, moved)))
            return


def _moved(scene: Scene, lamps: list[LocalLight], seed: int) -> Iterator[Edit]:
    """Yield the strongest light that has room to be moved, out of all views."""
    for lamp in lamps:
        rng, solids = stream(seed, f"moved {lamp.name}"), obstacles(scene, but=(lamp.name,))
        for _ in range(_TRIES):
            shift = rng.uniform((-0.8, -0.8, -0.3), (0.8, 0.8, 0.3))
            moved = _aimed(lamp, np.array(lamp.position) + shift, looked_at(scene.views))
            if np.linalg.norm(shift) >= 0.45 and _fits(scene.views, solids, moved):
                words = ", ".join(f"{100 * c:+.0f} cm" for c in shift)
                summary = f"The light {lamp.name!r} is moved by {words} (x, y, z)."
                record = LightEdit(f"moved-{lamp.name}", summary)
                yield Edit(record, _relit(scene, _with(scene.lights, moved)))
                return


def _fits(views: Sequence[View], solids: Obstacles, lamp: LocalLight) -> bool:
    """Return whether a lamp has air around it, is in no picture, and nearer than half a metre to no
    camera.
    """
    points = np.array(lamp.position) + _extent(lamp)
    far = min(np.linalg.norm(points - view.camera.position, axis=-1).min() for view in views) > 0.5
    return far and not is_seen(views, points) and solids.leave_free(points, 0.08)


def _extent(lamp: LocalLight) -> np.ndarray:
    """Corners of a light relative to its position, ``(N, 3)``."""
    match lamp:
        case RectangleLight():
            signs = np.array([(0, 0), (1, 1), (1, -1), (-1, 1), (-1, -1)])
            return signs @ np.array([lamp.half_u, lamp.half_v])
        case SphereLight():
            return lamp.radius * np.concatenate([np.zeros((1, 3)), np.eye(3), -np.eye(3)])
        case _:
            return np.zeros((1, 3))


def _aimed(light: LocalLight, position: np.ndarray, near: np.ndarray | None = None) -> LocalLight:
    """Return a light at another position; a spot light still shines on the point that it was aimed at.

    This is the point of its axis that is nearest to ``near``; of a light on the camera, the one 3 m ahead.
    """
    place = triple(position)
    if not isinstance(light, SpotLight):
        return replace(light, position=place)
    axis, start = np.array(light.direction), np.array(light.position)
    reach = 3.0 / axis[2] if near is None else (near - start) @ axis / (axis @ axis)
    return replace(light, position=place, direction=triple(start + reach * axis - position))


def _environments(scene: Scene, seed: int) -> Iterator[Edit]:
    """Two surroundings about as bright as all the lights that were there, lit from either side."""
    center = looked_at(scene.views)
    out = np.mean([view.camera.position for view in scene.views], axis=0) - center
    facing = float(np.degrees(np.arctan2(out[1], out[0])))
    name = next((x.name for x in scene.lights if isinstance(x, EnvironmentLight)), "environment")
    lights = (EnvironmentLight(name, "environment.exr"),)
    for number, (words, sky) in enumerate(_skies(facing, seed), start=1):
        sky *= _brightness(scene, center) / _fluence(sky)
        summary = f"All lights are off; the surroundings are {words}."
        record = LightEdit(f"environment-{number}", summary)
        yield Edit(record, replace(_relit(scene, lights), sky=sky))


def _skies(facing: float, seed: int) -> Iterator[tuple[str, np.ndarray]]:
    rng = stream(seed, "held-out environments")
    side = rng.choice([-1, 1])
    gray, day = blackbody(6500), illuminant("D65")
    window = Window(facing + side * rng.uniform(35, 60), rng.uniform(35, 50), 50, 40, scaled(day, 6.0))
    yield "a gray day and one large window", room(scaled(gray, 0.5), scaled(gray, 0.35), gray, (window,))
    blue, gold = blackbody(12000), blackbody(2900)
    sun = Window(facing - side * rng.uniform(40, 65), rng.uniform(22, 32), 16, 16, scaled(gold, 60.0))
    yield (
        "a blue evening and a low sun",
        room(scaled(blue, 0.6), scaled(blue, 0.4), scaled(gold, 0.3), (sun,)),
    )


def _brightness(scene: Scene, center: np.ndarray) -> float:
    """Luminance of all light that arrives at a point from anywhere, W/m², were nothing in its way."""
    local = sum(_strength(light, center) for light in _local(scene))
    return local + (0.0 if scene.sky is None else _fluence(scene.sky))


def _fluence(sky: np.ndarray) -> float:
    """Luminance of a sky over all directions, W/m²."""
    height, width = sky.shape[:2]
    polar = np.pi * np.arange(height) / (height - 1)
    pixel = np.sin(polar) * (np.pi / (height - 1)) * (2 * np.pi / width)
    return float(luminance((pixel[:, None, None] * sky).sum(axis=(0, 1))))


def _strength(light: LocalLight, center: np.ndarray) -> float:
    distance = np.linalg.norm(np.array(light.position) - center)
    return float(luminance(light.axial_intensity) / distance**2)


def scaled_light(light: Light, factor: Vector) -> Light:
    """Return a local light times a factor per channel."""
    match light:
        case PointLight() | SpotLight():
            return replace(light, intensity=triple(np.array(light.intensity) * factor))
        case GaussianLight():
            lobes = [replace(x, amplitude=triple(np.array(x.amplitude) * factor)) for x in light.lobes]
            return replace(light, lobes=tuple(lobes))
        case RectangleLight() | SphereLight():
            return replace(light, radiance=triple(np.array(light.radiance) * factor))
    raise ValueError(f"expected a local light, got {type(light).__name__}")


def _relit(scene: Scene, lights: tuple[Light, ...]) -> Scene:
    """Return the scene under other lights; the surface of one that is off stays, black as it is."""
    sky = scene.sky if any(isinstance(light, EnvironmentLight) for light in lights) else None
    return replace(scene, lights=lights, things=tuple(_surface(t, lights) for t in scene.things), sky=sky)


def _surface(thing: Thing, lights: tuple[Light, ...]) -> Thing:
    light = next((x for x in lights if x.name == thing.light), None)
    if isinstance(light, RectangleLight | SphereLight):
        return surface_of(light)
    return replace(thing, light="")


def _with(lights: tuple[Light, ...], changed: LocalLight) -> tuple[Light, ...]:
    return tuple(changed if light.name == changed.name else light for light in lights)


def _local(scene: Scene) -> list[LocalLight]:
    return [light for light in scene.lights if not isinstance(light, EnvironmentLight)]


def _warmth(color: Vector | np.ndarray) -> float:
    """ln(red / blue)."""
    return float(np.log(color[0] / color[2]))
