# SPDX-License-Identifier: Apache-2.0
"""The claims of papers as the report shows them: verdicts in words, and each effect on an axis."""

import math
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import get_args

from graycard import GraycardError
from graycard.io import sha256
from graycard.records import CheckResult, ClaimResult, ClaimVerdict, PaperResult, RowMean, read_ledger
from graycard.reports._format import count, format_number, format_p, format_value
from graycard.reports.tables._intervals import Axis, axis_of


@dataclass(frozen=True, slots=True)
class EffectPlot:
    """The effect of a check on an axis; all places in percent of the width."""

    neutral: float
    mean: float
    interval: tuple[float, float] | None
    scenes: tuple[float, ...]
    paper: float | None
    accepted: tuple[float, float] | None
    """Effects of the claimed size, as far as the axis goes."""
    ends: tuple[str, str]
    text: str
    """The same in words."""


@dataclass(frozen=True, slots=True)
class CheckRow:
    """One comparison that a claim comes down to."""

    check: CheckResult
    plot: EffectPlot | None
    mean: str
    interval: str
    evidence: str
    paper: str
    rows: tuple[tuple[str, str], ...]
    """Label and mean of each compared row."""
    limits: tuple[tuple[str, str], ...]
    """The same of the upper bound and of what is trivial."""


@dataclass(frozen=True, slots=True)
class ClaimRow:
    """One claim with its comparisons."""

    claim: ClaimResult
    checks: tuple[CheckRow, ...]


@dataclass(frozen=True, slots=True)
class PaperRows:
    """The claims of one paper."""

    title: str
    version: int
    counted: str
    """How many claims came to which verdict."""
    claims: tuple[ClaimRow, ...]


@dataclass(frozen=True, slots=True)
class ClaimsSection:
    """What the run says of papers."""

    papers: tuple[PaperRows, ...]
    rules: Mapping[str, str]
    stale: bool
    """Whether ``run.json`` has changed since."""
    fault: str = ""
    """Why the ledger cannot be read; empty where it can."""


def claims_section(run: Path) -> ClaimsSection | None:
    """The section of a run; None where its claims were not judged."""
    try:
        ledger = read_ledger(run)
    except GraycardError as cause:
        return ClaimsSection((), {}, stale=False, fault=str(cause))
    if ledger is None:
        return None
    stale = ledger.run_sha256 != sha256(run / "run.json")
    return ClaimsSection(tuple(map(_paper, ledger.papers)), ledger.rules, stale)


def _paper(paper: PaperResult) -> PaperRows:
    counted = Counter(claim.verdict for claim in paper.claims)
    words = [f"{counted[v]} {v}" for v in get_args(ClaimVerdict) if counted[v]]
    claims = tuple(ClaimRow(claim, tuple(map(_check, claim.checks))) for claim in paper.claims)
    return PaperRows(paper.title, paper.version, f"{count(len(claims), 'claim')}: {', '.join(words)}", claims)


def _check(check: CheckResult) -> CheckRow:
    interval = check.interval
    n = len(check.scenes)
    chances = [p for p in (check.p_mean, check.p_rank) if p is not None]
    return CheckRow(
        check,
        effect_plot(check),
        "" if check.mean is None else _with_unit(check.mean, check.unit),
        "" if interval is None else " to ".join(format_value(end, check.unit) for end in interval),
        ", ".join([*([format_p(max(chances))] if chances else []), *([f"n = {n}"] if n else [])]),
        "" if check.paper is None else _with_unit(check.paper, check.unit),
        tuple((row.row, _mean(row, check)) for row in check.rows),
        _limits(check),
    )


def effect_plot(check: CheckResult) -> EffectPlot | None:
    """The plot of a check; None where nothing was measured. Ratios stand on a logarithmic axis."""
    if check.mean is None or check.interval is None:
        return None
    scale = _log if check.unit == "×" else float
    wanted = [check.neutral, check.mean, *check.interval, *check.scenes.values()]
    wanted += [check.paper] if check.paper is not None else []
    wanted += [end for end in check.accepted or () if math.isfinite(scale(end))]  # a ratio of 0 has no place
    axis = axis_of(map(scale, wanted), check.unit)
    assert axis is not None, "a mean is finite"
    ends = tuple(format_value(v, check.unit) for v in (min(wanted), max(wanted)))
    low, high = check.interval
    return EffectPlot(
        axis.place(scale(check.neutral)),
        axis.place(scale(check.mean)),
        (axis.place(scale(low)), axis.place(scale(high))),
        tuple(axis.place(scale(value)) for value in check.scenes.values()),
        None if check.paper is None else axis.place(scale(check.paper)),
        _band(check, axis),
        (ends[0], ends[1]),
        check.reason,
    )


def _band(check: CheckResult, axis: Axis) -> tuple[float, float] | None:
    """Where effects of the claimed size lie; an open end reaches to the border."""
    if check.accepted is None:
        return None
    scale = _log if check.unit == "×" else float
    low, high = check.accepted
    left = axis.place(scale(low)) if math.isfinite(scale(low)) else 0.0
    right = axis.place(scale(high)) if math.isfinite(scale(high)) else 100.0
    return left, right


def _log(value: float) -> float:
    return math.log(value) if value > 0 else -math.inf


def _limits(check: CheckResult) -> tuple[tuple[str, str], ...]:
    beside = (("upper bound", check.bound), ("trivial", check.trivial))
    return tuple((f"{what} {row.row}", _mean(row, check)) for what, row in beside if row is not None)


def _mean(row: RowMean, check: CheckResult) -> str:
    return ", ".join(filter(None, (_mean_alone(row.value, check), row.reason)))


def _mean_alone(value: float | None, check: CheckResult) -> str:
    if value is None:
        return ""
    if check.unit == "×":  # of which the rows themselves have another unit
        return f"{value:.0f}" if abs(value) >= 100 else format_number(value)
    return format_value(value, check.unit)


def _with_unit(value: float, unit: str) -> str:
    text = format_value(value, unit)
    return text if unit == "1" else f"{text}×" if unit == "×" else f"{text} {unit}"
