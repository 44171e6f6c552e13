# SPDX-License-Identifier: Apache-2.0
"""A change of verdict on the same fits, told from the numbers that both ledgers have."""

import math

from graycard.records import CheckEntry, ClaimEntry
from graycard.reports._format import format_number

_NOT_DECIDED = frozenset({"undecided", "open", "not supported"})
_NOT_TESTED = frozenset({"not testable here", "not checkable"})
_ALIKE = {
    "holds": ("holds", "reproduced", "larger than claimed"),
    "does not hold": ("does not hold", "no effect", "smaller than claimed", "contradicted"),
    "open": ("open", "undecided"),
}
"""Verdicts of checks that make those of graycard's own questions."""


def explain(before: ClaimEntry, after: ClaimEntry) -> str:
    """Return why the same fits are judged otherwise, as one sentence; empty where numbers do not tell."""
    found = _held_back(after) or _by_checks(after)
    if not found:
        return ""
    moved = _moved(before, after)
    return f"{before.verdict} → {after.verdict}: {moved}{found}."


def _held_back(claim: ClaimEntry) -> str:
    """Return what keeps a verdict from being given at all."""
    if claim.suspended:
        return f"suspended, as {claim.suspended.rstrip('.')}"
    if claim.verdict in _NOT_TESTED:
        return claim.text.rstrip(".")
    telling = _telling(claim)
    if claim.verdict in _NOT_DECIDED and not telling and claim.stability is not None:
        return f"only {claim.stability:.0%} of refits would give the same verdict"
    return ""


def _by_checks(claim: ClaimEntry) -> str:
    """Return what the checks show that the verdict comes from."""
    return "; ".join(dict.fromkeys(check_words(check) for check in _telling(claim)))


def _telling(claim: ClaimEntry) -> list[CheckEntry]:
    """Return the deciding checks that have the verdict of the claim, in its own words or in graycard's."""
    alike = _ALIKE.get(claim.verdict, (claim.verdict,))
    return [check for check in claim.checks if check.verdict in alike]


def _moved(before: ClaimEntry, after: ClaimEntry) -> str:
    """Return which comparisons were taken out or put in, as the beginning of a sentence."""
    old, new = ({check.asks: check.id for check in claim.checks} for claim in (before, after))
    gone = sorted({name for asks, name in old.items() if asks not in new})
    come = sorted({name for asks, name in new.items() if asks not in old})
    parts = [f"no longer decided by {', '.join(gone)}"] if gone else []
    parts += [f"now decided by {', '.join(come)}"] if come else []
    return f"{' and '.join(parts)}; " if parts else ""


def check_words(check: CheckEntry) -> str:
    """Return what the interval of a check holds, as in ``the interval −0.9 to 0.4 dB holds ...``."""
    if check.interval is None:
        return f"{check.id}: {check.scenes} scenes give no interval" if check.scenes else f"{check.id}: not measured"
    low, high = check.interval
    span = f"{check.id}: the interval {_span(low, high, check.unit)}"
    return f"{span} {_place(check, low, high)}"


def _place(check: CheckEntry, low: float, high: float) -> str:
    """Return where an interval lies, seen from no effect and from the claimed size."""
    match check.verdict:
        case "no effect":
            return "lies within what counts as no effect"
        case "contradicted":
            return "lies wholly on the other side of no effect" if not _bounds_alone(check) else _outside(check)
        case "smaller than claimed":
            sign = "above no effect, but below" if low > check.neutral else "below"
            return f"lies {sign} the claimed size, {_size(check)}"
        case "larger than claimed":
            return f"lies above the claimed size, {_size(check)}"
        case "reproduced":
            return _reproduced(check, low)
        case _:
            return _undecided(check, low, high)


def _reproduced(check: CheckEntry, low: float) -> str:
    if _bounds_alone(check):
        return f"lies within the bounds, {_size(check)}"
    above = "lies above no effect" if low > check.neutral else "leaves no effect out"
    return above if check.accepted is None else f"{above} and meets the claimed size, {_size(check)}"


def _undecided(check: CheckEntry, low: float, high: float) -> str:
    crosses = low <= check.neutral <= high
    if check.accepted is None:
        return "holds no effect" if crosses else "does not settle it"
    if _bounds_alone(check):
        return f"crosses the bounds, {_size(check)}"
    meets = high >= check.accepted[0] and low <= check.accepted[1]
    if crosses:
        return f"holds both no effect and the claimed size, {_size(check)}" if meets else "holds no effect"
    return f"meets the claimed size, {_size(check)}, which does not settle it" if meets else "does not settle it"


def _outside(check: CheckEntry) -> str:
    return f"lies outside of the bounds, {_size(check)}"


def _bounds_alone(check: CheckEntry) -> bool:
    """Return whether the check asks for smallness: no effect is then among what is accepted."""
    return check.accepted is not None and check.accepted[0] <= check.neutral <= check.accepted[1]


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
