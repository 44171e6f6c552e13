# SPDX-License-Identifier: Apache-2.0
"""Clouds of surfels on which the engine, the ray tracer and their peers are timed: the same for all."""

import math
from dataclasses import dataclass

import numpy as np
import torch

from graycard import Camera
from graycard.methods.splat import Surfels

FIELD = 0.9
"""Focal length over image width."""
NEAREST, FARTHEST = 1.5, 4.0
"""Metres of z-depth between which the surfels lie."""
SPREAD = 1.2
"""Metres to each side of the optical axis."""
SCALE_DEVIATION = 0.4
"""Standard deviation of the logarithm of the scales."""
FEATURE_SEED = 1


@dataclass(frozen=True, slots=True)
class Workload:
    """A cloud of surfels in front of a square image."""

    name: str
    surfels: int
    size: int
    """Pixels on each side."""
    scale: float
    """Median standard deviation of a disc, metres."""

    def covering(self, surfels: int) -> "Workload":
        """Return so many surfels on the same image, of a size that keeps the coverage of a pixel."""
        scale = self.scale * math.sqrt(self.surfels / surfels)
        return Workload(f"{self.name}, {surfels} surfels", surfels, self.size, scale)

    def sized(self, size: int) -> "Workload":
        """Return the same cloud on an image of another size."""
        return Workload(f"{self.name}, {size} px", self.surfels, size, self.scale)


WORKLOADS = (
    Workload("A", 10_000, 256, 0.02),
    Workload("B", 30_000, 256, 0.012),
    Workload("C", 10_000, 512, 0.02),
    Workload("D", 30_000, 512, 0.012),
    Workload("E", 30_000, 256, 0.03),
)
"""A to D are shallow (about ten surfels a pixel); E is dense, so that what lies behind is not drawn."""
PAPER_SIZED = Workload("P", 200_000, 800, 0.0046)
"""Cloud of the size of the papers' scenes, as shallow as D: for a GPU."""


def engine_camera(workload: Workload) -> Camera:
    """Return the camera in the world's origin that looks along z."""
    focal, middle = FIELD * workload.size, workload.size / 2
    K = np.array([[focal, 0, middle], [0, focal, middle], [0, 0, 1]])
    return Camera(workload.size, workload.size, K, np.eye(4))


def engine_surfels(workload: Workload, channels: int = 3, seed: int = 0) -> Surfels:
    """Random discs in a box before the camera, float32; features are uniform in [0, 1].

    The order in which numbers are drawn is fixed: figures of different days are of the same cloud.
    """
    random, count = np.random.default_rng(seed), workload.surfels
    sides = [random.uniform(-SPREAD, SPREAD, count) for _ in range(2)]
    centres = np.stack([*sides, random.uniform(NEAREST, FARTHEST, count)], axis=1)
    turns = random.normal(size=(count, 4))
    scales = np.exp(random.normal(math.log(workload.scale), SCALE_DEVIATION, (count, 2)))
    opacities = random.uniform(0.3, 1, count)
    features = np.random.default_rng(FEATURE_SEED).uniform(0, 1, (count, channels))
    turns /= np.linalg.norm(turns, axis=1, keepdims=True)
    values = centres, turns, scales, opacities, features
    return Surfels(*(torch.from_numpy(value.astype(np.float32)) for value in values))
