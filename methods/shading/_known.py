# SPDX-License-Identifier: Apache-2.0
"""Light of lamps that are known, on surfaces that were found: nothing is learnt, nothing casts a shadow."""

from collections.abc import Sequence

import numpy as np

from graycard import (
    Camera,
    GaussianLight,
    LocalLight,
    PointLight,
    RectangleLight,
    SphereLight,
    SpotLight,
)

SAMPLES = 8
"""Points along each side of a rectangle."""
_NEAREST = 1e-6
"""Metres: at a lamp itself the falloff has no value."""


def light_at(
    lights: Sequence[LocalLight], points: np.ndarray, normals: np.ndarray, camera: Camera
) -> np.ndarray:
    """What matte surfaces of albedo 1 send back of lights that reach them unhindered.

    ``sum I(w) max(0, n . -w) / (pi d^2)`` over the points of the lights, with the radiant intensity I in the
    direction w to the surface and the distance d.

    Args:
        lights: Of the scene; those on the camera are where this camera has them.
        points: Shape ``(..., 3)``, world, metres; no light where they are not finite.
        normals: Shape ``(..., 3)``, world, unit.
        camera: That looks.

    Returns:
        Shape ``(..., 3)``, float64, W/m²/sr.
    """
    total = np.zeros(points.shape)
    seen = np.isfinite(points).all(axis=-1)
    for light in lights:
        at, facing = points[seen].astype(np.float64), normals[seen].astype(np.float64)
        if light.frame == "camera":
            turn = camera.camera_to_world[:3, :3]
            at, facing = (at - camera.position) @ turn, facing @ turn
        total[seen] += _received(light, at, facing)
    return total


def _received(light: LocalLight, points: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """Of one light, in its own axes, shape ``(N, 3)``."""
    places = _places(light)
    total = np.zeros(points.shape)
    for place in places:
        away = points - place
        distance = np.linalg.norm(away, axis=-1, keepdims=True).clip(min=_NEAREST)
        directions = away / distance
        cosine = -(directions * normals).sum(axis=-1, keepdims=True)
        total += _intensity(light, directions) * cosine.clip(min=0) / distance**2
    return total / (np.pi * len(places))


def _places(light: LocalLight) -> np.ndarray:
    """Points that stand for a light, shape ``(K, 3)``."""
    centre = np.array(light.position)
    if not isinstance(light, RectangleLight):
        return centre[None]
    steps = (np.arange(SAMPLES) + 0.5) / SAMPLES * 2 - 1
    u, v = np.meshgrid(steps, steps)
    return centre + u.reshape(-1, 1) * np.array(light.half_u) + v.reshape(-1, 1) * np.array(light.half_v)


def _intensity(light: LocalLight, directions: np.ndarray) -> np.ndarray:
    """Radiant intensity of the whole light in unit directions away from it, shape ``(N, 3)``, W/sr."""
    match light:
        case PointLight() | SphereLight():
            return np.broadcast_to(light.axial_intensity, directions.shape)
        case SpotLight():
            return light.axial_intensity * _beam(light, directions)
        case GaussianLight():
            return light.intensity_towards(directions)
        case RectangleLight():
            cosine = directions @ _unit(np.cross(light.half_u, light.half_v))
            return light.axial_intensity * cosine.clip(min=0)[..., None]


def _beam(light: SpotLight, directions: np.ndarray) -> np.ndarray:
    """1 inside the beam, 0 outside the cone, linear in the angle between, shape ``(N, 1)``."""
    angle = np.degrees(np.arccos(np.clip(directions @ _unit(np.array(light.direction)), -1, 1)))[..., None]
    if light.cutoff_angle == light.beam_width:
        return (angle <= light.cutoff_angle).astype(np.float64)
    return ((light.cutoff_angle - angle) / (light.cutoff_angle - light.beam_width)).clip(0, 1)


def _unit(vector: np.ndarray) -> np.ndarray:
    return vector / np.linalg.norm(vector)
