# SPDX-License-Identifier: Apache-2.0
"""One call of the engine on a workload, forward, or forward and backward: what is timed everywhere."""

from collections.abc import Callable
from dataclasses import dataclass, fields

import torch

from graycard import Camera
from graycard.benchmarks.speed._machine import Patience, Timing, peak_memory_mib, time_calls
from graycard.benchmarks.speed.engine._scenes import Workload, engine_camera, engine_surfels
from graycard.methods.splat import FeatureMaps, Surfels, rasterize_features

GRADIENT_SEED = 5


@dataclass(frozen=True)
class Scene:
    """A workload made ready: surfels whose tensors want gradients, and gradients of the maps."""

    surfels: Surfels
    camera: Camera
    to_features: torch.Tensor
    """Shape ``(H, W, C)``."""
    to_alpha: torch.Tensor
    """Shape ``(H, W)``."""

    @property
    def leaves(self) -> list[torch.Tensor]:
        """Centres, rotations, scales, opacities, features."""
        return [getattr(self.surfels, one.name) for one in fields(self.surfels)]

    def on(self, device: str) -> "Scene":
        """Return the same on another device."""
        tensors = [leaf.detach().to(device).requires_grad_() for leaf in self.leaves]
        return Scene(Surfels(*tensors), self.camera, self.to_features.to(device), self.to_alpha.to(device))

    def finish(self) -> None:
        """Wait for the device: a GPU returns before it is done."""
        if self.surfels.centres.is_cuda:
            torch.cuda.synchronize()


Draw = Callable[[Surfels, Camera], FeatureMaps]


def scene_of(workload: Workload, channels: int, dtype: torch.dtype = torch.float32) -> Scene:
    """Surfels, camera and gradients of a workload."""
    plain = engine_surfels(workload, channels)
    tensors = [getattr(plain, one.name).to(dtype).requires_grad_() for one in fields(plain)]
    random = torch.Generator().manual_seed(GRADIENT_SEED)
    size = (workload.size, workload.size)
    to_features = torch.rand((*size, channels), generator=random, dtype=dtype) * 2 - 1
    to_alpha = torch.rand(size, generator=random, dtype=dtype) * 2 - 1
    return Scene(Surfels(*tensors), engine_camera(workload), to_features, to_alpha)


def call_forward(scene: Scene, draw: Draw = rasterize_features) -> FeatureMaps:
    """Return the image, without a gradient."""
    with torch.no_grad():
        maps = draw(scene.surfels, scene.camera)
    scene.finish()
    return maps


def call_both(scene: Scene, draw: Draw = rasterize_features) -> tuple[torch.Tensor, ...]:
    """Return the image, and the gradients of all tensors of the surfels."""
    maps = draw(scene.surfels, scene.camera)
    wanted = [scene.to_features, scene.to_alpha]
    gradients = torch.autograd.grad([maps.features, maps.alpha], scene.leaves, wanted)
    scene.finish()
    return gradients


def time_both(scene: Scene, patience: Patience, draw: Draw = rasterize_features) -> tuple[Timing, Timing]:
    """Return times of the two calls."""
    forward = time_calls(lambda: call_forward(scene, draw), patience)
    return forward, time_calls(lambda: call_both(scene, draw), patience)


def memory_of(scene: Scene, draw: Draw = rasterize_features) -> float:
    """By how much the process, or what it has of the GPU, grows at the peak of forward and backward, MiB."""
    if scene.surfels.centres.is_cuda:
        before = torch.cuda.memory_allocated()
        torch.cuda.reset_peak_memory_stats()
        call_both(scene, draw)
        return (torch.cuda.max_memory_allocated() - before) / 2**20
    return peak_memory_mib(lambda: call_both(scene, draw))
