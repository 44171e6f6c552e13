# SPDX-License-Identifier: Apache-2.0
"""The effect of a check on an axis."""

import math
from dataclasses import dataclass

from graycard.records import CheckResult
from graycard.reports._format import format_value
from graycard.reports.tables._intervals import Axis, axis_of


@dataclass(frozen=True, slots=True)
class EffectPlot:
    """The effect of a check on an axis; all places in percent of the width."""

    neutral: float
    estimate: float
    interval: tuple[float, float] | None
    """An open end reaches to the border."""
    scenes: tuple[float, ...]
    paper: float | None
    accepted: tuple[float, float] | None
    """Effects of the claimed size, as far as the axis goes."""
    ends: tuple[str, str]
    text: str
    """The same in words."""


def effect_plot(check: CheckResult) -> EffectPlot | None:
    """Return the plot of a check; None where nothing was measured. Ratios stand on a logarithmic axis."""
    if check.estimate is None or check.interval is None:
        return None
    scale = _log if check.unit == "×" else float
    wanted = [check.neutral, check.estimate, *check.scenes.values()]
    wanted += [check.paper] if check.paper is not None else []
    open_ended = (*check.interval, *(check.accepted or ()))
    wanted += [end for end in open_ended if math.isfinite(scale(end))]  # a ratio of 0 has no place
    axis = axis_of(map(scale, wanted), check.unit)
    assert axis is not None, "an estimate is finite"
    ends = tuple(format_value(v, check.unit) for v in (min(wanted), max(wanted)))
    return EffectPlot(
        axis.place(scale(check.neutral)),
        axis.place(scale(check.estimate)),
        _span(check.interval, check, axis),
        tuple(axis.place(scale(value)) for value in check.scenes.values()),
        None if check.paper is None else axis.place(scale(check.paper)),
        None if check.accepted is None else _span(check.accepted, check, axis),
        (ends[0], ends[1]),
        check.reason,
    )


def _span(ends: tuple[float, float], check: CheckResult, axis: Axis) -> tuple[float, float]:
    """Return where a span lies; an open end reaches to the border."""
    scale = _log if check.unit == "×" else float
    low, high = map(scale, ends)
    left = axis.place(low) if math.isfinite(low) else 0.0
    return left, axis.place(high) if math.isfinite(high) else 100.0


def _log(value: float) -> float:
    return math.log(value) if value > 0 else -math.inf
