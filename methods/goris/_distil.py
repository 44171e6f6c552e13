# SPDX-License-Identifier: Apache-2.0
"""Colours that change with the view, fitted to pictures of a scene: then no ray has to be traced any more."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import torch
from scipy.spatial.transform import Rotation, Slerp

from graycard import Camera, Progress
from graycard.methods.goris._model import drawn_buffers, picture_of
from graycard.methods.goris._settings import GorisSettings
from graycard.methods.splat import GEOMETRY, Parameters, Plan, Rate, initial_state, scene_extent, train
from graycard.methods.surfels import (
    COEFFICIENTS,
    DETAIL,
    SKY,
    Objective,
    Photograph,
    learning_rates,
    sky_basis,
)

BETWEEN = 2
"""Cameras between each training camera and the next nearest one."""


def distilled(
    parameters: Parameters, cameras: Sequence[Camera], settings: GorisSettings, seed: int, progress: Progress
) -> Parameters:
    """Coloured surfels that look like a scene from its training cameras and from between them.

    Only pictures count, as in the paper. It begins anew; here surfels go on from where they are, with their
    colours as rough surfaces.

    Args:
        parameters: Of the scene.
        cameras: The training cameras.
        settings: Of the method; as many steps as the first stage has.
        seed: Of the order of pictures.
        progress: Called now and then.
    """
    extent = scene_extent(list(cameras))
    views = [_pictured(parameters, camera, settings, extent) for camera in cameras_between(cameras, BETWEEN)]
    kept = (*GEOMETRY, COEFFICIENTS, DETAIL)
    start = Parameters({name: parameters.surfels[name] for name in kept}, {SKY: parameters.shared[SKY]})
    rates = learning_rates(extent, settings)
    rates = {name: Rate(rate.end or rate.start) if name in GEOMETRY else rate for name, rate in rates.items()}
    plan = Plan(settings.iterations, rates, extent)
    alone = replace(settings, normal_weight=0.0, distortion_weight=0.0, cover_weight=0.0)
    return train(initial_state(start, seed), plan, Objective(views, alone, seed), progress).parameters


@torch.no_grad()
def _pictured(parameters: Parameters, camera: Camera, settings: GorisSettings, extent: float) -> Photograph:
    values, sky = parameters.all, sky_basis(camera, settings.sky_degree)
    picture = picture_of(values, drawn_buffers(values, camera, sky, settings), settings, extent)
    return Photograph(camera, picture.encoded, sky)


def cameras_between(cameras: Sequence[Camera], count: int) -> list[Camera]:
    """Cameras, and so many more on the way from each to its nearest neighbour, evenly spaced; no way twice.

    Positions go straight, rotations by the shortest way; lenses and sizes are those of the first of the two.
    """
    positions = np.array([camera.position for camera in cameras])
    apart = np.linalg.norm(positions[:, None] - positions, axis=-1)
    np.fill_diagonal(apart, np.inf)
    found = list(cameras)
    ways: dict[frozenset[int], tuple[int, int]] = {}
    for number, row in enumerate(apart if len(cameras) > 1 else ()):
        nearest = int(row.argmin())
        ways.setdefault(frozenset((number, nearest)), (number, nearest))
    for camera, other in ((cameras[a], cameras[b]) for a, b in ways.values()):
        turns = Slerp([0, 1], Rotation.from_matrix([c.camera_to_world[:3, :3] for c in (camera, other)]))
        for share in np.arange(1, count + 1) / (count + 1):
            pose = np.eye(4)
            pose[:3, :3] = turns(share).as_matrix()
            pose[:3, 3] = (1 - share) * camera.position + share * other.position
            found.append(Camera(camera.width, camera.height, camera.K, pose))
    return found
