# SPDX-License-Identifier: Apache-2.0
"""Other implementations of the same pictures, timed in the same run: the machine cancels in the ratio."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from importlib.util import find_spec

import torch

from graycard import Camera, MethodError, Progress
from graycard.benchmarks.speed._machine import Patience
from graycard.benchmarks.speed.engine._calls import (
    Draw,
    Scene,
    memory_of,
    scene_of,
    time_both,
)
from graycard.benchmarks.speed.engine._records import PeerCost
from graycard.benchmarks.speed.engine._scenes import Workload
from graycard.io import silent
from graycard.methods.splat import FeatureMaps, Surfels, rasterize_features

TORCH_SPLATTING_MIB = 4096
"""Memory that torch-splatting may take."""
REFERENCE_MIB = 512
"""Memory that the reference may take: it holds some arrays of all surfels by all pixels."""
REFERENCE_ARRAYS = 40
"""About so many of them, in float64, forward and backward."""


@dataclass(frozen=True)
class Peer:
    """Another implementation, made ready for one scene."""

    name: str
    draw: Draw
    note: str = ""
    """Parts left out of the time."""
    scene: Scene | None = None
    """The same scene where it draws it, if that is another device."""


def measure_peers(
    workloads: tuple[Workload, ...],
    channels: tuple[int, ...],
    patience: Patience,
    progress: Progress = silent,
) -> tuple[list[PeerCost], list[str]]:
    """Time peers and engine on each workload; figures, and what had to be left out and why."""
    costs: list[PeerCost] = []
    left_out: dict[str, list[str]] = {}
    makers: list[Callable[[Scene], Peer | str]] = [_reference, _gsplat, _torch_splatting, _cuda]
    cases = [(w, c, make) for w in workloads for c in channels for make in makers]
    for number, (workload, count, make) in enumerate(cases):
        progress(number / len(cases), f"peers on {workload.name}, {count} channels")
        scene = scene_of(workload, count)
        peer = make(scene)
        if isinstance(peer, str):
            left_out.setdefault(peer, []).append(f"{workload.name}, {count} channels")
        else:
            costs.append(_beside(peer, scene, workload, patience))
    return costs, [f"{'; '.join(cases)}: {reason}" for reason, cases in left_out.items()]


def _beside(peer: Peer, scene: Scene, workload: Workload, patience: Patience) -> PeerCost:
    """Ours is timed right after the peer."""
    where = peer.scene or scene
    theirs, ours = time_both(where, patience, peer.draw), time_both(scene, patience, rasterize_features)
    return PeerCost(
        peer=peer.name,
        workload=workload.name,
        channels=scene.surfels.features.shape[1],
        theirs_forward=theirs[0],
        theirs_both=theirs[1],
        ours_forward=ours[0],
        ours_both=ours[1],
        theirs_mib=memory_of(where, peer.draw),
        ours_mib=memory_of(scene, rasterize_features),
        note=peer.note,
    )


def _reference(scene: Scene) -> Peer | str:
    """Our own specification, where it fits."""
    pairs = len(scene.surfels) * scene.camera.width * scene.camera.height
    needs = REFERENCE_ARRAYS * 8 * pairs / 2**20
    if needs > REFERENCE_MIB:
        return f"the reference would need {needs / 1024:.0f} GiB"
    return Peer("reference", partial(rasterize_features, backend="reference"))


def _gsplat(scene: Scene) -> Peer | str:
    """Return gsplat's implementation in PyTorch; its lists are made before, and not timed."""
    if find_spec("gsplat") is None:
        return "gsplat is not installed: pip install 'graycard[gpu]'"
    from graycard.benchmarks.speed._gsplat import accumulate, pairs_of, project

    opacities = scene.surfels.opacities.detach()
    with torch.no_grad():
        pairs = pairs_of(project(scene.surfels, scene.camera), opacities, scene.camera)

    def draw(surfels: Surfels, camera: Camera) -> FeatureMaps:
        image, alpha, _ = accumulate(
            project(surfels, camera), pairs, surfels.opacities, surfels.features, camera
        )
        return FeatureMaps(image, alpha)

    return Peer("gsplat (PyTorch)", draw, "its lists of contributing pairs are given")


def _torch_splatting(scene: Scene) -> Peer | str:
    """3D Gaussian Splatting in plain PyTorch, if the user has it."""
    from graycard.benchmarks.speed import _torch_splatting as peer

    if find_spec(peer.PACKAGE) is None or find_spec("einops") is None:
        return (
            "torch-splatting is not on PYTHONPATH, or einops missing: clone github.com/hbb1/torch-splatting"
        )
    if scene.camera.width % peer.TILE or scene.camera.height % peer.TILE:
        return f"torch-splatting draws images of whole tiles of {peer.TILE} pixels only"
    if scene.surfels.features.shape[1] != peer.CHANNELS:
        return f"torch-splatting draws {peer.CHANNELS} channels only"
    needs = peer.memory_needed(scene.surfels, scene.camera)
    if needs > TORCH_SPLATTING_MIB:
        return f"torch-splatting would need {needs / 1024:.0f} GiB"
    return Peer("torch-splatting", peer.draw, "3D Gaussians without thickness, not discs")


def _cuda(scene: Scene) -> Peer | str:
    """Our other back end, on the GPU, where there is one."""
    from graycard.methods.splat.gpu import gsplat_kernels

    try:
        gsplat_kernels()
    except MethodError as cause:
        return f"the back end cuda cannot run: {cause}"
    note = f"on {torch.cuda.get_device_name()}; memory is the GPU's"
    return Peer("cuda", partial(rasterize_features, backend="cuda"), note, scene.on("cuda"))
