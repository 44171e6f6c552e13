# SPDX-License-Identifier: Apache-2.0
"""A whole step of a fit on a workload: parameters to image, loss, the way back, and Adam."""

from dataclasses import fields

import torch

import graycard as gc
from graycard.benchmarks.speed._engine_records import StepCost
from graycard.benchmarks.speed._engine_scenes import Workload, engine_camera, engine_surfels
from graycard.benchmarks.speed._machine import Patience, time_calls
from graycard.methods.splat import Surfels, photometric_map, rasterize_features

LEARNING_RATE = 1e-6
"""So small that the scene stays the workload however often it is measured."""
TARGET_SEED = 9


class TrainingStep:
    """Surfels as an optimiser holds them, and a target."""

    def __init__(self, workload: Workload, channels: int) -> None:
        surfels = engine_surfels(workload, channels)
        tensors = [getattr(surfels, one.name) for one in fields(surfels)]
        tensors[2], tensors[3] = tensors[2].log(), tensors[3].logit(eps=1e-6)
        self.camera: gc.Camera = engine_camera(workload)
        self.parameters = [tensor.clone().requires_grad_() for tensor in tensors]
        self.adam = torch.optim.Adam(self.parameters, lr=LEARNING_RATE, eps=1e-15, fused=True)
        random = torch.Generator().manual_seed(TARGET_SEED)
        self.target = torch.rand(workload.size, workload.size, channels, generator=random)

    def image(self) -> torch.Tensor:
        """Parameters to surfels, and surfels to the image."""
        centres, turns, log_scales, logits, features = self.parameters
        turns = torch.nn.functional.normalize(turns, dim=1)
        surfels = Surfels(centres, turns, log_scales.exp(), logits.sigmoid(), features)
        return rasterize_features(surfels, self.camera).features

    def loss(self, image: torch.Tensor) -> torch.Tensor:
        """0.8 L1 + 0.2 (1 - SSIM)."""
        return photometric_map(image, self.target).mean()

    def whole(self) -> None:
        """All of it."""
        self.adam.zero_grad()
        self.loss(self.image()).backward()
        self.adam.step()


def measure_step(workload: Workload, channels: int, patience: Patience) -> StepCost:
    """Time a step as a whole, and its stages alone.

    Args:
        workload: The scene.
        channels: of features; with all of them the loss compares.
        patience: How long to measure.
    """
    step = TrainingStep(workload, channels)
    whole = time_calls(step.whole, patience)
    image = step.image()
    leaf = image.detach().requires_grad_()
    upstream = torch.autograd.grad(step.loss(leaf), leaf)[0]
    stages = {
        "image": step.image,
        "loss, both ways": lambda: torch.autograd.grad(step.loss(leaf), leaf),
        "way back": lambda: torch.autograd.grad(image, step.parameters, upstream, retain_graph=True),
        "Adam": step.adam.step,
    }
    timed = {name: time_calls(call, patience) for name, call in stages.items()}
    return StepCost(workload.name, channels, whole, timed)
