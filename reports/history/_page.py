# SPDX-License-Identifier: Apache-2.0
"""The page of the history: a table a suite, a row a claim, a column for each time that anything changed."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

from markupsafe import Markup

from graycard.records import LedgerEntry, VerdictHistory
from graycard.reports._format import count
from graycard.reports._templates import asset, content_policy, environment
from graycard.reports.history._changes import TABLES, Change, changes_of
from graycard.reports.history._reasons import Reasons

Changes = Mapping[tuple[int, str], Change]
"""Changes of one suite, by number of the entry and claim."""


@dataclass(frozen=True, slots=True)
class Column:
    """Ledgers of a suite, one after the other, that say the same by the same rules."""

    title: str
    """Their numbers, as in ``Entry 1`` and ``Entries 2 to 4``."""
    date: str
    edition: str
    facts: tuple[str, ...]
    """Versions, run and commits."""


@dataclass(frozen=True, slots=True)
class Cell:
    """A claim in one column."""

    verdict: str
    """Empty where the ledgers do not judge the claim."""
    mark: str = ""
    """``changed``, or ``same verdict``, other checks; empty where nothing is told."""
    causes: str = ""
    why: str = ""


@dataclass(frozen=True, slots=True)
class Row:
    """A claim through all columns."""

    claim: str
    sentence: str
    cells: tuple[Cell, ...]

    @property
    def changed(self) -> bool:
        """Return whether its verdict ever changed."""
        return any(cell.mark == "changed" for cell in self.cells)


@dataclass(frozen=True, slots=True)
class SuiteHistory:
    """The table of one suite."""

    anchor: str
    title: str
    counted: str
    notes: tuple[str, ...]
    columns: tuple[Column, ...]
    rows: tuple[Row, ...]


def render_history(history: VerdictHistory, reasons: Reasons, home: str = "") -> str:
    """Return the page as HTML text without any reference to another host.

    Args:
        history: All ledgers.
        reasons: The words of people.
        home: File beside it that the page leads back to, as the first page of a site; none if empty.

    Raises:
        RecordError: A reason does not fit the ledgers.
    """
    style = asset("report.css") + asset("history.css")
    used = {entry.rules_sha256 for entry in history.entries}
    return (
        environment()
        .get_template("history.html.j2")
        .render(
            suites=suite_histories(history, reasons),
            home=home,
            editions=tuple(e for e in reasons.editions if used & set(e.rules)),
            verdict_class=verdict_class,
            style=Markup(style),
            policy=content_policy(style, ""),
        )
    )


def suite_histories(history: VerdictHistory, reasons: Reasons) -> tuple[SuiteHistory, ...]:
    """Return the tables of all suites."""
    changes = changes_of(history, reasons)
    return tuple(
        _suite(history.of_suite(suite), reasons, {(c.entry, c.claim): c for c in changes if c.suite == suite})
        for suite in history.suites
    )


def verdict_class(verdict: str) -> str:
    """Return the class of a verdict in the style sheet."""
    return verdict.replace(" ", "-")


def _suite(entries: Sequence[LedgerEntry], reasons: Reasons, changes: Changes) -> SuiteHistory:
    suite = entries[0].suite
    groups = _groups(entries, reasons, changes)
    newest = {claim.id: claim.sentence for entry in entries for claim in entry.claims.values()}
    rows = tuple(
        Row(claim, sentence, tuple(_cell(entries, group, claim, changes) for group in groups))
        for claim, sentence in newest.items()
    )
    turned = sum(change.before != change.after for change in changes.values())
    return SuiteHistory(
        suite or "tables",
        suite or TABLES,
        f"{count(len(entries), 'ledger')}, {count(len(rows), 'claim')}; verdicts changed: {turned}",
        tuple(note.says for note in reasons.notes if note.suite == suite),
        tuple(_column(entries, group, reasons) for group in groups),
        rows,
    )


def _groups(entries: Sequence[LedgerEntry], reasons: Reasons, changes: Changes) -> list[range]:
    """Return runs of entries, counted from 0, between which nothing is told to have changed."""
    told = {entry for entry, _ in changes}
    starts = [0]
    for number, (before, after) in enumerate(pairwise(entries), 2):
        edition = reasons.edition(before.rules_sha256) != reasons.edition(after.rules_sha256)
        if edition or number in told or before.started != after.started:
            starts.append(number - 1)
    return [range(first, last) for first, last in pairwise([*starts, len(entries)])]


def _column(entries: Sequence[LedgerEntry], group: range, reasons: Reasons) -> Column:
    found = [entries[index] for index in group]
    last = found[-1]
    first, end = group[0] + 1, group[-1] + 1
    dates = list(dict.fromkeys((found[0].date, last.date)))
    commits = ", ".join(entry.commit for entry in found if entry.commit)
    run = (
        f"suite version {last.suite_version}",
        f"run of {last.started[:16].replace('T', ', ')}",
        f"run.json {last.run_sha256[:8]}",
    )
    facts = (
        f"claims {_versions(found)}",
        *(run if last.suite else ()),
        *((f"commits: {commits}",) if commits else ()),
    )
    return Column(
        f"Entry {first}" if first == end else f"Entries {first} to {end}",
        " to ".join(dates),
        reasons.edition(last.rules_sha256).name,
        facts,
    )


def _versions(entries: Sequence[LedgerEntry]) -> str:
    """Return which versions of which files of claims, as in ``goris 1 to 7, gsid 2``."""
    found: dict[str, list[int]] = {}
    for paper in (paper for entry in entries for paper in entry.papers):
        found.setdefault(paper.name, []).append(paper.version)
    return ", ".join(f"{name} {_from_to(versions)}" for name, versions in found.items())


def _from_to(versions: Sequence[int]) -> str:
    low, high = min(versions), max(versions)
    return str(low) if low == high else f"{low} to {high}"


def _cell(entries: Sequence[LedgerEntry], group: range, claim: str, changes: Changes) -> Cell:
    judged = entries[group[0]].claims.get(claim)
    if judged is None:
        return Cell("")
    change = changes.get((group[0] + 1, claim))
    if change is None:
        return Cell(judged.verdict)
    mark = "same verdict" if change.before == change.after else "changed"
    return Cell(judged.verdict, mark, ", ".join(change.causes), change.why)
