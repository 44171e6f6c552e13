# SPDX-License-Identifier: Apache-2.0
"""Irradiance that a light sends to a point if nothing is in the way: closed forms and numpy quadrature.

Nothing here is shared with the renderer but ``lights.json`` and the conventions of
docs/reference/formats.md.
"""

from typing import Any

import numpy as np

from graycard import (
    Camera,
    EnvironmentLight,
    GaussianLight,
    Light,
    PointLight,
    RectangleLight,
    SphereLight,
    SpotLight,
    world_position,
)

_SIDE = 12
"""Steps along the polar angle of a sphere's cone."""


def unblocked_irradiance(
    light: Light, camera: Camera, points: np.ndarray, normals: np.ndarray, sky: np.ndarray | None
) -> np.ndarray | None:
    """Irradiance of a light at points on surfaces, W/m².

    Args:
        light: Any light but one whose kind is not known here.
        camera: On which lights of the ``camera`` frame are mounted.
        points: World, metres, shape ``(N, 3)``.
        normals: World, unit, on the side that is lit, shape ``(N, 3)``.
        sky: Radiance of an environment light, shape ``(H, W, 3)``.

    Returns:
        Shape ``(N, 3)``; None where there is no formula for the kind of light.
    """
    match light:
        case PointLight() | SpotLight() | GaussianLight():
            return _from_a_point(light, camera, points, normals)
        case RectangleLight():
            return _from_a_rectangle(light, points, normals)
        case SphereLight():
            return _from_a_sphere(light, points, normals)
        case EnvironmentLight() if sky is not None:
            return _from_the_sky(sky, normals)
    return None


def _from_a_point(
    light: PointLight | SpotLight | GaussianLight,
    camera: Camera,
    points: np.ndarray,
    normals: np.ndarray,
) -> np.ndarray:
    """I(w) cos / d²."""
    towards = world_position(light, camera) - points
    square = (towards**2).sum(-1)
    direction = towards / np.sqrt(square)[:, None]
    cosine = np.maximum((direction * normals).sum(-1), 0)
    away = -direction @ camera.camera_to_world[:3, :3] if light.frame == "camera" else -direction
    return _intensity(light, away) * (cosine / square)[:, None]


def _intensity(light: PointLight | SpotLight | GaussianLight, away: np.ndarray) -> np.ndarray:
    """Radiant intensity in directions of the light's own frame, shape ``(N, 3)``, W/sr."""
    match light:
        case PointLight():
            return np.broadcast_to(light.intensity, away.shape)
        case SpotLight():
            return _in_the_cone(light, away)[:, None] * np.array(light.intensity)
        case GaussianLight():
            sums = [
                np.exp(lobe.sharpness * (away @ np.array(lobe.axis) - 1))[:, None] * np.array(lobe.amplitude)
                for lobe in light.lobes
            ]
            return np.sum(sums, axis=0)


def _in_the_cone(light: SpotLight, away: np.ndarray) -> np.ndarray:
    """1 inside the beam, then linear in the angle down to 0 at the cutoff; both are half angles."""
    axis = np.array(light.direction, dtype=np.float64)
    axis /= np.linalg.norm(axis)
    across = np.linalg.norm(np.cross(away, axis), axis=-1)
    angle = np.degrees(np.arctan2(across, away @ axis))
    width = max(light.cutoff_angle - light.beam_width, 1e-9)
    return np.clip((light.cutoff_angle - angle) / width, 0, 1)


