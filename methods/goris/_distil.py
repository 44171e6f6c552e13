# SPDX-License-Identifier: Apache-2.0
"""Radiance alone, fitted to pictures of a scene, so that no ray has to be traced to draw it."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import torch
from scipy.spatial.transform import Rotation, Slerp

from graycard import Camera, Capture, Progress
from graycard.io import Room
from graycard.methods.goris._fit import own_stage
from graycard.methods.goris._model import drawn_buffers, picture_of
from graycard.methods.goris._settings import GorisSettings
from graycard.methods.splat import Checkpoint, Parameters, TrainConfig, initial_state, scene_extent, train
from graycard.methods.surfels import (
    EncodedPhotograph,
    SurfelObjective,
    density_rules,
    learning_rates,
    sky_basis,
    sparse_start,
)

BETWEEN = 2
"""Cameras between each training camera and the next nearest one."""


def distilled(
    parameters: Parameters,
    capture: Capture,
    settings: GorisSettings,
    seed: int,
    progress: Progress,
    saved: Checkpoint | None = None,
) -> Parameters:
    """Radiance-only surfels that look like a scene from its training cameras and from between them.

    A new fit of radiance alone, as the paper has it: only pictures count, and geometry is found anew, for a
    reflection needs a room behind the mirror when no ray is traced.

    Args:
        parameters: Of the scene.
        capture: Whose training cameras are taken, and on whose points surfels begin.
        settings: Of the method; as many steps as the first stage has.
        seed: Of all that is random.
        progress: Called now and then.
        saved: Where the fit is saved: this stage in a file beside it.

    Raises:
        MethodError: The loss or a gradient is not finite.
    """
    cameras = [view.camera for view in capture.train]
    extent = scene_extent(cameras)
    room, between = Room(), cameras_between(cameras, BETWEEN)
    views = [room.keep(_pictured(parameters, camera, settings, extent)) for camera in between]
    checkpoint = own_stage(saved, "distilled", (view.encoded for view in views), settings)
    rates, rules = learning_rates(extent, settings), density_rules(settings.surfels)
    config = TrainConfig(settings.iterations, rates, extent, rules, checkpoint, backend=settings.backend)
    alone = replace(settings, normal_weight=0.0, distortion_weight=0.0, cover_weight=0.0)
    state = initial_state(sparse_start(capture, settings, seed), seed)
    return train(state, config, SurfelObjective(views, alone, seed), progress).parameters


@torch.no_grad()
def _pictured(
    parameters: Parameters, camera: Camera, settings: GorisSettings, extent: float
) -> EncodedPhotograph:
    values, sky = parameters.all, sky_basis(camera, settings.sky_degree)
    picture = picture_of(values, drawn_buffers(values, camera, sky, settings), settings, extent)
    return EncodedPhotograph(camera, picture.encoded, sky)


def cameras_between(cameras: Sequence[Camera], count: int) -> list[Camera]:
    """Cameras, and ``count`` more between each and its nearest neighbour, evenly spaced, each pair once.

    Positions are interpolated linearly, rotations spherically; intrinsics are those of the first of the two.
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
