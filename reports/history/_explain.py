# SPDX-License-Identifier: Apache-2.0
"""A change of verdict on the same fits, told from the numbers that both ledgers have."""

import math

from graycard.records import CheckEntry, ClaimEntry
from graycard.reports._format import format_number

_FIRST_EDITION = frozenset({"not supported", "direction only", "not checkable"})
"""Words of rules that asked other things of other intervals than are told here."""
_OF_TABLES = frozenset({"consistent", "inconsistent"})
NOT_TESTED = "not testable here"


def explain(before: ClaimEntry, after: ClaimEntry) -> str:
    """Return why the same fits are judged otherwise, as a sentence; empty where numbers do not tell."""
    if after.verdict in _FIRST_EDITION:
        return ""
    found = _held_back(after) or "; ".join(dict.fromkeys(check_words(check) for check in _telling(after)))
    if not found:
        return ""
    ours = "graycard's own question, which no paper answers; " if after.asked_by == "graycard" else ""
    return f"{before.verdict} → {after.verdict}: {ours}{_moved(before, after)}{found}."


def _held_back(claim: ClaimEntry) -> str:
    """Return what a verdict comes from where it does not come from the intervals of checks."""
    if claim.suspended:
        rule = f"by the rule {claim.before}, but held back: " if claim.before else ""
        return f"{rule}{claim.suspended.rstrip('.')}"
    if claim.verdict in _OF_TABLES:
        return "tables have words of their own, as they test no method"
    if claim.verdict == NOT_TESTED or not claim.checks:
        return claim.text.rstrip(".")
    return ""


def _telling(claim: ClaimEntry) -> list[CheckEntry]:
    """Return the deciding checks that make the verdict of the claim."""
    return [check for check in claim.checks if check.verdict == claim.verdict]


def _moved(before: ClaimEntry, after: ClaimEntry) -> str:
    """Return which comparisons were taken out, put in or changed, as the beginning of a sentence."""
    old, new = ({check.asks: check.id for check in claim.checks} for claim in (before, after))
    gone = {name for asks, name in old.items() if asks not in new}
    come = {name for asks, name in new.items() if asks not in old}
    named = (
        ("no longer decided by", gone - come),
        ("now decided by", come - gone),
        ("asked otherwise:", gone & come),
    )
    parts = [f"{words} {', '.join(sorted(names))}" for words, names in named if names]
    return f"{'; '.join(parts)}; " if parts else ""


def check_words(check: CheckEntry) -> str:
    """Return what the interval of a check holds, as in ``psnr: the interval −0.9 to 0.4 dB holds zero``."""
    if check.interval is None or not any(map(math.isfinite, check.interval)):
        return f"{check.id}: {check.scenes or 'no'} scenes give no interval"
    low, high = check.interval
    span = f"{check.id}: the interval {_span(low, high, check.unit)}"
    return f"{span} {_place(check, low, high)}"


def _place(check: CheckEntry, low: float, high: float) -> str:
    """Return where an interval lies, seen from no effect and from the claimed size."""
    match check.verdict:
        case "no effect":
            return "lies within what counts as no effect"
        case "contradicted":
            outside = f"lies outside of the bounds, {_size(check)}" if _bounds_alone(check) else ""
            return outside or f"lies wholly below {_none(check)}"
        case "smaller than claimed":
            sign = f"above {_none(check)}, but below" if low > check.neutral else "below"
            return f"lies {sign} the claimed size, {_size(check)}"
        case "larger than claimed":
            return f"lies above the claimed size, {_size(check)}"
        case "reproduced" | "holds":
            return _reproduced(check, low)
        case "does not hold":
            return _does_not_hold(check, high)
        case _:
            return _undecided(check, low, high)


def _reproduced(check: CheckEntry, low: float) -> str:
    if _bounds_alone(check):
        return f"lies within the bounds, {_size(check)}"
    above = f"lies above {_none(check)}" if low > check.neutral else f"leaves {_none(check)} out"
    if check.accepted is None:
        return above
    least, most = check.accepted
    beside = check.estimate is not None and not least <= check.estimate <= most
    middle = f", though its middle, {format_number(check.estimate or 0.0)}, does not" if beside else ""
    return f"{above} and meets the claimed size, {_size(check)}{middle}"


def _does_not_hold(check: CheckEntry, high: float) -> str:
    """Return what refutes a question of graycard's own."""
    if _bounds_alone(check):
        return f"lies outside of the bounds, {_size(check)}"
    if high < check.neutral:
        return f"lies wholly below {_none(check)}"
    below = check.accepted is not None and high < check.accepted[0]
    return f"lies below what is asked, {_size(check)}" if below else "lies within what counts as no effect"


def _undecided(check: CheckEntry, low: float, high: float) -> str:
    crosses = low <= check.neutral <= high
    if check.accepted is None:
        return f"holds {_none(check)}" if crosses else "does not settle it"
    if _bounds_alone(check):
        return f"crosses the bounds, {_size(check)}"
    meets = high >= check.accepted[0] and low <= check.accepted[1]
    if crosses:
        both = f"both {_none(check)} and the claimed size, {_size(check)}"
        return f"holds {both if meets else _none(check)}"
    met = f"meets the claimed size, {_size(check)}, which " if meets else ""
    return f"{met}does not settle it"


def _bounds_alone(check: CheckEntry) -> bool:
    """Return whether the check asks for smallness: no effect is then among what is accepted."""
    return check.accepted is not None and check.accepted[0] <= check.neutral <= check.accepted[1]


def _none(check: CheckEntry) -> str:
    """Return the effect that is none, in words."""
    return "zero" if check.neutral == 0 else format_number(check.neutral)


def _size(check: CheckEntry) -> str:
    assert check.accepted is not None, "asked only where there is a size"
    low, high = check.accepted
    if math.isinf(high):
        return f"at least {_number(low, check.unit)}"
    return f"at most {_number(high, check.unit)}" if math.isinf(low) else _span(low, high, check.unit)


def _span(low: float, high: float, unit: str) -> str:
    return f"{format_number(low)} to {_number(high, unit)}"


def _number(value: float, unit: str) -> str:
    return format_number(value) + ("" if unit == "1" else "×" if unit == "×" else f" {unit}")
