# SPDX-License-Identifier: Apache-2.0
"""Hold a published run against the history of verdicts beside it."""

from collections.abc import Iterator
from pathlib import Path

from graycard import RecordError
from graycard.benchmarks.validity._record import Breach
from graycard.io import sha256
from graycard.records import (
    CLAIMS,
    HISTORY,
    RUN_FILE,
    LedgerEntry,
    is_published_run,
    read_history,
    read_ledger,
)

RULE = "published"


def held_against_history(run: Path) -> tuple[list[Breach], bool]:
    """Return what differs from what the history says of a published run, and whether it says anything."""
    try:
        kept = _kept_entry(run)
    except RecordError as cause:
        return [Breach(RULE, HISTORY, str(cause), unknown=True)], False
    return ([], False) if kept is None else ([*_of_record(run, kept), *_of_verdicts(run, kept)], True)


def _of_record(run: Path, kept: LedgerEntry) -> Iterator[Breach]:
    """Compare the hash of the record."""
    if (got := sha256(run / RUN_FILE)) != kept.run_sha256:
        what = f"expected the file that was published, of hash {kept.run_sha256[:12]}, got {got[:12]}"
        yield Breach(RULE, RUN_FILE, f"{what}. Take it from where it was published")


def _of_verdicts(run: Path, kept: LedgerEntry) -> Iterator[Breach]:
    """Compare the verdict of each claim."""
    try:
        ledger = read_ledger(run)
    except RecordError as cause:
        yield Breach(RULE, CLAIMS, str(cause))
        return
    claims = [claim for paper in ledger.papers for claim in paper.claims] if ledger else []
    verdicts: dict[str, str] = {claim.id: claim.verdict for claim in claims}
    for claim in kept.claims.values():
        if (told := verdicts.get(claim.id, "none")) != claim.verdict:
            what = f"{claim.id}: expected {claim.verdict!r}, as it was published, got {told!r}"
            yield Breach(RULE, CLAIMS, f"{what}. Judge it anew with `graycard claims --republish`")


def _kept_entry(run: Path) -> LedgerEntry | None:
    """Return the last entry of a published run in the history of its folder; None where there is none.

    Raises:
        RecordError: The history is damaged or of a newer format.
    """
    folder = Path(run).resolve()
    if not is_published_run(folder) or not (folder.parent / HISTORY).is_file():
        return None
    entries = read_history(folder.parent).entries
    return next((e for e in reversed(entries) if e.file == f"{folder.name}/{CLAIMS}"), None)
