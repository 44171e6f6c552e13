# SPDX-License-Identifier: Apache-2.0
"""A floor and a board over it, of surfels that are known, under lamps that are known."""

from dataclasses import dataclass

import numpy as np
import torch

from graycard import Camera, PointLight, look_at
from graycard.methods.gsid._guess import MaterialGuess
from graycard.methods.gsid._model import (
    BASE_COLOR,
    METALLIC,
    OPEN,
    ROUGHNESS,
    SHADOW,
    Reach,
    ground_of,
    picture_of,
    pixels_of,
    shadows_of,
)
from graycard.methods.gsid._objective import DeferredView
from graycard.methods.shading import (
    Lamps,
    lamp_visibility,
    lamps_of,
    outward,
    surroundings_of,
)
from graycard.methods.splat import Surfels, parameters_of, surfels_from_points, surfels_of
from graycard.methods.surfels import srgb_encode_tensor

LAMPS = (
    PointLight("a", (0.7, 0.3, 1.1), (1.5, 1.2, 0.9)),
    PointLight("b", (-0.8, -0.5, 0.9), (0.5, 0.7, 1.0)),
)
EXTENT = 1.5


def sheet(middle: tuple[float, float, float], half: float, spacing: float) -> np.ndarray:
    steps = np.arange(-half, half + spacing / 2, spacing)
    x, y = np.meshgrid(steps, steps)
    return np.stack([x, y, 0 * x], axis=-1).reshape(-1, 3) + middle


@dataclass(frozen=True)
class World:
    """Surfels with materials, and views of them under the lamps and a grey sky."""

    surface: dict[str, torch.Tensor]
    normals: torch.Tensor
    shots: list[DeferredView]
    lamps: Lamps

    @property
    def surfels(self) -> Surfels:
        return surfels_of(self.surface)


def lit_sheets() -> World:
    """Four views from above."""
    floor, board = sheet((0, 0, 0), 1.2, 0.06), sheet((0.1, 0.1, 0.35), 0.24, 0.04)
    places = np.concatenate([floor, board])
    discs = surfels_from_points(places, np.tile([0.0, 0.0, 1.0], (len(places), 1)), np.full_like(places, 0.5))
    cameras = [
        Camera.from_fov(36, 32, 55, look_at(np.array([x, y, 1.9]), np.array([0.05, 0.05, 0.1])))
        for x, y in ((0.8, -1.2), (-0.9, -1.0), (0.1, -1.4), (1.2, 0.4))
    ]
    eyes = torch.tensor(np.array([camera.position for camera in cameras])).float()
    checks = torch.from_numpy((np.floor(places * 3 + 0.01).sum(axis=1) % 2).astype(np.float32))[:, None]
    count = len(places)
    surface = dict(parameters_of(discs).surfels)
    surface["opacity_logits"] = torch.full((count,), 5.0)
    surface[BASE_COLOR] = torch.logit(0.3 + 0.4 * checks * torch.tensor([1.0, 0.7, 0.5]))
    surface[ROUGHNESS] = torch.logit(torch.full((count, 1), 0.6))
    surface[METALLIC] = torch.logit(torch.full((count, 1), 0.05))
    surface[OPEN] = torch.ones(count)
    normals = outward(surfels_of(surface), eyes)
    surface[SHADOW] = -normals
    lamps = lamps_of(list(LAMPS))
    return World(surface, normals, photographed(surface, cameras, lamps), lamps)


def photographed(surface: dict[str, torch.Tensor], cameras: list[Camera], lamps: Lamps) -> list[DeferredView]:
    surfels, sky = surfels_of(surface), surroundings_of(torch.full((6, 4, 4, 3), 0.05))
    reached = lamp_visibility(surfels, surfels.centres, lamps.positions, EXTENT)
    shots = []
    for camera in cameras:
        ground = ground_of(surfels, camera, surface[OPEN])
        pixels = pixels_of(surface, ground)
        shadows = shadows_of(surfels, camera, reached)
        linear = picture_of(pixels, lamps, sky, Reach(shadows), "traced", EXTENT).whole
        known = MaterialGuess(
            ground.normal,
            *(getattr(pixels.material, name) for name in ("base_color", "roughness", "metallic")),
        )
        shots.append(DeferredView(linear, srgb_encode_tensor(linear), ground, known))
    return shots
