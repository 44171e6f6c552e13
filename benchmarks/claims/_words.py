# SPDX-License-Identifier: Apache-2.0
"""Verdicts in words: what was measured, beside what is possible and what is trivial."""

import math
from collections.abc import Sequence
from dataclasses import replace

from graycard.benchmarks.claims._claim import Check, Claim
from graycard.benchmarks.claims._effects import LEAST_AT_END, Effect, Levels
from graycard.benchmarks.claims._rules import is_decided, verdict_of
from graycard.eval.statistics import least_scenes
from graycard.records import CheckResult, ClaimVerdict, MetricRecord, RowMean

_TELLS: dict[ClaimVerdict, str] = {
    "reproduced": "as claimed",
    "larger than claimed": "more than claimed",
    "smaller than claimed": "less than claimed",
    "no effect": "too small to count",
    "contradicted": "the opposite of the claim",
    "undecided": "these scenes leave it open",
    "not testable here": "cannot be tested here",
}


def effect_words(check: Check) -> str:
    """Say how the effect is made from rows."""
    first, *others = check.rows if check.expects == "higher" else check.rows[::-1]
    sign = "/" if check.scale == "ratio" else "−"
    if check.rule == "monotone":
        pairs = [f"{a} {sign} {b}" for a, b in zip(check.rows, check.minus, strict=False)] or check.rows
        turn = "" if check.expects == "higher" else ", a fall counted as positive"
        return f"change from the first to the last of: {'; '.join(pairs)}{turn}"
    if not others:
        ends = (first, f"{check.against:g}") if check.expects == "higher" else (f"{check.against:g}", first)
        words = f"{ends[0]} {sign} {ends[1]}" if check.against or check.expects == "lower" else first
    else:
        words = f"{first} {sign} {others[0]}"
    if check.along is None:
        return words
    along = check.along
    return f"change of ({words}) when {along.knob} goes from {along.low:g} to {along.high:g}"


def rule_words(check: Check, unit: str) -> str:
    """Say what makes a check reproduced."""
    if check.rule == "within":
        assert check.accepted is not None, "the file was refused without"
        return f"the whole interval {span_words(check.accepted, unit)}"
    words = f"the whole interval is above {number(check.neutral)}{of_unit(unit)}"
    if check.negligible:
        words += f", not all of it in {_negligible_words(check, unit)}"
    if check.rule == "monotone":
        words += ", every step goes the claimed way"
    if check.range is None:
        return f"{words}; the paper names no size"
    return f"{words}, and some of it {span_words(check.range, unit)}"


def reason_words(
    check: Check, verdict: ClaimVerdict, effect: Effect, scenes: int, levels: Levels, told: CheckResult
) -> str:
    """Say what a verdict rests on.

    Args:
        check: What was asked.
        verdict: By the rules.
        effect: What was measured.
        scenes: On how many scenes.
        levels: Of its intervals.
        told: The check with its quantity and unit in words.
    """
    low, high = effect.interval
    unit = of_unit(told.unit)
    found = (
        f"{_TELLS[verdict]}: {told.quantity}, {effect_words(check)} = {number(effect.estimate)}{unit} "
        f"({number(low)} to {number(high)}, {scenes} scenes)"
    )
    if math.isinf(low) and math.isinf(high):
        found += f"; {_few_words(check, levels.usual)}"
    if verdict == "no effect":
        found += f"; {_negligible_words(check, told.unit)} counts as no difference"
    if check.paper is not None:
        found += f"; the paper: {number(check.paper)}{unit}"
    return found


def strict_words(
    check: Check, verdict: ClaimVerdict, effect: Effect, scenes: int, levels: Levels, by: str
) -> str:
    """Say that a word is certain by the interval shown but not by the stricter one that it needs; empty if
    not.

    Args:
        check: What was asked.
        verdict: By the rules.
        effect: What was measured.
        scenes: On how many scenes.
        levels: Of its intervals.
        by: ``all`` or ``any`` of the claim's checks.
    """
    loose = verdict_of(check, replace(effect, strict=effect.interval), by)
    if loose == verdict or not is_decided(loose):
        return ""
    needed = least_scenes(levels.strict)
    more = f", which needs {needed} scenes" if scenes < needed and check.along is None else ""
    return (
        f"{loose} at {percent(levels.usual)}, but one of several checks has to be certain at "
        f"{percent(levels.strict)}{more}"
    )


def percent(level: float) -> str:
    """Return a level as in ``99.25 %``."""
    return f"{100 * level:.4g} %"


def _few_words(check: Check, level: float) -> str:
    """Say what an interval would need."""
    if check.along is not None:
        return f"a line needs {LEAST_AT_END} scenes towards either value of {check.along.knob}"
    return f"an interval at {percent(level)} needs {least_scenes(level)} scenes"