def _from_a_rectangle(light: RectangleLight, points: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """Midpoint rule over the area of L cos cos' / d²."""
    u, v = np.array(light.half_u), np.array(light.half_v)
    normal = np.cross(u, v)
    area, normal = 4 * np.linalg.norm(normal), normal / np.linalg.norm(normal)
    across, along = _midpoints(np.linalg.norm(u)), _midpoints(np.linalg.norm(v))
    total = np.zeros(len(points))
    for a, b in ((a, b) for a in across for b in along):
        towards = np.array(light.position) + a * u + b * v - points
        square = (towards**2).sum(-1)
        cosines = np.maximum((towards * normals).sum(-1), 0) * np.maximum(-towards @ normal, 0)
        total += cosines / square**2
    return np.array(light.radiance) * (total * area / (len(across) * len(along)))[:, None]


def _midpoints(half: Any) -> np.ndarray:
    """Middles of equal steps over [-1, 1], short ones on a side of many metres."""
    count = int(np.clip(12 * half, 8, 40))
    return (2 * np.arange(count) + 1) / count - 1


def _from_a_sphere(light: SphereLight, points: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """Midpoint rule over the cone of directions in which the sphere is seen, of L cos."""
    towards = np.array(light.position) - points
    distance = np.linalg.norm(towards, axis=-1)
    axis = towards / distance[:, None]
    least = np.sqrt(np.maximum(1 - (light.radius / distance) ** 2, 0))
    side, up = _frame(axis)
    total = np.zeros(len(points))
    for step in (np.arange(_SIDE) + 0.5) / _SIDE:
        cosine = (1 - step * (1 - least))[:, None]
        sine = np.sqrt(1 - cosine**2)
        for turn in 2 * np.pi * (np.arange(2 * _SIDE) + 0.5) / (2 * _SIDE):
            direction = cosine * axis + sine * (np.cos(turn) * side + np.sin(turn) * up)
            total += np.maximum((direction * normals).sum(-1), 0)
    solid_angle = 2 * np.pi * (1 - least)
    return np.array(light.radiance) * (total * solid_angle / (2 * _SIDE**2))[:, None]


def _frame(axis: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Two unit vectors across each axis and across one another."""
    helper = np.eye(3)[np.argmin(np.abs(axis), axis=-1)]
    side = np.cross(axis, helper)
    side /= np.linalg.norm(side, axis=-1, keepdims=True)
    return side, np.cross(axis, side)


def _from_the_sky(sky: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """Sum over the pixels of the environment of L cos dω."""
    directions, solid_angle = sky_directions(sky)
    sent = sky.reshape(-1, 3) * solid_angle[:, None]
    return np.maximum(normals.astype(np.float32) @ directions.T.astype(np.float32), 0) @ sent.astype(
        np.float32
    )


def sky_directions(sky: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """World directions ``(H W, 3)`` and solid angles ``(H W,)`` of the pixels of an environment."""
    height, width = sky.shape[:2]
    polar = np.repeat(np.pi * (np.arange(height) + 0.5) / height, width)
    azimuth = np.tile(2 * np.pi * (np.arange(width) + 0.5) / width, height)
    directions = np.stack(
        [np.sin(polar) * np.cos(azimuth), np.sin(polar) * np.sin(azimuth), np.cos(polar)], axis=-1
    )
    edges = np.cos(np.pi * np.arange(height + 1) / height)
    return directions, np.repeat((edges[:-1] - edges[1:]) * 2 * np.pi / width, width)


def sky_towards(sky: np.ndarray, directions: np.ndarray) -> np.ndarray:
    """Radiance from world directions, bilinear between the pixels' centres, shape ``(N, 3)``."""
    height, width = sky.shape[:2]
    row = np.arccos(np.clip(directions[:, 2], -1, 1)) / np.pi * height - 0.5
    column = np.arctan2(directions[:, 1], directions[:, 0]) / (2 * np.pi) * width - 0.5
    top, left = np.floor(row).astype(int), np.floor(column).astype(int)
    down, right = (row - top)[:, None], (column - left)[:, None]
    rows = [np.clip(top + k, 0, height - 1) for k in (0, 1)]
    columns = [(left + k) % width for k in (0, 1)]
    upper, lower = (sky[r, columns[0]] * (1 - right) + sky[r, columns[1]] * right for r in rows)
    return upper * (1 - down) + lower * down
