# SPDX-License-Identifier: Apache-2.0
"""The speed of the surfel engine: stage by stage, against the machine's limit and beside its peers."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from typing import Any, Literal

from graycard import MethodError, Progress, UnknownNameError
from graycard.benchmarks._sources import environment, package_version
from graycard.benchmarks.speed._machine import (
    QUICK,
    Patience,
    Peak,
    Timing,
    fma_peak,
    most_threads,
    threads,
    time_calls,
)
from graycard.benchmarks.speed._tracer import INCOHERENT, TRACED, measure_tracer
from graycard.benchmarks.speed.engine._calls import scene_of, time_both
from graycard.benchmarks.speed.engine._losses import measure_losses
from graycard.benchmarks.speed.engine._pairs import count_pairs
from graycard.benchmarks.speed.engine._peers import measure_peers
from graycard.benchmarks.speed.engine._records import (
    EngineCost,
    EngineSpeed,
    Lanes,
    flops_backward,
    flops_forward,
)
from graycard.benchmarks.speed.engine._scaling import ScalingPlan, measure_scaling
from graycard.benchmarks.speed.engine._scenes import (
    PAPER_SIZED,
    WORKLOADS,
    Workload,
    engine_camera,
    engine_surfels,
)
from graycard.benchmarks.speed.engine._step import measure_steps
from graycard.io import silent
from graycard.processes import narrowed

Part = Literal["stages", "scaling", "peers", "losses", "step", "tracer"]
PARTS: tuple[Part, ...] = ("stages", "scaling", "peers", "losses", "step", "tracer")
PACKAGES = ("numba", "llvmlite", "gsplat")
"""Beyond those of every record."""


@dataclass(frozen=True, slots=True)
class SpeedPlan:
    """Parts to measure, and for how long."""

    workloads: tuple[Workload, ...] = WORKLOADS
    channels: tuple[int, ...] = (3, 16)
    scaled: Workload = WORKLOADS[0]
    """From which the scaling starts."""
    scaling: ScalingPlan = field(default_factory=ScalingPlan)
    peers: tuple[Workload, ...] = (Workload("S", 200, 64, 0.1), *WORKLOADS)
    """S is small enough for the reference."""
    loss_sizes: tuple[int, ...] = (256, 512)
    stepped: Workload = WORKLOADS[3]
    """On which a whole step of ``2dgs`` is timed, on the CPU, and on a GPU where there is one."""
    stepped_on_gpu: tuple[Workload, ...] = (PAPER_SIZED,)
    """The same, on a GPU alone."""
    traced: tuple[Workload, ...] = TRACED
    incoherent: int = INCOHERENT
    """Rays beside those of the camera."""
    parts: tuple[Part, ...] = PARTS
    patience: Patience = field(default_factory=Patience)
    rounds: int = 200_000
    """Multiply-adds in each chain that looks for the machine's peak."""


TINY = Workload("tiny", 40, 32, 0.1)
QUICK_PLAN = SpeedPlan(
    workloads=(TINY,),
    channels=(3,),
    scaled=TINY,
    scaling=ScalingPlan((20, 40), (16, 32), (1, 3)),
    peers=(TINY,),
    loss_sizes=(16,),
    stepped=TINY,
    stepped_on_gpu=(),
    traced=(TINY,),
    incoherent=64,
    patience=QUICK,
    rounds=100,
)
"""Everything once, on next to nothing: shows that it works, says nothing about speed."""


def speed_plan(
    parts: Sequence[Part] = (), workloads: Sequence[str] = (), repetitions: int = 5, quick: bool = False
) -> SpeedPlan:
    """Part to measure, by the words of the command line.

    Args:
        parts: All of them if empty.
        workloads: Names of those for stages, peers and the tracer; all if empty.
        repetitions: Groups of calls whose median counts.
        quick: Take :data:`QUICK_PLAN` instead of the whole, with these parts.

    Raises:
        UnknownNameError: There is no such workload.
    """
    plan = replace(QUICK_PLAN if quick else SpeedPlan(), parts=tuple(parts) or PARTS)
    known = {workload.name: workload for workload in (*plan.workloads, *plan.peers)}
    for name in workloads:
        if name not in known:
            raise UnknownNameError("workload", name, known)
    chosen = {
        key: tuple(one for one in getattr(plan, key) if not workloads or one.name in workloads)
        for key in ("workloads", "peers", "traced")
    }
    patience = plan.patience if quick else Patience(repetitions)
    return replace(plan, **chosen, patience=patience)


