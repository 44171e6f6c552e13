# SPDX-License-Identifier: Apache-2.0
"""Light of lamps that are known, on surfaces that were found: nothing is learnt."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import assert_never

import numpy as np
import torch
from torch.nn.functional import normalize

from graycard import Camera, GaussianLight, LocalLight, PointLight, RectangleLight, SphereLight, SpotLight
from graycard.methods.shading._lamps import arriving, lamps_of

SAMPLES = 8
"""Points along each side of a rectangle."""
_AT_ONCE = 1 << 13
"""Surface points that are lit at once."""


@dataclass(frozen=True, eq=False)
class KnownLamps:
    """Points that stand for lights of any kind, as :func:`arriving` takes them; world axes."""

    positions: torch.Tensor
    """Shape ``(K, 3)``, metres."""
    lights: tuple[LocalLight, ...]
    points: tuple[int, ...]
    """Counts: how many of the positions stand for each light, in the order of the lights."""
    turns: tuple[torch.Tensor, ...]
    """Shape ``(3, 3)``: turns rows of world axes into those of each light, multiplied from the right."""

    def intensity(self, away: torch.Tensor) -> torch.Tensor:
        """Radiant intensity in directions away from the points.

        Args:
            away: Shape ``(..., K, 3)``, unit, world.

        Returns:
            Shape ``(..., K, 3)``, W/sr.
        """
        parts = [
            _intensity(light, directions @ turn) / count
            for light, count, turn, directions in zip(
                self.lights, self.points, self.turns, away.split(self.points, dim=-2), strict=True
            )
        ]
        return torch.cat([away[..., :0, :], *parts], dim=-2)


def known_lamps(
    lights: Sequence[LocalLight],
    camera: Camera,
    samples: int = SAMPLES,
    dtype: torch.dtype = torch.float32,
) -> KnownLamps:
    """Points that stand for lights: one each, and a grid for a rectangle.

    Args:
        lights: Of the scene; those on the camera are where this camera has them.
        camera: That looks.
        samples: Points along each side of a rectangle.
        dtype: Of the tensors.
    """
    world = np.eye(3), np.zeros(3)
    mounted = camera.camera_to_world[:3, :3], camera.position
    frames = [mounted if light.frame == "camera" else world for light in lights]
    found = [_places(light, samples) for light in lights]
    places = [own @ turn.T + place for own, (turn, place) in zip(found, frames, strict=True)]
    return KnownLamps(
        torch.tensor(np.concatenate([np.zeros((0, 3)), *places]), dtype=dtype),
        tuple(lights),
        tuple(len(own) for own in found),
        tuple(torch.tensor(turn, dtype=dtype) for turn, _ in frames),
    )


def light_at(
    lights: Sequence[LocalLight], points: np.ndarray, normals: np.ndarray, camera: Camera
) -> np.ndarray:
    """Return what matte surfaces of albedo 1 send back of lights that reach them unhindered.

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
    lamps = known_lamps(lights, camera, dtype=torch.float64)
    at, facing = (torch.from_numpy(np.ascontiguousarray(x[seen], np.float64)) for x in (points, normals))
    parts = []
    for some, normal in zip(at.split(_AT_ONCE), facing.split(_AT_ONCE), strict=True):
        arrival = arriving(lamps, some)
        cosine = (arrival.toward * normal[:, None]).sum(dim=-1, keepdim=True).relu()
        parts.append((arrival.facing * cosine).sum(dim=-2) / torch.pi)
    total[seen] = torch.cat([at[:0], *parts]).numpy()
    return total


def _places(light: LocalLight, samples: int) -> np.ndarray:
    """Points that stand for a light, in its own axes, shape ``(K, 3)``."""
    centre = np.array(light.position)
    if not isinstance(light, RectangleLight):
        return centre[None]
    steps = (np.arange(samples) + 0.5) / samples * 2 - 1
    u, v = np.meshgrid(steps, steps)
    return centre + u.reshape(-1, 1) * np.array(light.half_u) + v.reshape(-1, 1) * np.array(light.half_v)


def _intensity(light: LocalLight, directions: torch.Tensor) -> torch.Tensor:
    """Radiant intensity of the whole light in unit directions away from it, in its own axes, W/sr."""
    axial = directions.new_tensor(light.axial_intensity)
    match light:
        case PointLight() | SphereLight():
            return axial.expand(directions.shape)
        case SpotLight():
            return axial * _beam(light, directions)
        case GaussianLight():
            return lamps_of([light], directions.dtype).intensity(directions)
        case RectangleLight():
            facing = directions @ _unit(directions, np.cross(light.half_u, light.half_v))
            return axial * facing.relu()[..., None]
        case _:
            assert_never(light)


def _beam(light: SpotLight, directions: torch.Tensor) -> torch.Tensor:
    """1 inside the beam, 0 outside the cone, linear in the angle between, shape ``(..., 1)``."""
    cosine = directions @ _unit(directions, np.array(light.direction))
    angle = torch.rad2deg(torch.acos(cosine.clamp(-1, 1)))[..., None]
    if light.cutoff_angle == light.beam_width:
        return (angle <= light.cutoff_angle).to(directions.dtype)
    return ((light.cutoff_angle - angle) / (light.cutoff_angle - light.beam_width)).clamp(0, 1)


def _unit(like: torch.Tensor, vector: np.ndarray) -> torch.Tensor:
    return normalize(like.new_tensor(vector), dim=-1)
