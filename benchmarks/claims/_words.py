# SPDX-License-Identifier: Apache-2.0
"""Verdicts in words: what was measured, beside what is possible and what is trivial."""

import math
from collections.abc import Sequence

from graycard.benchmarks.claims._claim import Check, Claim
from graycard.benchmarks.claims._effects import Effect
from graycard.benchmarks.claims._rules import is_negligible, signs_agree
from graycard.records import CheckResult, ClaimVerdict, MetricRecord, RowMean

_TELLS: dict[ClaimVerdict, str] = {
    "reproduced": "as claimed",
    "direction only": "the sign is as claimed, the size is not",
    "not supported": "not shown by these scenes",
    "contradicted": "the opposite of the claim",
    "not checkable": "cannot be checked here",
}


def effect_words(check: Check) -> str:
    """How the effect is made from rows."""
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
    """What makes a check reproduced."""
    if check.rule == "within":
        assert check.accepted is not None, "the file was refused without"
        return f"the whole interval {span_words(check.accepted, unit)}"
    words = "the sign is certain"
    if check.negligible:
        words += f", some of the interval is outside of {_negligible_words(check, unit)}"
    if check.rule == "monotone":
        words += ", every step goes the claimed way"
    if check.range is None:
        return f"{words}; the paper names no size"
    return f"{words}, and the mean {span_words(check.range, unit)}"


def reason_words(check: Check, verdict: ClaimVerdict, effect: Effect, unit: str, quantity: str) -> str:
    """What a verdict rests on."""
    low, high = effect.interval
    found = (
        f"{_TELLS[verdict]}: {quantity}, {effect_words(check)} = {number(effect.mean)}{of_unit(unit)} "
        f"({number(low)} to {number(high)}, {len(effect.scenes)} scenes)"
    )
    if check.negligible and is_negligible(check, effect):
        found += f"; negligible: {_negligible_words(check, unit)} counts as no difference"
    elif verdict == "not supported" and not signs_agree(check, effect):
        found += f"; by ranks p = {number(effect.p_rank)}"
    if check.paper is not None:
        found += f"; the paper: {number(check.paper)}{of_unit(unit)}"
    return found


def _negligible_words(check: Check, unit: str) -> str:
    """Effects that count as none, as in ``-0.1 to 0.1 dB``."""
    ends = check.neutral - check.negligible, check.neutral + check.negligible
    return " to ".join(map(number, ends)) + of_unit(unit)


def limits_words(record: MetricRecord, bound: RowMean, trivial: RowMean) -> str:
    """What is possible and what costs nothing, as in ``upper bound truth 42.5 dB, trivial gray 16.5 dB``."""
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
    """What the upper bound and the trivial row make of a lead; empty where they raise no doubt."""
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
    """The rows of a lead that the trivial one is no worse than."""
    others = [row for row in rows if row.row != trivial.row]
    lower = [row for row in others if row.value is not None and _beats(record, trivial.value, row.value)]
    if not lower:
        return []
    whom = "all rows compared" if len(lower) == len(rows) else ", ".join(row.row for row in lower)
    has = f"{trivial.row} has {_value_words(trivial, record)}"
    return [f"what is trivial is as good or better: {has}, no worse than {whom}"]


def _alike(check: Check, record: MetricRecord, row: RowMean, trivial: RowMean) -> str:
    """Of one row alone: whether the trivial one shows the same."""
    if row.value is None or trivial.value is None:
        return ""
    further = trivial.value - row.value if check.expects == "higher" else row.value - trivial.value
    if further < 0:
        return ""
    return f"what is trivial shows it no less: {trivial.row} has {_value_words(trivial, record)}"


def claim_words(claim: Claim, verdict: ClaimVerdict, checks: Sequence[CheckResult]) -> str:
    """The verdict of a claim in a sentence or two."""
    if claim.unavailable:
        return claim.unavailable
    deciding = [check for check in checks if check.decides]
    telling = [check for check in deciding if check.verdict == verdict]
    reasons = list(dict.fromkeys(check.reason for check in telling))
    if len(deciding) == 1:
        return reasons[0]
    if verdict == "not checkable" and len(reasons) > 1:
        return f"{reasons[0]} (and {len(reasons) - 1} more reasons)"
    words = "; ".join(reason.removeprefix(f"{_TELLS[verdict]}: ") for reason in reasons)
    return f"{len(telling)} of {len(deciding)} checks, {_TELLS[verdict]}: {words}"


def span_words(span: tuple[float, float], unit: str) -> str:
    """Where a number has to be, as in ``lies in 2.7 to 10.8 dB`` or ``is at most 0.5 dB``."""
    low, high = span
    if math.isinf(low):
        return f"is at most {number(high)}{of_unit(unit)}"
    if math.isinf(high):
        return f"is at least {number(low)}{of_unit(unit)}"
    return f"lies in {number(low)} to {number(high)}{of_unit(unit)}"


def number(value: float | None) -> str:
    """Three significant digits."""
    if value is None:
        return "–"
    return f"{value:.3g}" if abs(value) < 1000 else f"{value:.0f}"


def of_unit(unit: str) -> str:
    """A unit behind a number; none where there is none."""
    return "" if unit in ("1", "") else unit if unit == "×" else f" {unit}"


def _beats(record: MetricRecord, one: float | None, other: float) -> bool:
    """Whether a value is as good as another, or better."""
    if one is None:
        return False
    return one >= other if record.higher_is_better else one <= other