def measure_engine(plan: SpeedPlan | None = None, progress: Progress = silent) -> EngineSpeed:
    """Measure the engine with all cores (and one, where threads are compared).

    Args:
        plan: What is measured; everything by default.
        progress: Told about each part.
    """
    plan = plan or SpeedPlan()
    cores = most_threads()
    progress(0.0, "peak of the machine")
    peaks = tuple(fma_peak(count, plan.patience, plan.rounds) for count in sorted({1, cores}))
    started = datetime.now(UTC).isoformat(timespec="seconds")
    speed = EngineSpeed(started, _environment(), cores, peaks)
    with threads(cores):
        for number, part in enumerate(plan.parts):
            told = narrowed(progress, number / len(plan.parts), (number + 1) / len(plan.parts))
            speed = _with_part(speed, part, plan, told)
    return speed


def _with_part(speed: EngineSpeed, part: Part, plan: SpeedPlan, progress: Progress) -> EngineSpeed:
    """Measurements so far, and one part more."""
    match part:
        case "stages":
            return replace(speed, engine=tuple(_engine_costs(plan, speed.peaks[-1], progress)))
        case "scaling":
            points = measure_scaling(plan.scaled, plan.scaling, speed.threads, plan.patience, progress)
            return replace(speed, scaling=tuple(points))
        case "peers":
            costs, left_out = measure_peers(plan.peers, plan.channels, plan.patience, progress)
            return replace(speed, peers=tuple(costs), left_out=(*speed.left_out, *left_out))
        case "losses":
            losses = measure_losses(plan.loss_sizes, plan.patience, progress)
            return replace(speed, losses=tuple(losses))
        case "step":
            progress(0.0, "a whole step of 2dgs")
            return _with_steps(speed, plan)
        case "tracer":
            traced = measure_tracer(plan.traced, plan.patience, plan.incoherent, progress)
            return replace(speed, tracer=tuple(traced))


def _with_steps(speed: EngineSpeed, plan: SpeedPlan) -> EngineSpeed:
    steps = [*measure_steps(plan.stepped, plan.patience)]
    try:
        for workload in (plan.stepped, *plan.stepped_on_gpu):
            steps += measure_steps(workload, plan.patience, "cuda")
    except MethodError as cause:
        left_out = f"steps of 2dgs on a GPU: {cause}"
        return replace(speed, steps=tuple(steps), left_out=(*speed.left_out, left_out))
    return replace(speed, steps=tuple(steps))


def _environment() -> dict[str, Any]:
    found = environment()
    more = {name: package_version(name) for name in PACKAGES}
    return {**found, "packages": {**found["packages"], **more}}


def _engine_costs(plan: SpeedPlan, peak: Peak, progress: Progress) -> Sequence[EngineCost]:
    cases = [(workload, channels) for workload in plan.workloads for channels in plan.channels]
    costs = []
    for number, (workload, channels) in enumerate(cases):
        progress(number / len(cases), f"{workload.name}, {channels} channels")
        costs.append(measure_workload(workload, channels, peak, plan.patience))
    return costs


def measure_workload(workload: Workload, channels: int, peak: Peak, patience: Patience) -> EngineCost:
    """Return the engine on one workload, with as many threads as the peak was measured with.

    Args:
        workload: The scene.
        channels: of features.
        peak: What the machine can do.
        patience: How long to measure.
    """
    from graycard.benchmarks.speed.engine._stages import DRAW, DRAW_BACKWARD, staged

    surfels, camera = engine_surfels(workload, channels), engine_camera(workload)
    pairs, parts = count_pairs(surfels, camera), staged(surfels, camera)
    stages = {name: time_calls(call, patience) for name, call in parts.stages.items()}
    forward, both = time_both(scene_of(workload, channels), patience)
    return EngineCost(
        workload.name, workload.surfels, workload.size, channels, peak.threads, pairs, stages, forward, both,
        _lanes(parts.forward_lanes, stages[DRAW], flops_forward(channels), peak, pairs),
        _lanes(parts.backward_lanes, stages[DRAW_BACKWARD], flops_backward(channels), peak, pairs),
        parts.working_bytes / 2**20,
    )  # fmt: skip


def _lanes(evaluated: int, timing: Timing, flops: int, peak: Peak, pairs: int) -> Lanes:
    ns = 1e6 * timing.ms / evaluated
    return Lanes(evaluated, ns, flops / ns / peak.gflops, pairs / evaluated)
