# SPDX-License-Identifier: Apache-2.0
"""Every verdict that was ever published, ledger by ledger: ``history.json``."""

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from graycard.io import Name, RelativePath
from graycard.records._run import read_record

HISTORY = "history.json"
"""Beside the published folders that it is about."""
HISTORY_VERSION = 1


@dataclass(frozen=True, slots=True)
class CheckEntry:
    """One deciding comparison as a ledger had it."""

    id: str
    effect_of: str
    """Effect as it is made from rows, in words."""
    quantity: str
    verdict: str
    """In the words of the rules of that time, as all verdicts here."""
    scenes: int = 0
    """Number of scenes that the effect was measured on."""
    unit: str = "1"
    """Unit of the numbers below; ``×`` where they are ratios."""
    estimate: float | None = None
    """Effect over scenes: their mean by the first rules, later the Hodges-Lehmann estimate."""
    interval: tuple[float, float] | None = None
    """95 % interval of that effect."""
    p_rank: float | None = None
    """Exact p of the signed-rank test against no effect."""
    neutral: float = 0.0
    """The effect that is none: 0, of a ratio 1."""
    paper: float | None = None
    """The effect in the paper."""
    accepted: tuple[float, float] | None = None
    """Effects of the claimed size; ends may be infinite."""

    @property
    def asks(self) -> tuple[object, ...]:
        """Return what the check compares and asks for, whatever its words."""
        return self.effect_of, self.scenes, self.paper, self.accepted


@dataclass(frozen=True, slots=True)
class ClaimEntry:
    """One claim with its verdict."""

    id: str
    sentence: str
    verdict: str
    checks: tuple[CheckEntry, ...] = ()
    """Those that decide."""
    text: str = ""
    """Reason of a verdict that no check gave; empty where checks did."""
    asked_by: Literal["paper", "graycard"] = "paper"
    stability: float | None = None
    """Share of refits that would give the same verdict; None where it was not estimated."""
    suspended: str = ""
    """Reason that the verdict is held back; empty where it is not."""
    before: str = ""
    """Verdict of the rule, where it is held back."""


@dataclass(frozen=True, slots=True)
class PaperEntry:
    """The claims of one paper, and the file that they were read from."""

    name: Name
    version: int
    claims_sha256: str
    claims: tuple[ClaimEntry, ...]


@dataclass(frozen=True, slots=True)
class LedgerEntry:
    """One published ledger."""

    suite: str
    """Empty for papers' tables against themselves, which no run is needed for."""
    suite_version: int
    file: RelativePath
    """Place of the ledger below the folder of the history, as ``dark/claims.json``."""
    date: str
    """Day of publication, ISO 8601."""
    run_sha256: str
    rules_sha256: str
    """Hash of what the ledger says of its rules."""
    papers: tuple[PaperEntry, ...]
    commit: str = ""
    """Commit that published it; empty while it is not known."""
    started: str = ""
    """Begin of the run, by which the same fits are known again; empty without a run."""

    @property
    def claims(self) -> dict[str, ClaimEntry]:
        """Return all claims by their id."""
        return {claim.id: claim for paper in self.papers for claim in paper.claims}


@dataclass(frozen=True, slots=True)
class VerdictHistory:
    """All published ledgers, in the order of publication."""

    entries: tuple[LedgerEntry, ...]
    format: str = "graycard-history"
    format_version: int = HISTORY_VERSION

    def of_suite(self, suite: str) -> tuple[LedgerEntry, ...]:
        """Return the ledgers of one suite; the first is number 1 in reasons and on the page."""
        return tuple(entry for entry in self.entries if entry.suite == suite)

    @property
    def suites(self) -> tuple[str, ...]:
        """Return the names of the suites, in the order in which they were first published."""
        return tuple(dict.fromkeys(entry.suite for entry in self.entries))


def read_history(folder: Path) -> VerdictHistory:
    """Return the history in a folder of published runs.

    Raises:
        RecordError: It is missing, damaged, misspelt, or of a newer format.
    """
    return read_record(VerdictHistory, Path(folder) / HISTORY, "graycard-history", HISTORY_VERSION)
