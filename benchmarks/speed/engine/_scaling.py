# SPDX-License-Identifier: Apache-2.0
"""Scaling of the engine's time with surfels, pixels, channels and threads."""

from collections.abc import Iterator
from dataclasses import dataclass

from graycard import Progress
from graycard.benchmarks.speed._machine import Patience, threads
from graycard.benchmarks.speed.engine._calls import scene_of, time_both
from graycard.benchmarks.speed.engine._records import ScalingPoint
from graycard.benchmarks.speed.engine._scenes import Workload
from graycard.io import silent


@dataclass(frozen=True, slots=True)
class ScalingPlan:
    """Varied quantities, each from the same workload."""

    surfels: tuple[int, ...] = (1_000, 3_000, 10_000, 30_000, 100_000, 300_000)
    sizes: tuple[int, ...] = (64, 128, 256, 512, 1024)
    """Pixels on each side."""
    channels: tuple[int, ...] = (1, 3, 8, 16, 32)


def measure_scaling(
    workload: Workload,
    plan: ScalingPlan,
    threads_used: int,
    patience: Patience,
    progress: Progress = silent,
) -> list[ScalingPoint]:
    """Time the engine along each axis; the other things stay those of the workload, with three channels."""
    cases = list(_cases(workload, plan, threads_used))
    points = []
    for number, (along, value, changed, channels, count) in enumerate(cases):
        progress(number / len(cases), f"{along}: {value}")
        with threads(count):
            times = time_both(scene_of(changed, channels), patience)
        points.append(ScalingPoint(along, value, changed.name, channels, count, *times))
    return points


def _cases(workload: Workload, plan: ScalingPlan, most: int) -> Iterator[tuple[str, int, Workload, int, int]]:
    """Axis, value, workload, channels, threads."""
    for count in plan.surfels:
        yield "surfels", count, workload.covering(count), 3, most
    for size in plan.sizes:
        yield "pixels", size**2, workload.sized(size), 3, most
    for channels in plan.channels:
        yield "channels", channels, workload, channels, most
    for count in range(1, most + 1):
        yield "threads", count, workload, 3, count
