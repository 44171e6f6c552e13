# SPDX-License-Identifier: Apache-2.0
"""A glossy floor with two boards over it, of surfels that are known; one of the boards is the object."""

from dataclasses import dataclass, replace

import numpy as np
import torch

from graycard import Camera, look_at
from graycard.methods.goris import GorisSettings
from graycard.methods.goris._filter import translation_parameters
from graycard.methods.goris._model import (
    BRIGHTEST,
    DIFFUSE,
    FRESNEL,
    LABEL,
    REGION,
    ROUGHNESS,
    SURROUNDINGS,
    Buffers,
    GlossyPicture,
    drawn_buffers,
    picture_of,
)
from graycard.methods.goris._training_views import TrainingView
from graycard.methods.splat import SH_DC, Parameters, parameters_of, surfels_from_points
from graycard.methods.surfels import COEFFICIENTS, DETAIL, SKY, EncodedPhotograph, sky_basis

EXTENT = 1.5
SETTINGS = GorisSettings(iterations=40, surfels=2000, sky_size=4, filter="none", normal_weight=0.0)
FLOOR, BOARD, OBJECT = 0, 1, 2
_FIRM = 6.0
"""Logit of what is nearly 1."""


@dataclass(frozen=True)
class GlossyWorld:
    """Surfels that send light on, and what each of them is part of."""

    parameters: Parameters
    part: np.ndarray
    """Shape ``(N,)``: FLOOR, BOARD or OBJECT."""
    cameras: list[Camera]

    def changed(self, **parts: torch.Tensor) -> dict[str, torch.Tensor]:
        """All parameters, some of them others."""
        return {**self.parameters.all, **parts}


def glossy_world() -> GlossyWorld:
    """Four cameras look down on it."""
    floor = _grid(1.2, 0.06)
    floor = np.stack([floor[:, 0], floor[:, 1], 0 * floor[:, 0]], axis=1)
    boards = [_upright(-0.3, 0.3), _upright(0.3, -0.1)]
    places = np.concatenate([floor, *boards])
    part = np.repeat([FLOOR, BOARD, OBJECT], [len(floor), *map(len, boards)])
    normals = np.where(part[:, None] == FLOOR, (0.0, 0.0, 1.0), (0.0, -1.0, 0.0))
    colours = np.array([(0.3, 0.3, 0.3), (0.8, 0.3, 0.2), (0.2, 0.4, 0.9)])[part]
    checks = np.floor(places * 6 + 0.01).sum(axis=1) % 2
    discs = surfels_from_points(places, normals, colours * (0.6 + 0.4 * checks[:, None]), opacity=0.99)
    return GlossyWorld(_parameters(discs, part), part, [_above(*place) for place in _PLACES])


_PLACES = ((0.5, -1.5), (-0.6, -1.4), (0.0, -1.7), (0.9, -1.2))


def _above(x: float, y: float) -> Camera:
    return Camera.from_fov(44, 36, 55, look_at(np.array([x, y, 1.1]), np.array([0.0, 0.1, 0.1])))


def _grid(half: float, spacing: float) -> np.ndarray:
    steps = np.arange(-half, half + spacing / 2, spacing)
    x, y = np.meshgrid(steps, steps)
    return np.stack([x.ravel(), y.ravel()], axis=1)


def _upright(x: float, y: float) -> np.ndarray:
    across = _grid(0.2, 0.04)
    return np.stack([x + across[:, 0], np.full(len(across), y), 0.27 + across[:, 1]], axis=1)


def _parameters(discs, part: np.ndarray) -> Parameters:
    count = len(discs)
    even = torch.ones(count, 1)
    floor = torch.from_numpy(part == FLOOR)[:, None]
    own = {
        COEFFICIENTS: ((discs.features - 0.5) / SH_DC)[:, None].float(),
        DETAIL: torch.zeros(count, 15, 3),
        DIFFUSE: torch.logit(discs.features / BRIGHTEST).float(),
        FRESNEL: torch.logit(0.4 * even).repeat(1, 3),
        ROUGHNESS: torch.logit(0.27 * even),  # between two levels of blur
        REGION: torch.where(floor, -_FIRM, _FIRM),
        LABEL: torch.where(torch.from_numpy(part == OBJECT)[:, None], _FIRM, -_FIRM),
    }
    sky = torch.linspace(-1.5, 0.5, 6)[:, None, None, None].expand(6, 4, 4, 3).contiguous()
    shared = {SKY: torch.zeros(1, 3), SURROUNDINGS: sky}
    return parameters_of(discs, own, shared | translation_parameters("paper", 0))


def seen(
    values: dict[str, torch.Tensor], camera: Camera, settings: GorisSettings = SETTINGS
) -> tuple[Buffers, GlossyPicture]:
    """Return the view of a camera."""
    buffers = drawn_buffers(values, camera, sky_basis(camera, 0), settings)
    return buffers, picture_of(values, buffers, settings, EXTENT)


def shots_of_world(world: GlossyWorld, settings: GorisSettings = SETTINGS) -> list[TrainingView]:
    """Photographs of it, with all that priors could say."""
    return [_shot(world, camera, settings) for camera in world.cameras]


@torch.no_grad()
def _shot(world: GlossyWorld, camera: Camera, settings: GorisSettings) -> TrainingView:
    buffers, picture = seen(world.parameters.all, camera, settings)
    photograph = EncodedPhotograph(camera, picture.encoded, sky_basis(camera, 0))
    glossy, target = ((mask > 0.5).float() for mask in (buffers.glossy, buffers.label))
    return TrainingView(
        photograph, glossy, True, target, buffers.normal * (buffers.drawn.alpha > 0.5)[..., None]
    )


def with_settings(**changes: object) -> GorisSettings:
    """Those of the tests, some of them others."""
    return replace(SETTINGS, **changes)  # pyright: ignore[reportArgumentType]
