# SPDX-License-Identifier: Apache-2.0
"""The figures of a run as rows of words."""

from collections.abc import Iterator
from dataclasses import dataclass

from graycard.benchmarks.speed._machine import QUIET, Timing
from graycard.benchmarks.speed._tracer import TracerCost
from graycard.benchmarks.speed.engine._records import (
    EngineCost,
    EngineSpeed,
    PeerCost,
    ScalingPoint,
    StepCost,
)

DISTURBED = "~"
"""Stands before a time for which the machine was never quiet."""


@dataclass(frozen=True, slots=True)
class SpeedTable:
    """One table."""

    title: str
    heads: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]


def engine_tables(speed: EngineSpeed) -> list[SpeedTable]:
    """All tables of a run that have rows."""
    makers = _machine, _stages, _kernels, _scaling, _peers, _losses, _steps, _tracer
    return [table for table in (make(speed) for make in makers) if table.rows]


def disturbed_note(speed: EngineSpeed) -> str:
    """Return a sentence on times that were never taken in quiet; empty if there is none."""
    total, bad = 0, 0
    for timing in _timings(speed):
        total, bad = total + 1, bad + timing.disturbed
    if not bad:
        return ""
    return (
        f"{bad} of {total} times (marked {DISTURBED}) were taken while other processes used {QUIET} cores or "
        "more: do not quote them, measure again on a quiet machine"
    )


def _timings(speed: EngineSpeed) -> Iterator[Timing]:
    for peak in speed.peaks:
        yield peak.timing
    for cost in speed.engine:
        yield from (*cost.stages.values(), cost.forward, cost.both)
    for point in speed.scaling:
        yield from (point.forward, point.both)
    for peer in speed.peers:
        yield from (peer.theirs_forward, peer.theirs_both, peer.ours_forward, peer.ours_both)
    for loss in speed.losses:
        yield from (loss.ours, loss.torch)
    for step in speed.steps:
        yield from (step.whole, *step.stages.values())
    for cost in speed.tracer:
        own = cost.build, cost.forward, cost.both
        yield from (timing for timing in (*own, cost.peer_forward, cost.peer_both) if timing is not None)


def _ms(timing: Timing) -> str:
    return f"{DISTURBED if timing.disturbed else ''}{timing.ms:.3g}"


def _machine(speed: EngineSpeed) -> SpeedTable:
    rows = ((str(peak.threads), f"{peak.gflops:.0f}", _ms(peak.timing)) for peak in speed.peaks)
    title = f"Peak of the machine ({speed.environment['cpu']}): multiply-adds in registers"
    return SpeedTable(title, ("threads", "GFLOP/s", "ms"), tuple(rows))


def _stages(speed: EngineSpeed) -> SpeedTable:
    names = list(dict.fromkeys(name for cost in speed.engine for name in cost.stages))
    heads = ("workload", "surfels", "px", "C", *names, "f", "f+b", "ns/pair f", "f+b", "Mpairs/s", "MiB")

    def row(cost: EngineCost) -> tuple[str, ...]:
        stages = [_ms(cost.stages[name]) if name in cost.stages else "" for name in names]
        ends = f"{cost.ns_forward:.2f}", f"{cost.ns_both:.2f}"
        rest = f"{cost.pairs_per_second / 1e6:.0f}", f"{cost.working_mib:.1f}"
        whole = _ms(cost.forward), _ms(cost.both)
        head = cost.workload, str(cost.surfels), str(cost.size), str(cost.channels)
        return (*head, *stages, *whole, *ends, *rest)

    title = f"Engine, ms, {speed.threads} threads; f: forward, f+b: forward and backward, all stages"
    return SpeedTable(title, heads, tuple(row(cost) for cost in speed.engine))


def _kernels(speed: EngineSpeed) -> SpeedTable:
    heads = (
        "workload",
        "C",
        "pairs",
        "lanes f",
        "efficiency",
        "ns/lane f",
        "of peak",
        "ns/lane b",
        "of peak",
    )

    def row(cost: EngineCost) -> tuple[str, ...]:
        forward, backward = cost.forward_lanes, cost.backward_lanes
        counts = f"{cost.pairs:,}", f"{forward.evaluated:,}", f"{forward.efficiency:.3f}"
        ahead = f"{forward.ns:.3f}", f"{forward.peak_share:.0%}"
        return (
            cost.workload, str(cost.channels), *counts, *ahead,
            f"{backward.ns:.3f}", f"{backward.peak_share:.0%}",
        )  # fmt: skip

    return SpeedTable("Kernels, by evaluated lanes", heads, tuple(row(cost) for cost in speed.engine))


