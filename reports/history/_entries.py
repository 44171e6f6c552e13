# SPDX-License-Identifier: Apache-2.0
"""From a ledger as JSON, of any version of its format, to an entry of the history."""

import hashlib
import json
from collections.abc import Mapping
from typing import Any

from graycard import RecordError
from graycard.io import from_builtins
from graycard.records import LedgerEntry

_DIGITS = 6
"""Digits of numbers that are kept: more than any page shows."""


def entry_of(
    ledger: Mapping[str, Any], file: str, date: str, *, started: str = "", commit: str = ""
) -> LedgerEntry:
    """Return the entry that keeps a ledger's verdicts.

    Args:
        ledger: JSON of ``claims.json``, of format version 1 or 2: words of verdicts are kept as they are.
        file: Place of the ledger below the folder of the history.
        date: Day of publication, ISO 8601.
        started: Begin of the run; empty without one.
        commit: Commit that published it; empty where it is not known.

    Raises:
        RecordError: The JSON is no ledger.
    """
    try:
        entry = {
            "suite": ledger["suite"],
            "suite_version": ledger["suite_version"],
            "file": file,
            "date": date,
            "run_sha256": ledger["run_sha256"],
            "rules_sha256": rules_hash(ledger["rules"]),
            "papers": [_paper(paper) for paper in ledger["papers"]],
            "commit": commit,
            "started": started,
        }
    except (KeyError, TypeError) as cause:
        raise RecordError(f"expected a ledger in {file}, got one without {cause}") from cause
    return from_builtins(LedgerEntry, entry, RecordError, file)


def rules_hash(rules: Mapping[str, str]) -> str:
    """Return the first 12 characters of the SHA-256 of rules' words, by which their edition is known."""
    text = json.dumps(dict(rules), sort_keys=True, ensure_ascii=False)
    return hashlib.sha256(text.encode()).hexdigest()[:12]


def _paper(paper: Mapping[str, Any]) -> dict[str, Any]:
    kept = {name: paper[name] for name in ("name", "version", "claims_sha256")}
    return kept | {"claims": [_claim(claim) for claim in paper["claims"]]}


def _claim(claim: Mapping[str, Any]) -> dict[str, Any]:
    checks = [_check(check) for check in claim["checks"] if check["decides"]]
    measured = any(check["interval"] for check in checks)
    return {
        "id": claim["id"],
        "sentence": claim["sentence"],
        "verdict": claim["verdict"],
        "checks": checks,
        "text": "" if measured else claim["text"],
        "asked_by": claim.get("asked_by", "paper"),
        "stability": _rounded(claim.get("stability")),
        "suspended": claim.get("suspended", ""),
        "before": claim.get("before") or "",
    }


def _check(check: Mapping[str, Any]) -> dict[str, Any]:
    kept = ("id", "effect_of", "quantity", "verdict", "unit", "neutral", "paper", "accepted")
    return {name: check[name] for name in kept} | {
        "scenes": len(check["scenes"]),
        "estimate": _rounded(check.get("estimate", check.get("mean"))),
        "interval": _rounded(check["interval"]),
        "p_rank": _rounded(check["p_rank"]),
    }


def _rounded(value: Any) -> Any:
    """Return a number, or each of several, with as many digits as are kept; anything else as it is."""
    if isinstance(value, list):
        return [_rounded(part) for part in value]
    return float(f"{value:.{_DIGITS}g}") if isinstance(value, float) else value
