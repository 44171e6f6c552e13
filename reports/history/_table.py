# SPDX-License-Identifier: Apache-2.0
"""The verdicts before and after the newest edition of the rules, as lists of Markdown."""

import re
from collections import Counter
from dataclasses import dataclass
from itertools import groupby
from typing import Final

from graycard.records import VerdictHistory
from graycard.reports._format import count
from graycard.reports.history._changes import TABLES, changes_of
from graycard.reports.history._reasons import Edition, Reasons

_RENAMED: Final = {
    ("reproduced", "consistent"),
    ("contradicted", "inconsistent"),
    ("reproduced", "holds"),
    ("contradicted", "does not hold"),
    ("not checkable", "not testable here"),
}
"""Words before and after that tell the same finding: tables and own questions got words of their own."""


@dataclass(frozen=True, slots=True)
class EditionRow:
    """One claim by the rules before and by the newest ones."""

    suite: str
    claim: str
    before: str
    after: str
    why: str
    """Reason for the change; empty where the verdict stayed and nothing is told."""

    @property
    def found(self) -> str:
        """Return what became of the verdict: another finding, another word for the same one, or nothing."""
        if self.before == self.after:
            return "stayed"
        return "renamed" if (self.before, self.after) in _RENAMED else "another finding"


def newest_edition(history: VerdictHistory, reasons: Reasons) -> Edition:
    """Return the newest edition that any ledger was judged by.

    Raises:
        RecordError: A ledger's rules are of no edition, or there is no ledger.
    """
    used = [reasons.edition(entry.rules_sha256) for entry in history.entries]
    return max(used, key=reasons.editions.index)


def edition_rows(history: VerdictHistory, reasons: Reasons) -> tuple[EditionRow, ...]:
    """Return all claims of suites that were judged by the newest edition and by one before.

    Compared are the first ledger of the newest edition and the one before it. A paper's own table needs no
    run: it is a row once, though ledgers of runs repeat its verdict.

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
    tables = {(row.claim, row.before, row.after) for row in rows if not row.suite}
    return tuple(r for r in rows if not (r.suite and (r.claim, r.before, r.after) in tables))


def edition_list(history: VerdictHistory, reasons: Reasons) -> str:
    """Return these rows as lists of Markdown, one a suite, below a line that counts them."""
    rows = edition_rows(history, reasons)
    name = newest_edition(history, reasons).name
    lines = [f"By the rules {name!r}, on the same fits as before, {_counted(rows)}."]
    for suite, of_suite in groupby(rows, key=lambda row: row.suite):
        lines += ["", f"### {suite or TABLES}", "", *map(_line, of_suite)]
    return "\n".join(lines) + "\n"


def _line(row: EditionRow) -> str:
    """Return one claim as an entry of a list: its verdicts once, then the reason."""
    change = f"{row.before} → {row.after}" if row.before != row.after else row.after
    why = re.sub(rf"{re.escape(change)}: (.)", lambda found: found[1].upper(), row.why)
    return f"- **{row.claim}**: {change}. {why}".rstrip()


def _counted(rows: tuple[EditionRow, ...]) -> str:
    """Return how many verdicts are another finding, and how many the same finding by another word."""
    found = Counter(row.found for row in rows)
    words = dict.fromkeys(f"{row.before} → {row.after}" for row in rows if row.found == "renamed")
    renamed = f"{found['renamed']} have a new word for the same one ({', '.join(words)})" if words else ""
    parts = [f"{found['another finding']} of {count(len(rows), 'verdict')} tell another finding", renamed]
    parts += [f"{found['stayed']} stayed as before"] if found["stayed"] else []
    return ", ".join(filter(None, parts))
