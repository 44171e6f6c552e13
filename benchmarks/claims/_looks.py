# SPDX-License-Identifier: Apache-2.0
"""Claims at each look of a run that adds scenes until they are decided."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from graycard.benchmarks.claims._claim import Check, Claim, Paper, load_claims
from graycard.benchmarks.claims._judge import judge_claims, judge_paper
from graycard.benchmarks.claims._needs import with_needs
from graycard.benchmarks.claims._rules import OPEN, is_decided
from graycard.records import CheckResult, ClaimResult, Ledger, PaperResult, RunRecord
from graycard.synth import SceneSpec, resolved_knobs

NOT_TESTABLE = "not testable here"


def judge_run(record: RunRecord, run: Path, names: Sequence[str], **options: Any) -> Ledger:
    """Return the ledger of a run; where scenes were added until claims were decided, by the rule of such
    runs.

    A claim has the verdict of the look that decided it, else that of the last at which it was pursued. Papers
    that were not pursued are judged on the scenes of the suite.

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
    looks = [
        judge_claims(record.at_look(number), run, names, level=record.looks.level, **options)
        for number in range(len(record.looks.made))
    ]
    found = looks[0]
    for look, later in zip(record.looks.made, looks[1:], strict=False):
        found = _followed(found, later, look.undecided)
    return with_needs(replace(found, edition=record.edition), record, papers)


def _followed(ledger: Ledger, later: Ledger, pursued: Sequence[str]) -> Ledger:
    """Return a ledger with what a later look says of claims that were open, and still pursued.

    The others were given up: their rows were not fitted on the scenes of the later look.
    """
    both = zip(ledger.papers, later.papers, strict=True)
    return replace(ledger, papers=tuple(_paper(p, q, pursued) for p, q in both))


def _paper(paper: PaperResult, later: PaperResult, pursued: Sequence[str]) -> PaperResult:
    both = zip(paper.claims, later.claims, strict=True)
    goes_on = [not is_decided(a.verdict) and f"{paper.name} {a.id}" in pursued for a in paper.claims]
    claims = (_later(a, b) if on else a for (a, b), on in zip(both, goes_on, strict=True))
    return replace(paper, claims=tuple(claims))


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
    added: tuple[SceneSpec, ...] = ()
    """Scenes that may be added."""
    untestable: Mapping[str, str] = field(default_factory=dict)
    """Reasons that claims were given up undecided, by paper and id: a row and a scene without a score, or a
    row that the suite lacks. Claims that their file calls unavailable are not among them."""

    def after(self, record: RunRecord, level: float) -> "Pursued":
        """Return what is left once the claims are judged by a run at a level."""
        results = {
            f"{paper.name} {result.id}": result
            for paper in self.papers
            for result in judge_paper(paper, record, level=level)
        }
        undecided = {k: found for k, found in self.claims.items() if not is_decided(results[k].verdict)}
        left = {
            name: (paper, claim)
            for name, (paper, claim) in undecided.items()
            if results[name].verdict in OPEN or self._waits(paper, claim, record)
        }
        lost = {
            name: results[name].text.removeprefix("cannot be tested here: ")
            for name, (_, claim) in undecided.items()
            if name not in left and not claim.unavailable
        }
        return replace(self, claims=left, untestable={**self.untestable, **lost})

    def _waits(self, paper: Paper, claim: Claim, record: RunRecord) -> bool:
        """Tell if a deciding check of a claim has no scene yet, but may be given some."""
        there = [SceneSpec(s.track, s.family, s.seed or 0, s.knobs) for s in record.scenes]
        return not claim.unavailable and any(
            any(_is_about(check, paper, spec) for spec in self.added)
            and not any(_is_about(check, paper, spec) for spec in there)
            for check in _deciding(claim)
        )

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
            _is_about(check, paper, spec)
            for paper, claim in self.claims.values()
            for check in _deciding(claim)
        )


def pursue(papers: Sequence[Paper], added: Sequence[SceneSpec] = ()) -> Pursued:
    """Return all claims of papers, to be decided by a suite and scenes that may be added to it."""
    claims = {f"{p.name} {c.id}": (p, c) for p in papers for c in p.claims}
    return Pursued(tuple(papers), claims, tuple(added))


def _deciding(claim: Claim) -> list[Check]:
    return [check for check in claim.checks if check.decides]


def _is_about(check: Check, paper: Paper, spec: SceneSpec) -> bool:
    if paper.track != spec.track:
        return False
    if check.scenes.families and spec.family not in check.scenes.families:
        return False
    knobs = resolved_knobs(spec)
    return all(
        isinstance(knobs.get(name), int | float) and low <= knobs[name] <= high
        for name, (low, high) in check.scenes.knobs.items()
    )
