# SPDX-License-Identifier: Apache-2.0
"""The engine taken apart into stages that can be timed one by one; what knows of its inside is here only."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial

import numpy as np

from graycard import Camera
from graycard.methods.splat import Surfels, stages

DRAW, DRAW_BACKWARD = "draw", "draw backward"
"""The stages that are the kernels."""


@dataclass(frozen=True)
class Staged:
    """The engine on one scene, all stages run once."""

    stages: Mapping[str, Callable[[], object]]
    """In order; each may be repeated alone."""
    forward_lanes: int
    """Pairs of pixel and surfel that the forward kernel evaluates."""
    backward_lanes: int
    working_bytes: int
    """Arrays that live between forward and backward, and those that either works in."""


def staged(surfels: Surfels, camera: Camera) -> Staged:
    """Take the engine apart on a scene: features and alpha only, forward and backward."""
    channels = surfels.features.shape[1]
    features = np.pad(
        surfels.features.detach().numpy(), ((0, 0), (0, stages.padded_channels(channels) - channels))
    )
    tensors = surfels.centres, surfels.rotations, surfels.scales, surfels.opacities
    arrays = (np.ascontiguousarray(tensor.detach().numpy()) for tensor in tensors)
    still = np.zeros((len(surfels), 2), np.float32)
    scene = stages.Scene(*arrays, features=features, offsets=still, camera=camera, shaped=False)
    projected = stages.project(scene)
    lists = stages.list_tiles(scene, projected)
    drawn = stages.draw(scene, projected, lists)
    given = scene, projected, lists, drawn, np.ones_like(drawn.image), np.ones_like(drawn.transmittance), None
    slots = stages.draw_backward(*given)
    gradients = stages.project_backward(scene, projected, lists, slots)
    calls = {
        "project": partial(stages.project, scene),
        "sort and bin": partial(stages.list_tiles, scene, projected),
        DRAW: partial(stages.draw, scene, projected, lists),
        DRAW_BACKWARD: lambda: stages.give_back(stages.draw_backward(*given)),
        "project backward": partial(stages.project_backward, scene, projected, lists, slots),
    }
    held = stages.working_bytes(projected, lists, drawn, slots, gradients)
    return Staged(calls, drawn.forward_lanes, drawn.backward_lanes(lists), held)
