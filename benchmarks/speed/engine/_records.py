# SPDX-License-Identifier: Apache-2.0
"""Record of the speed benchmark of the engine: every figure beside what it is measured against."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from graycard.benchmarks.speed._machine import Peak, Timing
from graycard.benchmarks.speed._tracer import TracerCost

RECORD_VERSION = 2


def flops_forward(channels: int) -> int:
    """Operations of one lane forward: two for each channel, and those that every lane needs.

    These are three multiply-adds of geometry, the squares, a reciprocal with one Newton step, the low-pass,
    2^x of degree 5, thresholds and transmittance.
    """
    return 39 + 2 * channels


def flops_backward(channels: int) -> int:
    """Operations of one lane backward: all of that again, twelve sums of moments, and their reduction."""
    return 79 + 4 * channels + 7


@dataclass(frozen=True, slots=True)
class Lanes:
    """One kernel, by the lanes (pairs of pixel and surfel) that it evaluates, contributing or not."""

    evaluated: int
    ns: float
    """Time of one lane."""
    peak_share: float
    """Operations a second over those of the machine's peak with as many threads, measured in the same run."""
    efficiency: float
    """Share of the lanes that contribute."""


@dataclass(frozen=True, slots=True)
class EngineCost:
    """The engine on one workload."""

    workload: str
    surfels: int
    size: int
    """Pixels on each side."""
    channels: int
    threads: int
    pairs: int
    """Contributing pairs of pixel and surfel, counted in float64 apart from the engine."""
    stages: Mapping[str, Timing]
    """Stage by stage, in order, each repeated alone."""
    forward: Timing
    """The whole of ``rasterize_features`` without a gradient."""
    both: Timing
    """Forward and backward, to all tensors of the surfels."""
    forward_lanes: Lanes
    backward_lanes: Lanes
    working_mib: float
    """Arrays that the engine holds between forward and backward, and those that it works in."""

    @property
    def ns_forward(self) -> float:
        """Nanoseconds a contributing pair."""
        return 1e6 * self.forward.ms / self.pairs

    @property
    def ns_both(self) -> float:
        """Nanoseconds a contributing pair, forward and backward."""
        return 1e6 * self.both.ms / self.pairs

    @property
    def pairs_per_second(self) -> float:
        """Contributing pairs drawn forward and backward."""
        return 1e3 * self.pairs / self.both.ms


@dataclass(frozen=True, slots=True)
class ScalingPoint:
    """The engine with one thing changed."""

    along: str
    """Varied quantity: surfels (of a size that keeps the coverage), pixels, channels or threads."""
    value: int
    workload: str
    channels: int
    threads: int
    forward: Timing
    both: Timing


@dataclass(frozen=True, slots=True)
class PeerCost:
    """Another implementation on a workload, beside ours in the same run."""

    peer: str
    workload: str
    channels: int
    theirs_forward: Timing
    theirs_both: Timing
    ours_forward: Timing
    ours_both: Timing
    theirs_mib: float
    """By how much it makes the process grow, forward and backward."""
    ours_mib: float
    note: str = ""
    """Parts left out of the time."""

    @property
    def forward_ratio(self) -> float:
        """Speed-up of ours."""
        return self.theirs_forward.ms / self.ours_forward.ms

    @property
    def both_ratio(self) -> float:
        """Speed-up of ours, forward and backward."""
        return self.theirs_both.ms / self.ours_both.ms


@dataclass(frozen=True, slots=True)
class LossCost:
    """A loss, forward and backward, beside the same in torch."""

    loss: str
    size: int
    channels: int
    ours: Timing
    torch: Timing

    @property
    def ratio(self) -> float:
        """Speed-up of ours."""
        return self.torch.ms / self.ours.ms


@dataclass(frozen=True, slots=True)
class StepCost:
    """A whole step of ``2dgs``."""

    workload: str
    losses: str
    """Loss that it lowers."""
    whole: Timing
    stages: Mapping[str, Timing]
    """Each but Adam holds those before it."""
    device: str = "cpu"
    """Device: ``cpu``, or the name of the GPU."""


@dataclass(frozen=True, slots=True)
class EngineSpeed:
    """A whole run: what ``graycard speed engine --json`` writes."""

    started: str
    """UTC, ISO 8601."""
    environment: Mapping[str, Any]
    """Package versions, git commit, hardware."""
    threads: int
    peaks: tuple[Peak, ...]
    """With one thread, and with all."""
    engine: tuple[EngineCost, ...] = ()
    scaling: tuple[ScalingPoint, ...] = ()
    peers: tuple[PeerCost, ...] = ()
    losses: tuple[LossCost, ...] = ()
    steps: tuple[StepCost, ...] = ()
    tracer: tuple[TracerCost, ...] = ()
    left_out: tuple[str, ...] = field(default=())
    """Parts that were not measured, and why."""
    format: str = "graycard-speed-engine"
    format_version: int = RECORD_VERSION
