# SPDX-License-Identifier: Apache-2.0
"""The verdicts before and after the newest edition of the rules, as a table of Markdown."""

from dataclasses import dataclass

from graycard.records import VerdictHistory
from graycard.reports.history._changes import TABLES, changes_of
from graycard.reports.history._reasons import Edition, Reasons


@dataclass(frozen=True, slots=True)
class EditionRow:
    """One claim by the rules before and by the newest ones."""

    suite: str
    claim: str
    before: str
    after: str
    why: str
    """Reason for the change; empty where the verdict stayed and nothing is told."""


def newest_edition(history: VerdictHistory, reasons: Reasons) -> Edition:
    """Return the newest edition that any ledger was judged by.

    Raises:
        RecordError: A ledger's rules are of no edition, or there is no ledger.
    """
    used = [reasons.edition(entry.rules_sha256) for entry in history.entries]
    return max(used, key=reasons.editions.index)


def edition_rows(history: VerdictHistory, reasons: Reasons) -> tuple[EditionRow, ...]:
    """Return all claims of suites that were judged by the newest edition and by one before.

    Compared are the first ledger of the newest edition and the one before it.

    Raises:
        RecordError: A ledger's rules are of no edition, or a reason does not fit the ledgers.
    """
    newest = newest_edition(history, reasons)
    told = {(c.suite, c.entry, c.claim): c.why for c in changes_of(history, reasons)}
    rows: list[EditionRow] = []
    for suite in history.suites:
        entries = history.of_suite(suite)
        editions = [reasons.edition(entry.rules_sha256) for entry in entries]
        first = editions.index(newest) if newest in editions else 0
        if first == 0:
            continue
        before, after = entries[first - 1].claims, entries[first].claims
        rows += [
            EditionRow(
                suite, name, before[name].verdict, claim.verdict, told.get((suite, first + 1, name), "")
            )
            for name, claim in after.items()
            if name in before
        ]
    return tuple(rows)


def edition_table(history: VerdictHistory, reasons: Reasons) -> str:
    """Return these rows as a table of Markdown, below a line that counts them."""
    rows = edition_rows(history, reasons)
    turned = sum(row.before != row.after for row in rows)
    name = newest_edition(history, reasons).name
    lines = [
        f"By the rules {name!r}, on the same fits as before: {turned} of {len(rows)} verdicts are others.",
        "",
        "| suite | claim | before | by these rules | why |",
        "| --- | --- | --- | --- | --- |",
    ]
    lines += [
        f"| {row.suite or TABLES} | {row.claim} | {row.before} | {row.after} | {row.why.replace('|', '/')} |"
        for row in rows
    ]
    return "\n".join(lines) + "\n"