def _negligible_words(check: Check, unit: str) -> str:
    """Effects that count as none, as in ``-0.1 to 0.1 dB``."""
    ends = check.neutral - check.negligible, check.neutral + check.negligible
    return " to ".join(map(number, ends)) + of_unit(unit)


def limits_words(record: MetricRecord, bound: RowMean, trivial: RowMean) -> str:
    """Say what is possible and what costs nothing, as in ``upper bound truth 42.5 dB, trivial gray 16.5
    dB``.
    """
    named = ("upper bound", bound), ("trivial", trivial)
    return ", ".join(f"{what} {row.row} {_value_words(row, record)}" for what, row in named)


def _value_words(row: RowMean, record: MetricRecord) -> str:
    if row.value is None:
        return row.reason
    words = f"{number(row.value)}{of_unit(record.unit)}"
    return f"{words} ({row.reason})" if row.reason else words


def beside_words(
    check: Check, record: MetricRecord, rows: Sequence[RowMean], bound: RowMean, trivial: RowMean
) -> str:
    """Say what the upper bound and the trivial row make of a lead; empty where they raise no doubt."""
    if check.rule != "better" or record.group == "cost":
        return ""
    if len(rows) == 1:
        return _alike(check, record, rows[0], trivial)
    if not check.quantity.is_plain:
        return ""
    found = []
    if (check.expects == "higher") is record.higher_is_better:
        found += _trivial(record, rows, trivial)
    mine = rows[0].value
    if mine is not None and bound.value is not None and bound.value != mine and not bound.reason:
        above = f"{rows[0].row} is above the upper bound {bound.row}, which should not be possible"
        found += [above] if _beats(record, mine, bound.value) else []
    return "; ".join(found)


def _trivial(record: MetricRecord, rows: Sequence[RowMean], trivial: RowMean) -> list[str]:
    """Say which rows of a lead the trivial one is no worse than."""
    others = [row for row in rows if row.row != trivial.row]
    lower = [row for row in others if row.value is not None and _beats(record, trivial.value, row.value)]
    if not lower:
        return []
    whom = "all rows compared" if len(lower) == len(rows) else ", ".join(row.row for row in lower)
    has = f"{trivial.row} has {_value_words(trivial, record)}"
    return [f"what is trivial is as good or better: {has}, no worse than {whom}"]


def _alike(check: Check, record: MetricRecord, row: RowMean, trivial: RowMean) -> str:
    """Say if the trivial row shows the same as one row alone; empty if not."""
    if row.value is None or trivial.value is None:
        return ""
    further = trivial.value - row.value if check.expects == "higher" else row.value - trivial.value
    if further < 0:
        return ""
    return f"what is trivial shows it no less: {trivial.row} has {_value_words(trivial, record)}"


def claim_words(claim: Claim, verdict: ClaimVerdict, checks: Sequence[CheckResult]) -> str:
    """Say in a sentence or two what a claim's verdict by the rules comes from.

    Args:
        claim: With how it is judged.
        verdict: That of the rules, before anything holds it back.
        checks: Its checks, with verdicts in the same words.
    """
    if claim.unavailable:
        return claim.unavailable
    deciding = [check for check in checks if check.decides]
    telling = [check for check in deciding if check.verdict == verdict]
    reasons = list(dict.fromkeys(check.reason for check in telling))
    if len(deciding) == 1:
        return reasons[0]
    if verdict == "not testable here" and len(reasons) > 1:
        return f"{reasons[0]} (and {len(reasons) - 1} more reasons)"
    words = "; ".join(reason.removeprefix(f"{_TELLS[verdict]}: ") for reason in reasons)
    return f"{_TELLS[verdict]} in {len(telling)} of {len(deciding)} checks: {words}"


def span_words(span: tuple[float, float], unit: str) -> str:
    """Say where a number has to be, as in ``lies in 2.7 to 10.8 dB`` or ``is at most 0.5 dB``."""
    low, high = span
    if math.isinf(low):
        return f"is at most {number(high)}{of_unit(unit)}"
    if math.isinf(high):
        return f"is at least {number(low)}{of_unit(unit)}"
    return f"lies in {number(low)} to {number(high)}{of_unit(unit)}"


def number(value: float | None) -> str:
    """Return three significant digits."""
    if value is None:
        return "–"
    if math.isinf(value):
        return "∞" if value > 0 else "−∞"
    return f"{value:.3g}" if abs(value) < 1000 else f"{value:.0f}"


def of_unit(unit: str) -> str:
    """Return a unit as it stands behind a number; empty where there is none."""
    return "" if unit in ("1", "") else unit if unit == "×" else f" {unit}"


def _beats(record: MetricRecord, one: float | None, other: float) -> bool:
    """Tell if a value is as good as another, or better."""
    if one is None:
        return False
    return one >= other if record.higher_is_better else one <= other
