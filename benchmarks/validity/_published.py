# SPDX-License-Identifier: Apache-2.0
"""Hold a published run against the history of verdicts beside it."""

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


def published_breaches(run: Path) -> list[Breach]:
    """Return what differs from what the history says of a published run; nothing where none is kept."""
    try:
        kept = _kept_entry(run)
    except RecordError as cause:
        return [Breach(RULE, HISTORY, str(cause), unknown=True)]
    if kept is None:
        return []
    found = []
    if (got := sha256(run / RUN_FILE)) != kept.run_sha256:
        what = f"expected the file that was published, of hash {kept.run_sha256[:12]}, got {got[:12]}"
        found.append(Breach(RULE, RUN_FILE, f"{what}. Take it from where it was published"))
    try:
        ledger = read_ledger(run)
    except RecordError as cause:
        return [*found, Breach(RULE, CLAIMS, str(cause))]
    claims = [claim for paper in ledger.papers for claim in paper.claims] if ledger else []
    verdicts: dict[str, str] = {claim.id: claim.verdict for claim in claims}
    for claim in kept.claims.values():
        if (told := verdicts.get(claim.id, "none")) != claim.verdict:
            what = f"{claim.id}: expected {claim.verdict!r}, as it was published, got {told!r}"
            found.append(Breach(RULE, CLAIMS, f"{what}. Judge it anew with `graycard claims --republish`"))
    return found


def is_in_history(run: Path) -> bool:
    """Tell whether a history beside a published run has an entry of it that can be read."""
    try:
        return _kept_entry(run) is not None
    except RecordError:
        return False


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
