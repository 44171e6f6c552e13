# SPDX-License-Identifier: Apache-2.0
"""Claims at each look of a run that adds scenes until they are decided."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from graycard.benchmarks.claims._claim import Check, Claim, Paper, load_claims
from graycard.benchmarks.claims._judge import judge_claims, judge_paper
from graycard.benchmarks.claims._needs import with_needs
from graycard.benchmarks.claims._rules import OPEN
from graycard.records import CheckResult, ClaimResult, Ledger, PaperResult, RunRecord
from graycard.synth import SceneSpec, resolved_knobs

NOT_TESTABLE = "not testable here"


def judge_run(record: RunRecord, run: Path, names: Sequence[str], **options: Any) -> Ledger:
    """Return the ledger of a run; where scenes were added until claims were decided, by the rule of such
    runs.

    A claim has the verdict of the look that decided it, else that of the last. Papers that were not pursued
    are judged on the scenes of the suite.

    Args:
        record: Of the run.
        run: The folder that it was read from.
        names: Of files of claims, or paths to them.
        options: As of :func:`judge_claims`.

    Raises:
        UnknownNameError: There are no such claims.
        RecordError: A file of claims is broken, or is made for the runs of another suite.
    """
    papers = [load_claims(name) for name in names]
    if record.looks is None:
        found = replace(judge_claims(record, run, names, **options), edition=record.edition)
        return with_needs(found, record, papers)
    found, pursued = None, record.looks.claims
    for number in range(len(record.looks.made)):
        at_look = record.at_look(number)
        later = judge_claims(at_look, run, names, level=record.looks.level, **options)
        found = later if found is None else _followed(found, later, pursued)
    assert found is not None, "a run that was recorded has a look"
    return with_needs(replace(found, edition=record.edition), record, papers)


def _followed(ledger: Ledger, later: Ledger, pursued: Sequence[str]) -> Ledger:
    """Return a ledger with what a later look says of the claims that it leaves open."""
    both = zip(ledger.papers, later.papers, strict=True)
    return replace(ledger, papers=tuple(_paper(p, q) if p.name in pursued else p for p, q in both))


def _paper(paper: PaperResult, later: PaperResult) -> PaperResult:
    both = zip(paper.claims, later.claims, strict=True)
    return replace(paper, claims=tuple(_later(a, b) if a.verdict in OPEN else a for a, b in both))


def _later(before: ClaimResult, after: ClaimResult) -> ClaimResult:
    """Return the later result; checks that decide nothing, whose rows were given up, stay as they were."""
    checks = zip(before.checks, after.checks, strict=True)
    return replace(after, checks=tuple(a if _given_up(a, b) else b for a, b in checks))


def _given_up(before: CheckResult, after: CheckResult) -> bool:
    return not after.decides and after.verdict == NOT_TESTABLE and before.verdict != NOT_TESTABLE


@dataclass(frozen=True, slots=True)
class Pursued:
    """Claims that are to be decided by more scenes."""

    papers: tuple[Paper, ...]
    claims: Mapping[str, tuple[Paper, Claim]]
    """Those that are open still, by paper and id."""

    def after(self, record: RunRecord, level: float) -> "Pursued":
        """Return what is left once the claims are judged by a run at a level."""
        verdicts = {
            f"{paper.name} {result.id}": result.verdict
            for paper in self.papers
            for result in judge_paper(paper, record, level=level)
        }
        return replace(self, claims={k: v for k, v in self.claims.items() if verdicts[k] in OPEN})

    def rows(self) -> set[str]:
        """Return the rows that open claims stand on, with their upper bounds and trivial rows."""
        found: set[str] = set()
        for paper, claim in self.claims.values():
            found |= {claim.bound or paper.bound, claim.trivial or paper.trivial}
            found |= {row for check in _deciding(claim) for row in (*check.rows, *check.minus)}
        nested = [pair for paper in self.papers for pair in paper.nested]
        return found | {pair.inner for pair in nested if pair.outer in found}

    def concerns(self, spec: SceneSpec) -> bool:
        """Tell whether a deciding check of an open claim is about a scene."""
        return any(
            paper.track == spec.track and _is_about(check, spec)
            for paper, claim in self.claims.values()
            for check in _deciding(claim)
        )


def pursue(papers: Sequence[Paper]) -> Pursued:
    """Return all claims of papers that runs can test."""
    claims = {f"{p.name} {c.id}": (p, c) for p in papers for c in p.claims}
    return Pursued(tuple(papers), claims)


def _deciding(claim: Claim) -> list[Check]:
    return [check for check in claim.checks if check.decides]


def _is_about(check: Check, spec: SceneSpec) -> bool:
    if check.scenes.families and spec.family not in check.scenes.families:
        return False
    knobs = resolved_knobs(spec)
    return all(
        isinstance(knobs.get(name), int | float) and low <= knobs[name] <= high
        for name, (low, high) in check.scenes.knobs.items()
    )