def _scaling(speed: EngineSpeed) -> SpeedTable:
    rows = []
    for number, point in enumerate(speed.scaling):
        before = [other for other in speed.scaling[:number] if other.along == point.along]
        against = max((_over_linear(point, other) for other in before), default=1.0)
        times = _ms(point.forward), _ms(point.both)
        rows.append((point.along, f"{point.value:,}", point.workload, *times, f"{against:.2f}"))
    heads = ("along", "value", "workload", "f ms", "f+b ms", "f+b over linear")
    return SpeedTable("Scaling, against whatever smaller value makes it look worst", heads, tuple(rows))


def _over_linear(point: ScalingPoint, smaller: ScalingPoint) -> float:
    """Growth of the time over growth of the work, 1 if they are in proportion; threads divide the work."""
    more = point.value / smaller.value
    return point.both.ms / smaller.both.ms / (1 / more if point.along == "threads" else more)


def _peers(speed: EngineSpeed) -> SpeedTable:
    heads = ("peer", "workload", "C", "theirs f", "f+b", "ours f", "f+b", "ratio f", "f+b", "MiB", "ours", "")

    def row(peer: PeerCost) -> tuple[str, ...]:
        theirs = _ms(peer.theirs_forward), _ms(peer.theirs_both)
        ours = _ms(peer.ours_forward), _ms(peer.ours_both)
        ratios = f"{peer.forward_ratio:.1f}", f"{peer.both_ratio:.1f}"
        memory = f"{peer.theirs_mib:.0f}", f"{peer.ours_mib:.0f}"
        head = peer.peer, peer.workload, str(peer.channels)
        return (*head, *theirs, *ours, *ratios, *memory, peer.note)

    return SpeedTable("Peers in the same run, ms", heads, tuple(row(peer) for peer in speed.peers))


def _losses(speed: EngineSpeed) -> SpeedTable:
    rows = (
        (one.loss, str(one.size), str(one.channels), _ms(one.ours), _ms(one.torch), f"{one.ratio:.1f}")
        for one in speed.losses
    )
    heads = ("loss", "px", "C", "ours", "torch", "ratio")
    return SpeedTable("Losses, forward and backward, ms", heads, tuple(rows))


def _steps(speed: EngineSpeed) -> SpeedTable:
    names = list(dict.fromkeys(name for step in speed.steps for name in step.stages))
    rows = (
        (
            step.workload,
            step.losses,
            step.device,
            *(_ms(step.stages[name]) for name in names),
            _ms(step.whole),
        )
        for step in speed.steps
    )
    title = "A whole step of 2dgs, ms; each stage but Adam holds those before it"
    return SpeedTable(title, ("workload", "losses", "on", *names, "whole"), tuple(rows))


def _place(step: StepCost) -> tuple[str, str, str]:
    return step.workload, step.losses, step.device


def _tracer(speed: EngineSpeed) -> SpeedTable:
    heads = ("workload", "rays", "number", "tree", "f", "f+b", "ns/ray", "Mitsuba f", "f+b", "ratio f", "f+b")

    def row(cost: TracerCost) -> tuple[str, ...]:
        own = _ms(cost.build), _ms(cost.forward), _ms(cost.both), f"{cost.ns_per_ray:.0f}"
        peer = ("-" if timing is None else _ms(timing) for timing in (cost.peer_forward, cost.peer_both))
        ratios = ("-" if ratio is None else f"{ratio:.1f}" for ratio in (cost.speedup, cost.speedup_both))
        return (cost.workload, cost.kind, f"{cost.rays:,}", *own, *peer, *ratios)

    return SpeedTable(
        "Tracer beside Mitsuba's ellipsoids, ms", heads, tuple(row(one) for one in speed.tracer)
    )
