# SPDX-License-Identifier: Apache-2.0
"""Means, intervals and ceilings of one metric on one axis, a small plot for each method."""

import math
from collections.abc import Iterable
from dataclasses import dataclass

from graycard.records import MethodStanding
from graycard.reports._format import format_value

PAD = 0.06
"""Share of the plot that is left free on either side."""


@dataclass(frozen=True, slots=True)
class Axis:
    """The range of one metric over all methods, and where its numbers stand in a plot."""

    low: float
    high: float
    unit: str

    @property
    def ends(self) -> tuple[str, str]:
        """The numbers at both ends of the plot."""
        return format_value(self.low, self.unit), format_value(self.high, self.unit)

    def place(self, value: float) -> float:
        """Return where a value stands, in percent of the width; what lies beyond at the edge."""
        share = (
            min(max((value - self.low) / (self.high - self.low), 0.0), 1.0) if self.high > self.low else 0.5
        )
        return round(100 * (PAD + (1 - 2 * PAD) * share), 2)


@dataclass(frozen=True, slots=True)
class IntervalPlot:
    """One method's mean and interval, with its ceiling; all places in percent of the width."""

    mean: float
    interval: tuple[float, float] | None
    ceiling: float | None
    beyond: str
    """``low`` or ``high`` for a mean that lies beyond the axis, else empty."""
    text: str
    """The same in words."""


def axis_of(values: Iterable[float], unit: str) -> Axis | None:
    """Return the axis that holds all finite values; None where there are none."""
    finite = [v for v in values if math.isfinite(v)]
    if not finite:
        return None
    low, high = min(finite), max(finite)
    spare = 0.0 if high > low else max(abs(high), 1.0) * 0.05
    return Axis(low - spare, high + spare, unit)


def axis_of_standings(standings: Iterable[MethodStanding], unit: str) -> Axis | None:
    """Return the axis of the means, intervals and ceilings of methods; None where all are one number."""
    found = {v for s in standings for v in (s.mean, s.ceiling, *(s.interval or ())) if v is not None}
    return axis_of(found, unit) if len(found) > 1 else None


def interval_plot(standing: MethodStanding, axis: Axis | None) -> IntervalPlot | None:
    """Return the plot of a method; None where it has no mean."""
    if standing.mean is None or axis is None:
        return None
    beyond = "high" if standing.mean > axis.high else "" if standing.mean >= axis.low else "low"
    ends = standing.interval
    return IntervalPlot(
        axis.place(standing.mean),
        None if ends is None else (axis.place(ends[0]), axis.place(ends[1])),
        None if standing.ceiling is None else axis.place(standing.ceiling),
        beyond,
        _text(standing, axis.unit),
    )


def _text(standing: MethodStanding, unit: str) -> str:
    parts = [f"mean {format_value(standing.mean or 0.0, unit)}"]
    if standing.interval is not None:
        low, high = (format_value(end, unit) for end in standing.interval)
        parts.append(f"95 % interval {low} to {high}")
    else:
        parts.append(f"no interval from {standing.scenes} scene{'s' * (standing.scenes != 1)}")
    if standing.seed_sd is not None:
        parts.append(f"standard deviation between seeds {format_value(standing.seed_sd, unit)}")
    if standing.ceiling is not None:
        parts.append(f"ceiling {format_value(standing.ceiling, unit)}")
    return ", ".join(parts)
