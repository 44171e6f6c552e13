# SPDX-License-Identifier: Apache-2.0
"""The words of people in ``history.toml``: editions of the rules, and why verdicts changed."""

from dataclasses import dataclass
from pathlib import Path
from typing import Literal, get_args

from graycard import RecordError
from graycard.io import from_builtins, read_toml

REASONS = "history.toml"
"""Beside ``history.json``."""

Cause = Literal[
    "new run", "rows added", "noise measured", "method changed", "checks changed", "rules changed"
]
"""``new run``: scenes were fitted again. ``rows added``: the same run could not test the claim before.
``noise measured``: how far other fits of the same scenes would differ was not known before, or less well.
``method changed``: by other code or settings of a method. ``checks changed``: the claim is held against other
comparisons. ``rules changed``: the same numbers are judged in another way."""
CAUSES: tuple[Cause, ...] = get_args(Cause)


@dataclass(frozen=True, slots=True)
class Edition:
    """Rules that verdicts follow from, for as long as they stayed the same."""

    name: str
    says: str
    """Their demands, and the difference from those before."""
    words: tuple[str, ...]
    """The verdicts that they know, from the worst to the best."""
    rules: tuple[str, ...]
    """Hashes of ``rules`` of the ledgers; several where only their words changed."""


@dataclass(frozen=True, slots=True)
class Reason:
    """Reason that verdicts of one ledger are not those of the ledger before."""

    suite: str
    entry: int
    """Number of the ledger among those of its suite, from 1."""
    claims: tuple[str, ...]
    causes: tuple[Cause, ...]
    why: str

    def __post_init__(self) -> None:
        if not (self.claims and self.causes and self.why.strip()):
            raise ValueError(f"expected claims, causes and why, got {self}")


@dataclass(frozen=True, slots=True)
class Note:
    """A remark for the reader of a suite's history."""

    suite: str
    says: str


@dataclass(frozen=True, slots=True)
class Reasons:
    """All that stands in ``history.toml``."""

    editions: tuple[Edition, ...] = ()
    """From the oldest to the newest."""
    notes: tuple[Note, ...] = ()
    reasons: tuple[Reason, ...] = ()

    def of_claim(self, suite: str, entry: int, claim: str) -> tuple[Reason, ...]:
        """Return what is written of one claim in one ledger."""
        return tuple(r for r in self.reasons if (r.suite, r.entry) == (suite, entry) and claim in r.claims)

    def edition(self, rules_sha256: str) -> Edition:
        """Return the edition of a hash of rules.

        Raises:
            RecordError: No edition lists it.
        """
        for edition in self.editions:
            if rules_sha256 in edition.rules:
                return edition
        raise RecordError(
            f"expected rules of an edition in {REASONS}, got rules {rules_sha256!r} that none lists. Add the "
            "hash to `rules` of the last edition if only words changed; else begin an [[editions]]"
        )


def load_reasons(folder: Path) -> Reasons:
    """Return what is written beside the history in a folder.

    Raises:
        RecordError: It is missing, no TOML, or has an unknown or missing key or an unknown cause.
    """
    path = Path(folder) / REASONS
    data = read_toml(path)
    return from_builtins(Reasons, data, RecordError, str(path))
