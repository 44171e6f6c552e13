# SPDX-License-Identifier: Apache-2.0
"""Changes from one ledger of a suite to the next, and their reasons."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

from graycard import RecordError
from graycard.records import ClaimEntry, LedgerEntry, VerdictHistory
from graycard.reports.history._explain import NOT_TESTED, explain
from graycard.reports.history._reasons import CAUSES, REASONS, Cause, Reasons

TABLES = "papers' own tables"
"""Name of what has no suite."""


@dataclass(frozen=True, slots=True)
class Change:
    """A claim that one ledger judges otherwise than the one before, or by other checks."""

    suite: str
    entry: int
    """Number of the later ledger among those of its suite, from 1."""
    claim: str
    before: str
    after: str
    causes: tuple[Cause, ...]
    why: str
    """Sentences that are written down, then what numbers of both ledgers say; empty if neither is known."""
    is_open: bool
    """True where somebody still has to write why."""


def changes_of(history: VerdictHistory, reasons: Reasons) -> tuple[Change, ...]:
    """Return every change of the history, suite by suite.

    Raises:
        RecordError: A reason is of no such ledger or claim, or names a cause that the ledgers deny.
    """
    found = tuple(change for suite in history.suites for change in _of_suite(history, suite, reasons))
    _check_reasons(history, reasons)
    return found


def open_changes(history: VerdictHistory, reasons: Reasons) -> tuple[Change, ...]:
    """Return the changes that nobody has given a reason for."""
    return tuple(change for change in changes_of(history, reasons) if change.is_open)


def possible_causes(
    before: LedgerEntry, after: LedgerEntry, claim: str, reasons: Reasons
) -> tuple[Cause, ...]:
    """Return the causes that two ledgers allow for a change of a claim.

    New fits may come from a changed method, which ledgers cannot tell.
    """
    old, new = before.claims[claim], after.claims[claim]
    found: dict[Cause, bool] = {
        "new run": before.started != after.started,
        "rows added": _has_more(before, after) and old.verdict == NOT_TESTED,
        "noise measured": _is_judged_alike(before, after, claim) and old.stability != new.stability,
        "method changed": before.started != after.started,
        "checks changed": _file(before, claim) != _file(after, claim) or _asks(old) != _asks(new),
        "rules changed": reasons.edition(before.rules_sha256) != reasons.edition(after.rules_sha256),
    }
    return tuple(cause for cause in CAUSES if found[cause])


def _of_suite(history: VerdictHistory, suite: str, reasons: Reasons) -> Iterator[Change]:
    for number, (before, after) in enumerate(pairwise(history.of_suite(suite)), 2):
        both = [claim for claim in after.claims if claim in before.claims]
        yield from filter(None, (_change(before, after, claim, number, reasons) for claim in both))


def _change(
    before: LedgerEntry, after: LedgerEntry, claim: str, number: int, reasons: Reasons
) -> Change | None:
    """Return the change of one claim; None where nothing changed that anybody tells."""
    old, new = before.claims[claim], after.claims[claim]
    written = reasons.of_claim(after.suite, number, claim)
    if old.verdict == new.verdict and not written:
        return None
    same_fits = before.started == after.started
    same_asks = _asks(old) == _asks(new)
    told = explain(old, new) if same_fits and old.verdict != new.verdict else ""
    return Change(
        suite=after.suite,
        entry=number,
        claim=claim,
        before=old.verdict,
        after=new.verdict,
        causes=_causes(before, after, claim, reasons, number),
        why=" ".join([*(reason.why for reason in written), *([told] if told else [])]),
        is_open=not written and not (told and (same_asks or new.verdict == NOT_TESTED)),
    )


def _causes(
    before: LedgerEntry, after: LedgerEntry, claim: str, reasons: Reasons, number: int
) -> tuple[Cause, ...]:
    """Return the causes that are written down, or else those that the ledgers themselves show."""
    if written := reasons.of_claim(after.suite, number, claim):
        return tuple(cause for cause in CAUSES if any(cause in reason.causes for reason in written))
    possible = possible_causes(before, after, claim, reasons)
    same = _asks(before.claims[claim]) == _asks(after.claims[claim])
    hidden = ("method changed", "checks changed") if same else ("method changed",)
    return tuple(cause for cause in possible if cause not in hidden)


def _check_reasons(history: VerdictHistory, reasons: Reasons) -> None:
    for reason in reasons.reasons:
        entries = history.of_suite(reason.suite)
        where = f"{REASONS}: {reason.suite or TABLES}, entry {reason.entry}"
        if not 2 <= reason.entry <= len(entries):
            raise RecordError(f"expected an entry from 2 to {len(entries)} of the suite, got {where}")
        before, after = entries[reason.entry - 2 : reason.entry]
        for claim in reason.claims:
            if claim not in before.claims or claim not in after.claims:
                raise RecordError(f"expected claims that both ledgers judge, got {claim!r} in {where}")
            possible = possible_causes(before, after, claim, reasons)
            if denied := [cause for cause in reason.causes if cause not in possible]:
                raise RecordError(
                    f"expected causes that the ledgers allow ({', '.join(possible) or 'none'}), got "
                    f"{', '.join(denied)} for {claim!r} in {where}"
                )


def _has_more(before: LedgerEntry, after: LedgerEntry) -> bool:
    """Tell whether two ledgers are of one run that went on in between."""
    return before.started == after.started and before.run_sha256 != after.run_sha256


def _is_judged_alike(before: LedgerEntry, after: LedgerEntry, claim: str) -> bool:
    """Tell whether a claim is asked the same of the same fits, by the same rules."""
    kept = (before.started, before.run_sha256, before.rules_sha256, _asks(before.claims[claim]))
    return kept == (after.started, after.run_sha256, after.rules_sha256, _asks(after.claims[claim]))


def _asks(claim: ClaimEntry) -> frozenset[tuple[object, ...]]:
    """Return what the claim stands on, whatever the words."""
    return frozenset(check.asks for check in claim.checks)


def _file(entry: LedgerEntry, claim: str) -> str:
    """Return the hash of the file that a claim was read from."""
    return next(p.claims_sha256 for p in entry.papers if any(c.id == claim for c in p.claims))
