# SPDX-License-Identifier: Apache-2.0
"""The speed of the tracer, beside Mitsuba's in the same run."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, fields
from typing import Literal

import numpy as np
import torch

from graycard import Progress, RenderError
from graycard.benchmarks.speed._machine import Patience, Timing, time_calls
from graycard.benchmarks.speed.engine._scenes import WORKLOADS, Workload, engine_camera, engine_surfels
from graycard.io import silent
from graycard.methods.splat import Rays, Surfels, build_bvh, camera_rays, trace_rays
from graycard.synth import use_renderer

Kind = Literal["camera", "incoherent"]
KINDS: tuple[Kind, ...] = ("camera", "incoherent")
TRACED = WORKLOADS[:4]
"""A to D."""
INCOHERENT = 65_536
BUNDLE = 16
"""Incoherent rays that share an origin: they stand for what a path tracer sends out from one point."""
RAY_SEED = 3


@dataclass(frozen=True, slots=True)
class TracerCost:
    """The tracer on one workload, with rays of one kind and three channels."""

    workload: str
    kind: Kind
    surfels: int
    rays: int
    build: Timing
    """Costs of the tree of boxes."""
    forward: Timing
    """With the tree at hand and without a gradient."""
    both: Timing
    """Forward and backward, to surfels and rays, with the tree at hand."""
    peer_forward: Timing | None
    """Mitsuba's, its own tree at hand; None without LLVM."""
    peer_both: Timing | None
    """Mitsuba's, whose rays receive no gradients."""

    @property
    def ns_per_ray(self) -> float:
        """Forward."""
        return 1e6 * self.forward.ms / self.rays

    @property
    def speedup(self) -> float | None:
        """Over Mitsuba, forward."""
        return None if self.peer_forward is None else self.peer_forward.ms / self.forward.ms

    @property
    def speedup_both(self) -> float | None:
        """Over Mitsuba, forward and backward."""
        return None if self.peer_both is None else self.peer_both.ms / self.both.ms


def measure_tracer(
    workloads: Sequence[Workload] = TRACED,
    patience: Patience | None = None,
    incoherent: int = INCOHERENT,
    progress: Progress = silent,
) -> list[TracerCost]:
    """Time tree, forward and backward on each workload: the camera's rays, then incoherent ones.

    Args:
        workloads: Surfels and cameras.
        patience: How long to measure.
        incoherent: number of incoherent rays, a multiple of ``BUNDLE``.
        progress: Told about each case.
    """
    with_peer = _peer_is_there()
    cases: list[tuple[Workload, Kind]] = [(workload, kind) for workload in workloads for kind in KINDS]
    costs = []
    for number, (workload, kind) in enumerate(cases):
        progress(number / len(cases), f"tracer, {workload.name}, {kind} rays")
        surfels = engine_surfels(workload)
        rays = camera_rays(engine_camera(workload))
        rays = incoherent_rays(surfels, incoherent) if kind == "incoherent" else rays
        timings = (time_calls(call, patience or Patience()) for call in _calls(surfels, rays, with_peer))
        own = (next(timings), next(timings), next(timings))
        peer = (next(timings), next(timings)) if with_peer else (None, None)
        costs.append(TracerCost(workload.name, kind, len(surfels), len(rays), *own, *peer))
    return costs


def incoherent_rays(surfels: Surfels, count: int, seed: int = RAY_SEED) -> Rays:
    """Rays from the centres of random surfels, ``BUNDLE`` from each, in directions uniform on the sphere.

    Args:
        surfels: Where they start.
        count: a multiple of ``BUNDLE``.
        seed: of origins and directions.
    """
    random = np.random.default_rng(seed)
    starts = torch.from_numpy(random.integers(0, len(surfels), count // BUNDLE)).repeat_interleave(BUNDLE)
    directions = random.normal(size=(len(starts), 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    origins = surfels.centres.detach()[starts]
    return Rays(origins, torch.from_numpy(directions).to(origins.dtype))


def _peer_is_there() -> bool:
    try:
        use_renderer(variant="llvm_ad_rgb")
    except RenderError:
        return False
    return True


def _calls(surfels: Surfels, rays: Rays, with_peer: bool) -> Iterator[Callable[[], object]]:
    """Yield timed steps: tree, forward, forward and backward; then the last two of the peer."""
    tree = build_bvh(surfels)
    parts = [getattr(surfels, field.name) for field in fields(surfels)]
    parts += [rays.origins.clone(), rays.directions]

    def both() -> None:
        leaves = [part.detach().requires_grad_() for part in parts]
        moving = Rays(leaves[5], leaves[6], rays.width)
        trace_rays(Surfels(*leaves[:5]), moving, bvh=tree).features.sum().backward()

    yield lambda: build_bvh(surfels)
    yield lambda: trace_rays(surfels, rays, bvh=tree)
    yield both
    if with_peer:
        from graycard.benchmarks.speed._ellipsoids import EllipsoidTracer

        peer = EllipsoidTracer(surfels, rays)
        yield peer.forward
        yield peer.both
