# SPDX-License-Identifier: Apache-2.0
"""A history that grows with what is published, and refuses verdicts that changed for no known reason."""

import json
from collections.abc import Mapping
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from graycard import RecordError
from graycard.io import to_builtins, write_bytes
from graycard.records import HISTORY, LedgerEntry, VerdictHistory, is_published, read_history, read_run
from graycard.reports.history._changes import TABLES, Change, changes_of, open_changes
from graycard.reports.history._entries import entry_of
from graycard.reports.history._page import render_history
from graycard.reports.history._reasons import REASONS, Reasons, load_reasons

HISTORY_PAGE = "history.html"
OWN = Path(__file__).parents[1] / "published"
"""Folder of graycard's own history, which ships with it."""


@dataclass(frozen=True, slots=True)
class KeptHistory:
    """A history that may be written: every change in it has a reason."""

    folder: Path
    history: VerdictHistory
    reasons: Reasons

    def files(self) -> dict[Path, bytes]:
        """Return the content of the history and of its page, by path."""
        return {
            self.folder / HISTORY: history_text(self.history).encode(),
            self.folder / HISTORY_PAGE: render_history(self.history, self.reasons).encode(),
        }

    def write(self) -> None:
        """Write the history and its page.

        Raises:
            OutputError: The folder cannot be written to, or the disk is full.
        """
        for path, content in self.files().items():
            write_bytes(path, content)


def continue_history(
    folder: Path, file: str, ledger: Mapping[str, Any], started: str = "", day: str = ""
) -> KeptHistory | None:
    """Return the history of a folder with one ledger more; nothing is written yet.

    A ledger that says the same as the last one of its suite, or of its place, is no new entry. So an earlier
    run can be published anew when another of its suite has come. Reasons may be written for the next ledger
    of several suites at once; they count when that comes.

    Args:
        folder: Folder of published runs; one without ``history.json`` keeps none.
        file: Place of the ledger below the folder.
        ledger: JSON of the ledger.
        started: Begin of the run; empty without one.
        day: Day of publication, ISO 8601; today if empty.

    Returns:
        The history, or None where the folder keeps none.

    Raises:
        RecordError: A verdict changed and nobody wrote why, the rules are of no edition that is written down,
            or a file is damaged.
    """
    if not (Path(folder) / HISTORY).is_file():
        return None
    history, reasons = read_history(folder), load_reasons(folder)
    entry = entry_of(ledger, file, day or f"{datetime.now(UTC):%Y-%m-%d}", started=started)
    reasons.edition(entry.rules_sha256)
    of_place = tuple(earlier for earlier in history.entries if earlier.file == entry.file)
    if not any(_says_the_same(entries, entry) for entries in (history.of_suite(entry.suite), of_place)):
        history = replace(history, entries=(*history.entries, entry))
    reasons = _without_coming(reasons, history, entry.suite)
    if missing := open_changes(history, reasons):
        raise RecordError(missing_reasons(missing, Path(folder)))
    return KeptHistory(Path(folder), history, reasons)


def verdict_changes(folder: Path | None = None) -> tuple[Change, ...]:
    """Return every change that a history tells.

    Args:
        folder: Folder of a history; graycard's own by default. A published run stands for the folder above,
            with the changes of its suite alone.

    Raises:
        RecordError: The folder keeps no history, a file is damaged, or a reason does not fit the ledgers.
    """
    where = Path(folder or OWN).resolve()
    if (where / HISTORY).is_file():
        return changes_of(*read_kept(where))
    above = where.parent
    if not (is_published(where) and (above / HISTORY).is_file()):
        raise RecordError(
            f"expected {HISTORY} in {where}, or in the folder above a published run, got none. Name a folder "
            "that keeps a history"
        )
    history, suite = read_history(above), read_run(where).suite
    if suite not in history.suites:
        told = ", ".join(filter(None, history.suites)) or "none"
        raise RecordError(
            f"expected a suite of {above / HISTORY} ({told}), got {suite}. Publish its run there"
        )
    reasons = _without_coming(load_reasons(above), history)
    return tuple(change for change in changes_of(history, reasons) if change.suite == suite)


def read_kept(folder: Path) -> tuple[VerdictHistory, Reasons]:
    """Return the history of a folder, and the reasons that are written for its ledgers so far.

    Raises:
        RecordError: There is none, or a file is damaged.
    """
    history = read_history(folder)
    return history, _without_coming(load_reasons(folder), history)


def missing_reasons(changes: tuple[Change, ...], folder: Path) -> str:
    """Return a message that names verdicts without a reason, and where one is to be written."""
    first = changes[0]
    listed = "; ".join(f"{c.claim} {c.before} → {c.after} ({', '.join(c.causes)})" for c in changes)
    alike = [c.claim for c in changes if (c.suite, c.entry) == (first.suite, first.entry)]
    return (
        f"expected a reason for each verdict that changed, got none for {listed} in "
        f"{first.suite or TABLES}, entry {first.entry}. Write into {folder / REASONS}: [[reasons]] "
        f'suite = "{first.suite}", entry = {first.entry}, claims = {json.dumps(alike)}, causes = [...], '
        'why = "..."'
    )


def history_text(history: VerdictHistory) -> str:
    """Return the history as JSON, one entry a line."""
    data = to_builtins(history)
    lines = ",\n".join(json.dumps(entry, ensure_ascii=False, allow_nan=False) for entry in data["entries"])
    rest = json.dumps({key: value for key, value in data.items() if key != "entries"})
    return f'{{"entries": [\n{lines}\n],\n{rest[1:]}\n'


def _without_coming(reasons: Reasons, history: VerdictHistory, but: str | None = None) -> Reasons:
    """Return reasons without those that are written for the next ledger of any suite, ``but`` one."""
    coming = {suite: len(history.of_suite(suite)) + 1 for suite in history.suites if suite != but}
    return replace(reasons, reasons=tuple(r for r in reasons.reasons if r.entry != coming.get(r.suite)))


def _says_the_same(entries: tuple[LedgerEntry, ...], entry: LedgerEntry) -> bool:
    """Return whether the last of some entries is this one but for its words and when it was published."""
    if not entries:
        return False
    return _wordless(replace(entries[-1], date=entry.date, commit=entry.commit)) == _wordless(entry)


def _wordless(entry: LedgerEntry) -> LedgerEntry:
    """Return an entry without the words of claims, which newer code may choose otherwise."""
    papers = [
        replace(paper, claims=tuple(replace(claim, text="") for claim in paper.claims))
        for paper in entry.papers
    ]
    return replace(entry, papers=tuple(papers))
